"""Methods with memory: multistep and general linear methods, their underlying one-step methods and parasitic modes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
