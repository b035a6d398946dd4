"""Names of methods and scenes as a paper prints them, in titles and captions: Störmer–Verlet for stormer-verlet."""

from __future__ import annotations

import re
from functools import cache
from textwrap import fill
from typing import TYPE_CHECKING

from integrators.methods.catalogue.registry import catalogue
from integrators.scenes.catalogue.registry import scene_catalogue

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH = 54
"""Largest number of characters in a line of a title."""
_NAME = re.compile(r"(?<![\w./\\-])[a-z][a-z0-9]+(?:-[a-z0-9]+)*(?![\w/\\-]|\.\w)")
"""A name in a text; file names are none."""
_POWER = re.compile(r"(?<=\w)\^([0-9]+)\b")
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


@cache
def _titles() -> dict[str, str]:
    """The titles of methods, of families followed by {s}, and of scenes."""
    methods = {entry.name + "{s}" * entry.is_family: entry.title for entry in catalogue()}
    return methods | {entry.name: entry.title for entry in scene_catalogue()}


def printed_name(name: str) -> str:
    """The title of a method or a scene of the catalogues; any other name is left alone.

    Example:
        >>> printed_name("stormer-verlet-kdk"), printed_name("symplectic-euler-p"), printed_name("rk4")
        ('Störmer–Verlet (KDK)', 'symplectic Euler (implicit p)', 'RK4')
        >>> printed_name("gauss3"), printed_name("lotka-volterra"), printed_name("my-method")
        ('Gauss 3', 'Lotka–Volterra', 'my-method')
    """
    family = name.rstrip("0123456789")
    if title := _titles().get(f"{family}{{s}}"):
        return f"{title} {name.removeprefix(family)}"
    return _titles().get(name) or name


def printed_text(text: str) -> str:
    """A text with the names of catalogues in it as printed, and with whole powers as superscripts.

    Example:
        >>> printed_text("stormer-verlet-kdk on perturbed-kepler, h = 0.1"), printed_text("rk4.csv, h = 0.1")
        ('Störmer–Verlet (KDK) on perturbed Kepler, h = 0.1', 'rk4.csv, h = 0.1')
    """
    raised = _POWER.sub(lambda found: found[1].translate(_SUPERSCRIPTS), text)
    return _NAME.sub(lambda found: printed_name(found[0]), raised)


def write_title(ax: Axes, text: str) -> None:
    """Write a title, wrapped for narrow figures, in place of any other; `$` in names does not begin a formula."""
    for place in ("left", "center", "right"):
        ax.set_title("", loc=place)
    text = printed_text(text.removeprefix("the ")).replace(" = ", "\xa0=\xa0")
    ax.set_title(fill(text, WIDTH), parse_math=False)
