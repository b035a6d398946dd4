"""Settings for tests and doctests alike: generated code is kept with the tests' other caches, not with the user's."""

import os
from pathlib import Path

os.environ.setdefault("BSERIES_CACHE", str(Path(__file__).parent / ".pytest_cache" / "generated"))
