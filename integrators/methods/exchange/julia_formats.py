"""Julia: tableaus of RungeKutta.jl and of SciML."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from integrators.methods.exchange.array_text import JULIA
from integrators.methods.exchange.tableau_parts import (
    Format,
    Numbers,
    at_least,
    header,
    identifier,
    one_row,
    orders,
    quoted,
    rounded,
    rounding,
    square,
    vector,
)
from integrators.methods.tableaux.runge_kutta import RungeKutta

EXACT = Numbers("{}", "{}//{}")


def _matrix(rows: Sequence[Sequence[Any]], digits: int | None) -> str:
    """A matrix; of one entry, with the two semicolons that tell it from a vector."""
    if len(rows) == 1:
        return f"[{EXACT.row(rows[0], digits)};;]"
    return "[\n" + "".join(f"    {EXACT.row(row, digits, ' ')}\n" for row in rows) + "]"


def _vector(values: Iterable[Any], digits: int | None) -> str:
    return f"[{EXACT.row(values, digits)}]"


def _write_rungekutta_jl(method: RungeKutta) -> str:
    shown, order = rounded(method), orders(method)[0]
    left_out = "Embedded weights have no place in it." if method.embedded else ""
    name = quoted(method.name).replace("$", "\\$")
    return f"""# {header(method, "RungeKutta.jl", left_out, rounding(method), at_least(order))}
using RungeKutta

a = {_matrix(shown.A, shown.digits)}
b = {_vector(shown.b, shown.digits)}
c = {_vector(shown.c, shown.digits)}
tableau = Tableau{{Float64}}(Symbol({name}), {order}, a, b, c)
"""


def _tabulated(text: str) -> str:
    """The table that ``RungeKutta.to_file`` writes, c | A above b, as assignments; other text unchanged."""
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if "=" in text or not lines or len({len(lines), *map(len, lines)}) > 1:
        return text
    *rows, weights = ([f"({entry})" for entry in line] for line in lines)
    A = ", ".join(f"[{', '.join(row[1:])},]" for row in rows)
    c, b = ", ".join(row[0] for row in rows), ", ".join(weights[1:])
    return f"a = [{A},]\nb = [{b},]\nc = [{c},]\n"


def _rungekutta_jl_tableau(arrays: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    b = vector(arrays["b"])
    return square(arrays["a"], len(b)), b, arrays["c"], None


def _write_sciml(method: RungeKutta) -> str:
    shown = rounded(method)
    digits, (order, embedded_order) = shown.digits, orders(method)
    options = [f"adaptiveorder={embedded_order}", "αEEst=αEEst"] if shown.embedded else []
    if method.is_explicit and method.A[-1] == method.b:
        options.append("fsal=true")
    embedded = f"αEEst = Float64{_vector(shown.embedded[0], digits)}\n" if shown.embedded else ""
    kind = "ExplicitRKTableau" if method.is_explicit else "ImplicitRKTableau"
    return f"""# {header(method, "SciML", one_row(method), rounding(method), at_least(order))}
import DiffEqBase

A = Float64{_matrix(shown.A, digits)}
c = Float64{_vector(shown.c, digits)}
α = Float64{_vector(shown.b, digits)}
{embedded}{identifier(method.name)}_tableau = DiffEqBase.{kind}({", ".join(["A", "c", "α", str(order), *options])})
"""


def _sciml_tableau(arrays: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    b = vector(arrays["α"])
    return square(arrays["A"], len(b)), b, arrays["c"], [arrays["αEEst"]] if "αEEst" in arrays else None


RUNGEKUTTA_JL = Format(
    JULIA, r"\bTableau(?:\{\w+\})?\(|\A\s*#\s*\d+\s+\d+\s+\w+\s*$",
    r'\bTableau(?:\{\w+\})?\((?::|Symbol\(")([\w-]{1,100})', ("a", "b", "c"),
    _write_rungekutta_jl, _rungekutta_jl_tableau, _tabulated,
)  # fmt: skip
SCIML = Format(
    JULIA, "[Ee]xplicitRKTableau|ImplicitRKTableau", r"(\w+?)(?:_tableau)?\s*=\s*(?:\w+\.)?(?:Ex|Im)plicitRKTableau",
    ("A", "c", "α", "αEEst"), _write_sciml, _sciml_tableau,
)  # fmt: skip
