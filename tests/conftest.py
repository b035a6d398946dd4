"""Settings for all tests."""

import gc
from collections import defaultdict

import pytest
from hypothesis import settings

settings.register_profile("untimed", deadline=None, max_examples=50)  # the first example may import SymPy
settings.load_profile("untimed")


def pytest_configure():
    gc.set_threshold(
        50_000, 20, 20
    )  # ten thousand tests stay in memory: looking through them takes a tenth of the time


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark the cases of a test as slow, but for a few spread evenly: `make test` runs these, `make test-all` all."""
    cases = defaultdict(list)
    for item in items:
        if item.get_closest_marker("few") and not item.get_closest_marker("slow"):
            cases[item.nodeid.partition("[")[0]].append(item)
    for group in cases.values():
        (count,) = group[0].get_closest_marker("few").args
        kept = {k * len(group) // count for k in range(count)}
        for k, item in enumerate(group):
            if k not in kept:
                item.add_marker("slow")


def pytest_collection_finish(session):
    gc.freeze()
