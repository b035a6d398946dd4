"""Settings for all tests."""

from hypothesis import settings

settings.register_profile("untimed", deadline=None, max_examples=50)  # the first example may import SymPy
settings.load_profile("untimed")
