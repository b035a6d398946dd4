"""B-series and backward error analysis, on top of the packages `trees` and `integrators`.

``import bseries as bs`` is enough. The main names of all three packages are here, and the others are one level down:
``bs.stability``, ``bs.hopf``, ``bs.methods``, and so on. Heavy imports wait until a name is used (PEP 562);
``__init__.pyi`` is the list of public names, in each of these places.
"""

import ast as _ast
from importlib import import_module as _import_module
from pathlib import Path as _Path

import integrators as _integrators
import trees as _trees

for _package in (_trees, _integrators):
    _found = _Path(_package.__file__ or ".").resolve().parent
    if _found != _Path(__file__).resolve().parent.parent / _package.__name__:
        raise ImportError(f"bseries needs its own package {_package.__name__!r}, but {_found} hides it")

_modules = {"errors": ""}
for _node in _ast.parse(_Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body:
    if isinstance(_node, _ast.Import):
        _modules.update((_name.name, "") for _name in _node.names)
    elif isinstance(_node, _ast.ImportFrom):
        _module = f"{__name__}.{_node.module or ''}".rstrip(".") if _node.level else _node.module or ""
        _modules.update((_name.name, _module) for _name in _node.names)
__all__ = sorted(_modules)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name == "errors":
        return (_trees.TreeError, _integrators.IntegratorError, __getattr__("SeriesError"))
    if name == "__version__":
        from importlib.metadata import version

        return version("bseries-engine")
    if name not in _modules:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _modules[name]
    if module in ("", __name__):
        return _import_module(f"{module}.{name}".lstrip("."))
    return getattr(_import_module(module), name)


def __dir__() -> list[str]:
    return __all__.copy()
