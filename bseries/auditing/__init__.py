"""Audits of tableaus: what sources claim of methods, what is true, and which entries are wrong."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
