"""Formulas of a scene as LaTeX."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING
from unicodedata import name as unicode_name

from foundation.table import latex_text
from integrators.scenes.model.blocks import ROLES
from integrators.scenes.model.system import System

if TYPE_CHECKING:
    import sympy

GREEK = "GREEK SMALL LETTER "


def latex_formula(formula: sympy.Expr, scene: System) -> str:
    """A formula in variables and parameters of a scene."""
    import sympy

    names = {symbol: _latex_name(str(symbol)) for symbol in formula.free_symbols}
    return sympy.latex(formula, symbol_names=names | _components(scene))


def _latex_name(name: str) -> str:
    """The name of a variable or parameter: Greek letters and indices as LaTeX writes them."""
    import sympy

    if name.startswith("_"):
        return f"\\mathrm{{{latex_text(name)}}}"
    spelled = (unicode_name(letter).removeprefix(GREEK).lower() if _is_greek(letter) else letter for letter in name)
    return sympy.latex(sympy.Symbol("".join(spelled)))


def _is_greek(letter: str) -> bool:
    return unicode_name(letter, "").startswith(GREEK)


@lru_cache(maxsize=1)
def _components(scene: System) -> dict[sympy.Symbol, str]:
    """The names of components at sites: p_{x,1} for px1, and p_{x,i} for px_i in a term over sites."""
    import sympy

    names = {}
    for block in scene.blocks:
        base = _latex_name(block.name)
        for component in block.components if block.components != (block.name,) else ():
            axis = component.removeprefix(block.name)
            for site, symbol in enumerate(scene.symbols[block.places(component)], 1):
                names[symbol] = f"{base}_{{{axis},{site}}}"
            names |= {sympy.Symbol(f"{component}_{role}"): f"{base}_{{{axis},{role}}}" for role in ROLES}
    return names
