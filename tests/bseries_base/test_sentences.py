"""Errors are one line that can be shown, whatever they quote."""

from __future__ import annotations

import io
import pickle

import pytest

import bseries as bs
from bseries_base.errors import MOST, plain

HOSTILE = "a\x1b[31m\x00\ud800\u2028\n\t b"


@pytest.mark.parametrize("kind", bs.errors)
def test_errors_can_be_shown(kind):
    error = kind(f"name must be text, but was {HOSTILE}")
    assert str(error) == "name must be text, but was a\\x1b[31m\\x00\\ud800   b".replace("   b", "    b")
    assert str(error).isprintable()
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
    assert plain(str(error)) == str(error)


@pytest.mark.parametrize("kind", bs.errors)
def test_long_sentences_keep_their_ends(kind):
    text = str(kind(f"first {'x' * 10**6} last"))
    assert len(text) < MOST
    assert (text[:6], text[-5:]) == ("first ", " last")
    assert str(kind("é" * MOST)) == "é" * MOST


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (bs.parse_scene, "q'' = -\x1b[31m\ud800"),
        (bs.parse_scene, "q" + "'" * 2000 + " = 1"),
        (bs.load_series, '{"schema": 1, "kind": "series", "\x1b\ud800": 2}'),
        (lambda text: bs.shadow_energy(io.StringIO(text), scene="pendulum"), "t,\x1b[31m,\ud800\n0,1,2\n"),
    ],
)
def test_readers_quote_nothing_that_cannot_be_shown(call, text):
    with pytest.raises(bs.errors) as caught:
        call(text)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) <= MOST
