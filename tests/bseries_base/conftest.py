"""A cache of machine code for one test."""

from __future__ import annotations

import pytest


@pytest.fixture
def directory(tmp_path, monkeypatch):
    """The empty folder of the cache, which need not exist yet."""
    monkeypatch.setenv("BSERIES_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"
