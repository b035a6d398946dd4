"""Bindings to other packages: SciPy."""
