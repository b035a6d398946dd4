"""Hopf algebras of rooted trees: forests, formal sums, coproducts, antipodes and grafting products."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
