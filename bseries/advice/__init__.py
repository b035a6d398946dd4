"""Advice: work–precision diagrams, influence and cost of effects, predicted times and errors of runs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
