"""Settings for all tests."""

from hypothesis import settings

settings.register_profile("untimed", deadline=None)  # tests assert no time: the first example may import SymPy
settings.load_profile("untimed")
