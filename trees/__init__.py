"""Coloured and uncoloured rooted trees: values, notations, formulas, tables and pictures.

Submodules are imported on first use (PEP 562); ``__init__.pyi`` is the list of public names.
"""

import lazy_loader

import bseries_base.forks as _  # noqa: F401 (forks wait from the first import on)

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
