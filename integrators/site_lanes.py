"""Sums over pairs and other rows of sites in three passes: gather, compute, scatter.

In one loop over pairs, sums at the sites of a pair keep compilers from computing several pairs at once. So local
variables are gathered into work arrays first; the formula is a loop over lanes that do not depend on one another, which
becomes vector instructions; then the results are added to the sites, in the same order as in one loop. Up to
`MOST_FLAT` rows are lanes of one loop; of more pairs, those with the same first site. Where all pairs are lanes of one
loop, they mostly have an order of their own, and sites add up theirs (`integrators.site_pairs`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .lowering import MOST_PERMUTED
from .printer import count_operations, source_lines
from .site_pairs import filled, lane_data, ring_lines, suits_ring

if TYPE_CHECKING:
    import sympy

    from .site_loops import Context, SiteSum

FEWEST_LANES, FEWEST_PAIRS = 8, 3
MOST_FLAT = MOST_PERMUTED
MOST_LANES = 4096
SLOW = {"call", "power"}
"""Operations that have no vector instructions: they take so long that nothing else matters."""


def suits_lanes(total: SiteSum) -> bool:
    """Whether three passes are faster than one."""
    kind, n = total.sites.kind, total.sites.count
    if kind in ("single", "each") or total.sites.size < (FEWEST_PAIRS if kind == "pairs" else FEWEST_LANES):
        return False
    if total.sites.size > MOST_FLAT and (kind != "pairs" or n > MOST_LANES):
        return False
    formulas = [(f"v{k}", formula) for k, formula in enumerate(total.outputs.values())]
    return not SLOW & count_operations(source_lines(formulas, total.names())).keys()


def lane_lines(total: SiteSum, targets: Mapping[Any, str], context: Context) -> list[str]:
    """The statements of a sum in three passes.

    Args:
        total: The sum.
        targets: For keys of the outputs the left-hand side with its ``=`` or ``+=``.
        context: How numbers are written.
    """
    from .site_loops import difference, indented

    flat = total.sites.size <= MOST_FLAT
    lane = "r" if flat else "j"
    values, scatter = _values({key: total.outputs[key] for key in targets})
    if flat and suits_ring(total, targets, scatter):
        return ring_lines(total, targets, values, scatter, context)
    before, body, after = _sums(scatter, targets, lane, first=0 if total.sites.kind == "pairs" else None)
    names = total.names()
    local = {symbol: names[symbol] for symbol in total.arguments.values() if symbol in names}
    rows = filled([*total.sites.rows()]) if flat else []
    data, row = (lane_data(total, names, rows, context), []) if flat else _data(total, names, context)
    lanes = {symbol: f"{name}[{lane}]" for symbol, name in local.items()} | data
    formula = source_lines([(f"v{k}[{lane}]", value) for k, value in enumerate(values)], lanes)
    gather = [f"{local[s]}[{lane}] = {difference(a)}" for a, s in total.arguments.items() if s in local]
    size = len(rows) if flat else total.sites.count
    arrays = [f"{name} = stack({size})" for name in (*local.values(), *(f"v{k}" for k in range(len(values))))]
    if flat:
        following = ["r += 1"]
        idle = [f"{name}[{r}] = 1.0" for r in range(total.sites.size, size) for name in local.values()]
        return [
            *arrays,
            *idle,
            "r = 0",
            *total.loop([], gather + following, [], context),
            f"for r in range({size}):",
            *indented(formula),
            "r = 0",
            *total.loop(before, body + following, after, context),
        ]
    lanes_of_row = f"for j in range(i + 1, {size}):"
    passes = [line for lines in (gather, formula, body) for line in (lanes_of_row, *indented(lines))]
    return [*arrays, f"for i in range({size - 1}):", *indented([*row, *before, *passes, *after])]


def _values(outputs: Mapping[Any, sympy.Expr]) -> tuple[list[sympy.Expr], dict[Any, tuple[int, str]]]:
    """Different values up to their sign, and for each output which of them it is, with the sign."""
    values: list[sympy.Expr] = []
    scatter: dict[Any, tuple[int, str]] = {}
    for key, formula in outputs.items():
        if -formula in values:
            scatter[key] = values.index(-formula), "-"
            continue
        if formula not in values:
            values.append(formula)
        scatter[key] = values.index(formula), "+"
    return values, scatter


def _sums(
    scatter: Mapping[Any, tuple[int, str]], targets: Mapping[Any, str], lane: str, first: int | None
) -> tuple[list[str], list[str], list[str]]:
    """Statements before, in and after the loop over lanes: what goes to the first site of a row is summed up first."""
    before: list[str] = []
    body: list[str] = []
    after: list[str] = []
    for key, target in targets.items():
        number, sign = scatter[key]
        left, operation = target.rsplit(" ", 1)
        if first is not None and getattr(key, "role", None) == first:
            name = f"a{len(after)}"
            before.append(f"{name} = 0.0")
            after.append(f"{target} {name}")
            left, operation = name, "+="
        value = f"v{number}[{lane}]"
        if operation == "+=":
            body.append(f"{left} {sign}= {value}")
        else:
            body.append(f"{left} = {value if sign == '+' else f'-{value}'}")
    return before, body, after


def _data(
    total: SiteSum, names: Mapping[sympy.Symbol, str], context: Context
) -> tuple[dict[sympy.Symbol, str], list[str]]:
    """How the lanes of a row read parameters of sites, and statements that read those of its first site."""
    found: dict[sympy.Symbol, str] = {}
    row: list[str] = []
    for data, symbol in total.data.items():
        if symbol not in names:
            continue
        if data.role == 0:
            found[symbol] = names[symbol]
            row.append(f"{names[symbol]} = {context.numbers(data.values)}[i]")
        else:
            found[symbol] = f"{context.numbers(data.values)}[j]"
    return found, row
