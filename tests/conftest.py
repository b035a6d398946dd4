"""Settings for all tests, and the option that runs them with numba from the start, or in processes without it."""

import gc
import sys
from collections import defaultdict

import pytest
from hypothesis import settings

from trees import compiled

settings.register_profile("untimed", deadline=None, max_examples=50)  # the first example may import SymPy
settings.load_profile("untimed")


class SkipsWhatLoadsNumba:
    """A finder of modules that lets nobody import numba."""

    def find_spec(self, name, path=None, target=None):
        if name == "numba":
            pytest.skip("loads numba", allow_module_level=True)


def pytest_addoption(parser):
    parser.addoption("--numba", choices=["first", "never"], help="import numba first, or skip the tests that import it")


def pytest_configure(config):
    gc.set_threshold(
        50_000, 20, 20
    )  # ten thousand tests stay in memory: looking through them takes a tenth of the time
    if config.getoption("numba") == "first":
        import numba  # noqa: F401
    elif config.getoption("numba") == "never":
        sys.meta_path.insert(0, SkipsWhatLoadsNumba())


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


def pytest_runtest_setup(item):
    if item.config.getoption("numba") == "never":
        compiled._interpreted = 0.0  # each test begins as a new process does


def pytest_sessionfinish(session):
    assert session.config.getoption("numba") != "never" or "numba" not in sys.modules
