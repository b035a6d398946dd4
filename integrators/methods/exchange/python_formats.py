"""Python: arrays for nodepy, tableaus of diffrax, solver classes of SciPy."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from integrators.core.errors import IntegratorError
from integrators.methods.exchange import array_text
from integrators.methods.exchange.tableau_parts import (
    Format,
    Numbers,
    at_least,
    combined,
    header,
    identifier,
    one_row,
    orders,
    quoted,
    require,
    require_row_sums,
    rounded,
    rounding,
    square,
    vector,
)
from integrators.methods.tableaux.runge_kutta import RungeKutta

DOUBLES = Numbers("{}.0", "{} / {}")
SYMPY = Numbers("{}", "Rational({}, {})")
MOST_ROOT_STAGES = 3
"""Roots of methods with more stages have no short formulas."""


def _rows(numbers: Numbers, rows: Iterable[Sequence[Any]], digits: int | None, indent: str) -> str:
    """The rows of a matrix, one on each line."""
    lines = (f"{indent}    [{numbers.row(row, digits)}],\n" for row in rows)
    return f"[\n{''.join(lines)}{indent}]"


def _write_nodepy(method: RungeKutta) -> str:
    require_row_sums(method, "nodepy")
    is_long = method.stages > MOST_ROOT_STAGES
    shown = rounded(method) if is_long else method
    digits = shown.digits
    pair = method.is_explicit and bool(method.embedded)
    kind = "ExplicitRungeKuttaPair" if pair else f"{'Explicit' * method.is_explicit}RungeKuttaMethod"
    rest = "Embedded weights of implicit methods have no place in it." if method.embedded else ""
    notes = one_row(method) if pair else rest, rounding(method) if is_long else ""
    lines = [
        f"# {header(method, 'nodepy', *notes)}",
        "import numpy as np",
        f"from nodepy.runge_kutta_method import {kind}",
        "from sympy import Rational, cos, pi, sin, sqrt, tan  # noqa: F401",
        "",
        f"A = np.array({_rows(SYMPY, shown.A, digits, '')}, dtype=object)",
        f"b = np.array([{SYMPY.row(shown.b, digits)}], dtype=object)",
    ]
    if pair:
        lines.append(f"bhat = np.array([{SYMPY.row(shown.embedded[0], digits)}], dtype=object)")
    arguments = "A, b, bhat" if pair else "A, b"
    return "\n".join([*lines, f"method = {kind}({arguments}, name={quoted(method.name)})", ""])


def _nodepy_tableau(arrays: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    b = vector(arrays["b"])
    return square(arrays["A"], len(b)), b, None, [arrays["bhat"]] if "bhat" in arrays else None


def _write_diffrax(method: RungeKutta) -> str:
    require(
        method,
        "diffrax",
        holds=method.stages > 1 and (method.is_explicit or method.is_diagonally_implicit),
        what="explicit or diagonally implicit, with two stages or more,",
    )
    require_row_sums(method, "diffrax")
    shown = rounded(method)

    def array(values: Iterable[Any]) -> str:
        return f"np.array([{DOUBLES.row(values, shown.digits)}])"

    error = combined(shown.b, shown.embedded[0], -1) if shown.embedded else [shown.b[0] * 0] * shown.stages
    none = "" if shown.embedded else "Without embedded weights, the error is estimated as zero."
    lower = [f"        {array(row[:i])},\n" for i, row in enumerate(shown.A) if i]
    lines = [
        f"# {header(method, 'diffrax, which computes in doubles', one_row(method), none, rounding(method))}",
        "import numpy as np",
        "from diffrax import ButcherTableau",
        "",
        f"{identifier(method.name)}_tableau = ButcherTableau(",
        f"    c={array(shown.c[1:])},",
        f"    b_sol={array(shown.b)},",
        f"    b_error={array(error)},",
        f"    a_lower=(\n{''.join(lower)}    ),",
    ]
    if not method.is_explicit:
        # The stages are predicted by the derivative at the stage before.
        predictors = ("".join(["0.0, "] * i + ["1.0"]) for i in range(shown.stages - 1))
        lines += [
            f"    a_diagonal={array(row[i] for i, row in enumerate(shown.A))},",
            "    a_predictor=(\n" + "".join(f"        np.array([{row}]),\n" for row in predictors) + "    ),",
            f"    c1={DOUBLES.text(shown.c[0], shown.digits)},",
        ]
    return "\n".join([*lines, ")", ""])


def _diffrax_tableau(arrays: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    b, c = vector(arrays["b_sol"]), vector(arrays["c"])
    stages = len(b)
    diagonal = arrays.get("a_diagonal") or [0] * stages
    lower = [[], *arrays["a_lower"]]
    if len(lower) != stages or len(diagonal) != stages or any(len(row) != i for i, row in enumerate(lower)):
        raise IntegratorError(f"a_lower must have rows of 1 to {stages - 1} entries, as b_sol has {stages}")
    A = [[*row, diagonal[i], *[0] * (stages - 1 - i)] for i, row in enumerate(lower)]
    error = vector(arrays.get("b_error", []))
    return A, b, [arrays.get("c1", 0), *c], [combined(b, error, -1)] if any(error) else None


def _write_scipy(method: RungeKutta) -> str:
    require(
        method,
        "SciPy",
        holds=method.is_explicit and bool(method.embedded),
        what="explicit, with embedded weights,",
    )
    shown = rounded(method)
    digits, (order, embedded_order) = shown.digits, orders(method)
    notes = one_row(method), rounding(method), at_least(order)
    A, b, c, E = shown.A, shown.b, shown.c, combined(shown.embedded[0], shown.b, -1)
    if A[-1] == b and E[-1] != 0:  # the last stage is the derivative at the end of the step
        A, b, c = [row[:-1] for row in A[:-1]], b[:-1], c[:-1]
    else:
        E = [*E, E[0] * 0]
    return f"""# {header(method, "SciPy, which computes in doubles", *notes)}
import numpy as np
from scipy.integrate import RK45


class {"".join(part.capitalize() for part in identifier(method.name).split("_"))}Solver(RK45):
    order = {order}
    error_estimator_order = {min(order, embedded_order)}
    n_stages = {len(b)}
    A = np.array({_rows(DOUBLES, A, digits, "    ")})
    B = np.array([{DOUBLES.row(b, digits)}])
    C = np.array([{DOUBLES.row(c, digits)}])
    E = np.array([{DOUBLES.row(E, digits)}])
    # Between steps: the cubic polynomial with the values and derivatives at both ends.
    P = np.outer(np.append(B, 0), [0, 3, -2])
    P[0] += [1, -2, 1]
    P[-1] += [0, -1, 1]
"""


def _scipy_tableau(arrays: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    A, b, c = square(arrays["A"], len(vector(arrays["B"]))), vector(arrays["B"]), vector(arrays["C"])
    rows = arrays.get("E", [])
    differences = rows if rows and isinstance(rows[0], list) else [rows]
    if any(len(row) != len(b) + 1 for row in differences):
        raise IntegratorError(f"E must have {len(b) + 1} entries, one more than B, but has {len(differences[0])}")
    if any(row[-1] for row in differences):  # the estimate uses the derivative at the end of the step
        A, b, c = [*A, b], [*b, 0], [*c, 1]
    stages = len(b)
    A = [[*row, *[0] * (stages - len(row))] for row in A]
    return A, b, c, [combined(b, row[:stages], 1) for row in differences]


PYTHON = array_text.PYTHON
NODEPY = Format(
    PYTHON, r"nodepy|RungeKutta(?:Method|Pair)\(", r'\bname\s*=\s*"([^"\\\n]{1,100})"', ("A", "b", "bhat"),
    _write_nodepy, _nodepy_tableau,
)  # fmt: skip
DIFFRAX = Format(
    PYTHON, "ButcherTableau", r"(\w+?)(?:_tableau)?\s*=\s*ButcherTableau",
    ("a_lower", "b_sol", "b_error", "c", "a_diagonal", "c1"), _write_diffrax, _diffrax_tableau,
)  # fmt: skip
SCIPY = Format(
    PYTHON, r"\(\s*(?:\w+\.)?(?:RungeKutta|RK\d+|OdeSolver)\s*\)\s*:", r"class\s+(\w+?)(?:Solver)?\s*\(",
    ("A", "B", "C", "E"), _write_scipy, _scipy_tableau,
)  # fmt: skip
