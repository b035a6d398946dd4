"""Settings for tests and doctests alike: where generated code is kept, and for how long costs are measured."""

import os
import sys
from pathlib import Path

# With the tests' other caches, not with the user's.
os.environ.setdefault("BSERIES_CACHE", str(Path(__file__).parent / ".pytest_cache" / "generated"))


def pytest_collection_finish():
    """Measure costs for a tenth of the time, once: tests look at what is made of them, on busy machines too."""
    if timing := sys.modules.get("bseries.advice.timing"):
        timing.step_costs.__kwdefaults__["sample"] = timing.SAMPLE / 10
        timing.MOST_ROUNDS = timing.LEAST_ROUNDS
