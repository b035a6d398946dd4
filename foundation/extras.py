"""Import of optional packages."""

from __future__ import annotations

from importlib import import_module
from typing import Any

EXTRAS = {"matplotlib": "plot", "scipy": "scipy", "pandas": "frames", "xarray": "frames", "distributed": "cluster"}
EXTRAS |= dict.fromkeys(("bokeh", "jinja2"), "explore") | dict.fromkeys(("pypandoc", "typst"), "course")
EXTRAS["imageio_ffmpeg"] = "animate"
"""The extra of this distribution that installs a package."""


class MissingPackage(ImportError):
    """An optional package is not installed."""


def optional_module(module: str, user: str) -> Any:
    """Import a module of an optional package.

    Args:
        module: The module.
        user: What needs it, for the message.

    Raises:
        MissingPackage: The package cannot be imported; the message has the command to install it.

    Example:
        >>> optional_module("matplotlib.colors", "draw").to_hex("red")
        '#ff0000'
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise MissingPackage(
            f"{user} needs {package}: pip install '.[{EXTRAS[package]}]' in the clone of bseries-engine ({error})"
        ) from None
