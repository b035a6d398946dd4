"""Titles that name a scene, and displayed equations on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

from bseries_base.formulas import formula_text
from bseries_base.numbers import broken_sum
from bseries_base.table import Column, Table
from integrators.exact.arithmetic import FLOATS
from integrators.scenes.scene import latex_formula

if TYPE_CHECKING:
    import sympy

    from integrators import Scene

MOST_VARIABLES = 12
SHORT = 1_000
"""Displays write formulas out on scenes of at most so many variables, and stop after this many characters."""
ENERGY = r"\widetilde{H}"


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


def short_powers(scene: Scene, formulas: Callable[[int], Iterable[sympy.Expr]], count: int) -> range:
    """The first powers of h for displays: formulas of each further power take several times longer."""
    length = 0
    for k in range(count if scene.dimension <= MOST_VARIABLES else 0):
        if length > SHORT:
            return range(k)
        length += sum(len(str(formula)) for formula in formulas(k))
    return range(count if scene.dimension <= MOST_VARIABLES else 0)


def first_powers(title: str, count: int, to_table: Callable[[Sequence[int]], Table], powers: range) -> Table:
    """The table of the first powers of h out of `count`, with a note on the others."""
    rest = len(powers) < count and f"… {span(range(len(powers), count))}: to_table() writes all formulas"
    table = to_table(powers) if powers else Table(title, (), ())
    return table._replace(notes=[*filter(None, [rest]), *table.notes])


def remarks(series: Any, issues: Sequence[str], scene: Scene) -> dict[str, Any]:
    """Entries of JSON documents on the digits of a series, contradictions in a tableau and the notes of a scene."""
    lists = {"issues": list(issues), "notes": list(scene.notes)}
    digits = {} if series.digits is None else {"digits": series.digits}
    return digits | {key: value for key, value in lists.items() if value}


def formula_notes(series: Any, issues: Sequence[str], scene: Scene, *, nonzero: bool) -> Iterator[str]:
    """Sentences on the numbers in formulas on a scene."""
    if series.digits is not None:
        yield f"The tableau has decimals with {series.digits} correct digits, and so are these formulas."
    elif not series.is_exact:
        yield f"Floating point: {FLOATS}, so the numbers carry rounding errors."
    for note in scene.notes:
        yield f"{note[0].upper()}{note[1:]}."
    if nonzero:
        yield "Zero terms are left out."
    for issue in issues:
        yield f"Warning: {issue}."


def field_equations(scene: Scene, terms: Sequence[tuple[int, Sequence[sympy.Expr]]]) -> str:
    """Equations for all variables by powers of h, as a displayed align."""
    rows = []
    for i, symbol in enumerate(scene.symbols):
        base, *index = latex_formula(symbol, scene).partition("_{")
        summands = [_summand(k, field[i], scene) for k, field in terms if field[i] != 0]
        rows.append((f"\\dot{{{base}}}{''.join(index)}", summands))
    return align(rows, terms[0][0], terms[-1][0])


def hamiltonian_equation(scene: Scene, terms: Sequence[tuple[int, sympy.Expr]], limit: str) -> str:
    """A modified Hamiltonian by powers of h, as a displayed align, with a note on its truncation, if any."""
    summands = [_summand(k, formula, scene) for k, formula in terms if formula != 0]
    return align([(ENERGY, summands)], terms[0][0], terms[-1][0], remark=limit)


def align(rows: Iterable[tuple[str, Sequence[str]]], first: int, last: int, *, remark: str = "") -> str:
    """Equations with sums over consecutive powers of h on the right-hand sides, and a remark below."""
    rest = f"\\mathcal{{O}}(h^{{{last + 1}}})" if last else r"\mathcal{O}(h)"
    equations = []
    for left, summands in rows:
        start = [r"\cdots"] if first else [] if summands else ["0"]
        equations.append(f"{left} &= {broken_sum([*start, *summands, rest])}")
    equations += [f"&\\quad \\text{{{remark}}}"] if remark else []
    return "\n".join([r"\begin{align*}", " \\\\\n".join(equations), r"\end{align*}"]) + "\n"


def _summand(k: int, formula: sympy.Expr, scene: Scene) -> str:
    """A power of h with its coefficient, and with a sign if that is a minus."""
    text = latex_formula(formula, scene)
    if k == 0:
        return text
    h = f"h^{{{k}}}" if k > 1 else "h"
    if formula.is_Add:
        return f"{h} \\left({text}\\right)"
    sign = "- " if text.startswith("-") else ""
    factor = text.removeprefix("-").lstrip()
    return sign + (h if factor == "1" else f"{h}\\, {factor}")


def power_table(title: str, terms: Sequence[sympy.Expr], first: int, data: Callable[[], dict[str, Any]]) -> Table:
    """Formulas by powers of h, from the first power on."""
    columns = (Column("k", True), Column("coefficient of h^k"))
    return Table(title, columns, [(k, formula_text(term)) for k, term in enumerate(terms, first)], data=data)
