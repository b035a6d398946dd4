"""Settings for tests and doctests alike: where generated code is kept, and for how long costs are measured."""

import inspect
import os
import sys
from pathlib import Path

import pytest

from bseries_base.plotting import apart_from_pyplot

# With the tests' other caches, not with the user's.
os.environ.setdefault("BSERIES_CACHE", str(Path(__file__).parent / ".pytest_cache" / "generated"))


@pytest.fixture(autouse=True)
def plots_are_new():
    """Plots do not share pyplot's current axes, which other tests may have left."""
    with apart_from_pyplot():
        yield


def pytest_collection_modifyitems(items: list[pytest.Item]):
    """Examples of public things run in an empty namespace, as where a reader pastes them; with old dependencies too."""
    for item in items:
        if isinstance(item, pytest.DoctestItem) and item.path.suffix == ".py":
            item.add_marker("minimum")
    tests = [item.dtest for item in items if isinstance(item, pytest.DoctestItem) and item.dtest]
    tests = [test for test in tests if "__name__" in test.globs]
    if not tests:
        return
    import bseries

    places = [bseries, *(place for name in dir(bseries) if inspect.ismodule(place := getattr(bseries, name)))]
    public = {name: place for place in places for name in dir(place)}
    for test in tests:
        name = test.name.removeprefix(f"{test.globs['__name__']}.").partition(".")[0]
        if name in public and getattr(public[name], name) is test.globs.get(name):
            test.globs.clear()


def pytest_collection_finish():
    """Measure costs for a tenth of the time, once: tests look at what is made of them, on busy machines too."""
    if timing := sys.modules.get("bseries.advice.timing"):
        timing.step_costs.__kwdefaults__["sample"] = timing.SAMPLE / 10
        timing.ROUNDS = timing.ROUNDS._replace(most=timing.ROUNDS.least)
