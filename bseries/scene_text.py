"""Titles that name a scene, and its formulas as LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any
from unicodedata import name as unicode_name

from bseries.table import latex_text
from integrators.scenes.model.blocks import ROLES

if TYPE_CHECKING:
    import sympy

    from integrators import Scene

LINE = 120
"""Characters of LaTeX on a line of an equation."""
ENERGY = r"\widetilde{H}"
GREEK = "GREEK SMALL LETTER "


def place(method: str, scene: Scene, effects: Sequence[str] | None = None) -> str:
    """For titles: the method and the scene, with the effects that are on unless others are given."""
    return f"{method} on {with_effects(scene.name, scene.active if effects is None else effects)}"


def with_effects(scene: str, effects: Sequence[str]) -> str:
    """For titles: the name of a scene with its effects."""
    return scene + (f" with {', '.join(effects)}" if effects else "")


def head(kind: str, method: str, scene: Scene, effects: Sequence[str] | None = None) -> dict[str, Any]:
    """The first entries of JSON documents."""
    on = scene.active if effects is None else effects
    return {"schema": 1, "kind": kind, "method": method, "scene": scene.name, "effects": list(on)}


def span(powers: Sequence[int]) -> str:
    """For titles: the powers of h."""
    return f"powers h^{powers[0]} to h^{powers[-1]}" if len(powers) > 1 else f"power h^{powers[0]}"


def remarks(series: Any, issues: Sequence[str], scene: Scene) -> dict[str, Any]:
    """Entries of JSON documents on the digits of a series, contradictions in a tableau and the notes of a scene."""
    lists = {"issues": list(issues), "notes": list(scene.notes)}
    digits = {} if series.digits is None else {"digits": series.digits}
    return digits | {key: value for key, value in lists.items() if value}


def formula_notes(series: Any, issues: Sequence[str], scene: Scene, *, nonzero: bool) -> Iterator[str]:
    """Sentences on the numbers in formulas on a scene."""
    if series.digits is not None:
        yield f"The tableau is published as decimals with {series.digits} digits: numbers show what these tell."
    elif not series.is_exact:
        yield "Floating point: the tableau holds floats, so the numbers carry rounding errors."
    for note in scene.notes:
        yield f"{note[0].upper()}{note[1:]}."
    if nonzero:
        yield "What is zero is left out."
    for issue in issues:
        yield f"Beware: {issue}."


def latex_formula(formula: sympy.Expr, scene: Scene) -> str:
    """A formula in variables and parameters of a scene."""
    import sympy

    names = {symbol: _latex_name(str(symbol)) for symbol in formula.free_symbols}
    return sympy.latex(formula, symbol_names=names | _components(scene))


def field_equations(scene: Scene, terms: Sequence[tuple[int, Sequence[sympy.Expr]]]) -> str:
    """Equations for all variables by powers of h, as a displayed align.

    Args:
        scene: The scene.
        terms: Consecutive powers of h with what they multiply, one formula for each variable.
    """
    rows = []
    for i, symbol in enumerate(scene.symbols):
        base, *index = latex_formula(symbol, scene).partition("_{")
        summands = [_summand(k, field[i], scene) for k, field in terms if field[i] != 0]
        rows.append((f"\\dot{{{base}}}{''.join(index)}", summands))
    return align(rows, terms[0][0], terms[-1][0])


def hamiltonian_equation(scene: Scene, terms: Sequence[tuple[int, sympy.Expr]], limit: str) -> str:
    """A modified Hamiltonian by powers of h, as a displayed align, with a sentence that says where it ends, if any."""
    summands = [_summand(k, formula, scene) for k, formula in terms if formula != 0]
    return align([(ENERGY, summands)], terms[0][0], terms[-1][0], remark=limit)


def align(rows: Iterable[tuple[str, Sequence[str]]], first: int, last: int, *, remark: str = "") -> str:
    """Left sides and what they are equal to, sums of terms with consecutive powers of h; and a remark below."""
    rest = f"\\mathcal{{O}}(h^{{{last + 1}}})" if last else r"\mathcal{O}(h)"
    equations = []
    for left, summands in rows:
        start = [r"\cdots"] if first else [] if summands else ["0"]
        equations.append(f"{left} &= {_broken([*start, *summands, rest])}")
    equations += [f"&\\quad \\text{{{remark}}}"] if remark else []
    return "\n".join([r"\begin{align*}", " \\\\\n".join(equations), r"\end{align*}"]) + "\n"


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
def _components(scene: Scene) -> dict[sympy.Symbol, str]:
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


def _summand(k: int, formula: sympy.Expr, scene: Scene) -> str:
    """What a power of h multiplies, with it and with a sign if that is a minus."""
    text = latex_formula(formula, scene)
    if k == 0:
        return text
    h = f"h^{{{k}}}" if k > 1 else "h"
    if formula.is_Add:
        return f"{h} \\left({text}\\right)"
    sign = "- " if text.startswith("-") else ""
    factor = text.removeprefix("-").lstrip()
    return sign + (h if factor == "1" else f"{h}\\, {factor}")


def _broken(summands: Sequence[str]) -> str:
    """A sum on as many lines as it takes."""
    signed = [text if k == 0 or text.startswith("- ") else f"+ {text}" for k, text in enumerate(summands)]
    lines = signed[:1]
    for text in signed[1:]:
        if len(lines[-1]) + len(text) > LINE:
            lines.append(text)
        else:
            lines[-1] += f" {text}"
    return " \\\\\n&\\quad ".join(lines)
