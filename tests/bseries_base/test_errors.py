"""One base class of errors, and one speller of names."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import pytest

import bseries as bs

ROOT = Path(__file__).parents[2]
REQUESTS = {
    bs.TreeError: lambda: bs.Tree("[τ"),
    bs.IntegratorError: lambda: bs.method("rk44"),
    bs.SeriesError: lambda: bs.figure("no figure"),
}


@pytest.mark.parametrize("kind", REQUESTS)
def test_errors_of_all_packages_have_one_base_class(kind):
    with pytest.raises(bs.integrators.BSeriesError) as caught:
        REQUESTS[kind]()
    assert type(caught.value) is kind
    assert isinstance(caught.value, ValueError)


def test_no_kind_of_error_is_another():
    assert set(REQUESTS) == set(bs.errors)
    assert not any(issubclass(one, other) for one, other in permutations(REQUESTS, 2))


def test_one_file_looks_for_names_of_a_similar_spelling():
    folders = [ROOT / package for package in ("bseries_base", "trees", "integrators", "bseries")]
    found = [
        path
        for folder in folders
        for path in folder.rglob("*.py")
        if "get_close_matches" in path.read_text(encoding="utf-8")
    ]
    assert found == [ROOT / "bseries_base" / "errors.py"]


@pytest.mark.parametrize(
    ("request_of", "message"),
    [
        (lambda: bs.method("dorman-prince54"), "the nearest are dormand-prince54"),
        (lambda: bs.scene("keppler"), r"did you mean kepler\?$"),
        (lambda: bs.figure("energy-eror"), r"did you mean .*energy-error"),
    ],
)
def test_messages_on_unknown_names_suggest_known_ones(request_of, message):
    with pytest.raises(bs.integrators.BSeriesError, match=message):
        request_of()
