"""B-series and backward error analysis: the algebra of series, and the roof over `trees` and `integrators`.

``import bseries as bs`` is enough: the public names of all three packages are here. Heavy imports wait until a name is
used (PEP 562); ``__init__.pyi`` is the list of public names.
"""

import ast as _ast
from pathlib import Path as _Path

import lazy_loader as _lazy_loader

import integrators as _integrators
import trees as _trees

_own: dict[str, list[str]] = {}
for _node in _ast.parse(_Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body:
    if isinstance(_node, _ast.ImportFrom) and _node.level == 1 and _node.module:
        _own.setdefault(_node.module, []).extend(_name.name for _name in _node.names)
_get_own, _, _own_names = _lazy_loader.attach(__name__, submod_attrs=_own)

_owners = {}
for _package in (_trees, _integrators):
    _found = _Path(_package.__file__ or ".").resolve().parent
    if _found != _Path(__file__).resolve().parent.parent / _package.__name__:
        raise ImportError(f"bseries needs its own package {_package.__name__!r}, but {_found} hides it")
    _owners.update(dict.fromkeys(_package.__all__, _package))
__all__ = sorted([*_own_names, *_owners, "errors"])  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name == "errors":
        return (_trees.TreeError, _integrators.IntegratorError, _get_own("SeriesError"))
    if name in _owners:
        return getattr(_owners[name], name)
    return _get_own(name)


def __dir__() -> list[str]:
    return __all__.copy()
