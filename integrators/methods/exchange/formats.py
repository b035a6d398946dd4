"""Formats of other packages in Python, Julia and C.

SciPy and nodepy, RungeKutta.jl and SciML, Butcher tables of SUNDIALS and tableaus of PETSc.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import partial
from sys import float_info
from typing import Any, NamedTuple, TypeAlias

from bseries_base.errors import shorten
from integrators.core.arguments import as_lists
from integrators.core.errors import IntegratorError
from integrators.core.text_files import LARGEST_NUMBER
from integrators.exact.entries import Entry, is_sympy, multiply_entries, read_entry, round_entry, sum_entries
from integrators.exact.expressions import decimal_text, format_number
from integrators.methods.exchange.numbers import Number
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.methods.tableaux.weights import MAX_ORDER, order_of_weights

DOUBLE_DIGITS = 16
"""Decimals with so many significant digits or more count as rounded."""
LARGEST_DENOMINATOR = 10**6
"""Of fractions behind doubles: three of 100,000 random doubles are nearest to such a fraction."""
Arrays: TypeAlias = tuple[Any, Any, Any, Any]
"""The stage matrix, weights, nodes or None, and rows of embedded weights, as nested lists."""


class Format(NamedTuple):
    """The text and the objects of one package."""

    language: str  # the language of the text
    marks: str  # a pattern of what only text in this format has
    title: str  # a pattern of the name of the method in the text
    names: Sequence[str]  # the names of the arrays in the text
    write: Callable[[RungeKutta], str]
    tableau: Callable[[Mapping[str, Any]], Arrays]
    prepare: Callable[[str], str] = str  # rewrites text without assignments


class Numbers(NamedTuple):
    """How a language writes whole numbers, and quotients that it computes exactly or rounds once."""

    whole: str
    quotient: str
    largest: int | None = None

    def text(self, value: Any, digits: int | None) -> str:
        """An entry as text; published decimals keep their digits, roots are those of SymPy."""
        if isinstance(value, float):
            return repr(value)
        if is_sympy(value):
            return re.sub(r"(?<![\w.)])(\d+)/(\d+)", lambda match: self.quotient.format(*match.groups()), str(value))
        if value.denominator == 1 and (self.largest is None or abs(value) < self.largest):
            return self.whole.format(value)
        decimal = format_number(value) if digits is None else decimal_text(value)
        if "/" not in decimal and value.denominator > 1:
            return decimal
        if self.largest is None or max(abs(value.numerator), value.denominator) < self.largest:
            return self.quotient.format(value.numerator, value.denominator)
        return repr(round_entry(value))

    def row(self, values: Iterable[object], digits: int | None, separator: str = ", ") -> str:
        """Entries, one behind the other."""
        return separator.join(self.text(value, digits) for value in values)


def rounded(method: RungeKutta) -> RungeKutta:
    """The method, in doubles if it has roots."""
    return method.to_float() if method.domain == "algebraic" else method


def header(method: RungeKutta, package: str, embedded: object = None, *, order: int = 0, rounds: bool = True) -> str:
    """The text of the first comment, with what had no place; by default, embedded weights beyond the first row."""
    count = len(method.embedded)
    if embedded is None:
        embedded = f"Only the first of {count} rows of embedded weights is here." if count > 1 else ""
    notes = [
        f"{printable(method.name)}, a tableau for {package}.",
        embedded,
        "Roots are rounded to doubles." if rounds and method.domain == "algebraic" else "",
        f"Its order is {MAX_ORDER} or more." if order == MAX_ORDER else "",
    ]
    return " ".join(filter(None, notes))


def printable(name: str) -> str:
    """A name for comments, which end with the line."""
    return "".join(filter(str.isprintable, name))


def quoted(name: str) -> str:
    """A name in quotes, for Python, Julia and C."""
    return '"' + re.sub(r'([\\"])', r"\\\1", printable(name)) + '"'


def identifier(name: str) -> str:
    """A name of letters, digits and _, which begins with a letter; it may be a keyword."""
    cleaned = re.sub(r"\W", "_", name, flags=re.ASCII).strip("_")
    return cleaned if cleaned[:1].isalpha() else f"method_{cleaned}"


def orders(method: RungeKutta) -> tuple[int, int]:
    """The order of a method, at most `MAX_ORDER`, and that of its first row of embedded weights or 0."""
    import numpy as np

    shown, kind = (method, object) if method.domain == "QQ" else (method.to_float(), float)
    A, b, *embedded = (np.array(rows, dtype=kind) for rows in (shown.A, shown.b, *shown.embedded[:1]))
    return order_of_weights(A, b), order_of_weights(A, embedded[0]) if embedded else 0


def require(method: RungeKutta, package: str, *, holds: bool, what: str) -> None:
    """Refuse a method that a package has no form for."""
    if not holds:
        raise IntegratorError(f"method must be {what} for {package}, but was {shorten(method.name)}")


ROW_SUMS = "consistent, with nodes that are the row sums,"
"""What packages need that replace nodes by row sums."""


def square(values: object, stages: int) -> Any:
    """A stage matrix given by rows, as one long list, or as a number."""
    if not isinstance(values, list):
        return [[values]]
    if any(isinstance(row, list) for row in values):
        return values
    if len(values) != stages * stages:
        raise IntegratorError(f"A must have {stages}² entries, as many rows as b has entries, but has {len(values)}")
    return [values[i * stages : (i + 1) * stages] for i in range(stages)]


def vector(values: object) -> Any:
    """A row of entries, also of one."""
    return values if isinstance(values, list) else [values]


def combined(row: Sequence[Entry], other: Sequence[Entry], sign: int) -> list[Entry]:
    """A row plus or minus another."""
    if len(row) != len(other):
        raise IntegratorError(f"rows must have equally many entries, but had {len(row)} and {len(other)}")
    return [sum_entries((x, multiply_entries(Fraction(sign), y))) for x, y in zip(row, other, strict=True)]


class Entries:
    """Entries of arrays, read exactly, and the number of digits that are known of them.

    Formulas are exact, but long decimals in them are rounded numbers; doubles become their shortest decimals. With
    `fractions`, both become the nearest fraction with a small denominator where that rounds to the same double.
    """

    def __init__(self, *, fractions: bool) -> None:
        self.fractions = fractions
        self.known: list[int] = []
        self.longest = 0
        """The largest number of significant digits of a decimal."""

    @property
    def digits(self) -> int | None:
        """Known significant digits; None if all entries are exact."""
        return min(self.known, default=None)

    def read(self, values: object, name: str) -> Any:
        """Nested lists of entries."""
        values = as_lists(values)
        if isinstance(values, list | tuple) and not isinstance(values, Number):
            return [self.read(value, name) for value in values]
        number, digits = (values.value, values.digits) if isinstance(values, Number) else (values, 0)
        entry = read_entry(number, name)
        if isinstance(entry, float):
            decimal = Fraction(Decimal(repr(entry)))
            return decimal if decimal == entry else self._inexact(decimal, DOUBLE_DIGITS)
        self.longest = max(self.longest, digits)
        return self._inexact(entry, digits) if isinstance(entry, Fraction) and digits >= DOUBLE_DIGITS else entry

    def _inexact(self, value: Fraction, digits: int) -> Fraction:
        """A rounded number, or the fraction behind it."""
        nearest = value.limit_denominator(LARGEST_DENOMINATOR)
        if self.fractions and abs(value) <= float_info.max and float(nearest) == float(value):
            return nearest
        # The last of 17 digits is that of a double and not of the number.
        self.known.append(digits if digits > DOUBLE_DIGITS + 1 else DOUBLE_DIGITS)
        return value


SYMPY = Numbers("{}", "Rational({}, {})")
PYTHON_DOUBLES = Numbers("{}.0", "{} / {}")
C_DOUBLES = Numbers("{}.0", "{}.0 / {}.0", LARGEST_NUMBER)
JULIA_NUMBERS = Numbers("{}", "{}//{}")
MOST_ROOT_STAGES = 3
"""Roots of methods with more stages have no short formulas."""
PRINTED = r"^[ \t]*([Acbd])[ \t]*=([^=;{}]*?)(?=^[ \t]*[cbd][ \t]*=|\Z)"
"""A part of what ``ARKodeButcherTable_Write`` prints."""


def _by_name(
    arrays: Mapping[str, object], A: str, b: str, c: str, embedded: str = "", *, is_c_needed: bool = True
) -> Arrays:
    """The tableau whose arrays have these names; embedded weights may be missing."""
    weights, nodes = vector(arrays[b]), arrays[c] if is_c_needed else arrays.get(c)
    return square(arrays[A], len(weights)), weights, nodes, [arrays[embedded]] if embedded in arrays else None


def _rows(numbers: Numbers, rows: Iterable[Sequence[object]], digits: int | None, indent: str) -> str:
    """The rows of a matrix, one on each line."""
    lines = (f"{indent}    [{numbers.row(row, digits)}],\n" for row in rows)
    return f"[\n{''.join(lines)}{indent}]"


def _write_nodepy(method: RungeKutta) -> str:
    require(method, "nodepy", holds=not method.issues, what=ROW_SUMS)
    is_long = method.stages > MOST_ROOT_STAGES
    shown = rounded(method) if is_long else method
    digits = shown.digits
    pair = method.is_explicit and bool(method.embedded)
    kind = "ExplicitRungeKuttaPair" if pair else f"{'Explicit' * method.is_explicit}RungeKuttaMethod"
    rest = "Embedded weights of implicit methods have no place in it." if method.embedded else ""
    embedded = f"bhat = np.array([{SYMPY.row(shown.embedded[0], digits)}], dtype=object)\n" if pair else ""
    return f"""# {header(method, "nodepy", None if pair else rest, rounds=is_long)}
import numpy as np
from nodepy.runge_kutta_method import {kind}
from sympy import Rational, cos, pi, sin, sqrt, tan  # noqa: F401

A = np.array({_rows(SYMPY, shown.A, digits, "")}, dtype=object)
b = np.array([{SYMPY.row(shown.b, digits)}], dtype=object)
{embedded}method = {kind}({"A, b, bhat" if pair else "A, b"}, name={quoted(method.name)})
"""


def _write_diffrax(method: RungeKutta) -> str:
    fits = method.stages > 1 and (method.is_explicit or method.is_diagonally_implicit)
    require(method, "diffrax", holds=fits, what="explicit or diagonally implicit, with two stages or more,")
    require(method, "diffrax", holds=not method.issues, what=ROW_SUMS)
    shown = rounded(method)

    def array(values: Iterable[object]) -> str:
        return f"np.array([{PYTHON_DOUBLES.row(values, shown.digits)}])"

    error = combined(shown.b, shown.embedded[0], -1) if shown.embedded else [shown.b[0] * 0] * shown.stages
    none = None if shown.embedded else "Without embedded weights, the error is estimated as zero."
    lower = "".join(f"        {array(row[:i])},\n" for i, row in enumerate(shown.A) if i)
    implicit = ""
    if not method.is_explicit:
        # The stages are predicted by the derivative at the stage before.
        predictors = "".join(f"        np.array([{'0.0, ' * i}1.0]),\n" for i in range(shown.stages - 1))
        implicit = f"""\
    a_diagonal={array(row[i] for i, row in enumerate(shown.A))},
    a_predictor=(\n{predictors}    ),
    c1={PYTHON_DOUBLES.text(shown.c[0], shown.digits)},
"""
    return f"""# {header(method, "diffrax, which computes in doubles", none)}
import numpy as np
from diffrax import ButcherTableau

{identifier(method.name)}_tableau = ButcherTableau(
    c={array(shown.c[1:])},
    b_sol={array(shown.b)},
    b_error={array(error)},
    a_lower=(\n{lower}    ),
{implicit})
"""


def _diffrax_tableau(arrays: Mapping[str, Any]) -> Arrays:
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
    fits = method.is_explicit and bool(method.embedded)
    require(method, "SciPy", holds=fits, what="explicit, with embedded weights,")
    shown = rounded(method)
    digits, (order, embedded_order) = shown.digits, orders(method)
    A, b, c, E = shown.A, shown.b, shown.c, combined(shown.embedded[0], shown.b, -1)
    if A[-1] == b and E[-1] != 0:  # the last stage is the derivative at the end of the step
        A, b, c = [row[:-1] for row in A[:-1]], b[:-1], c[:-1]
    else:
        E = [*E, E[0] * 0]
    return f"""# {header(method, "SciPy, which computes in doubles", order=order)}
import numpy as np
from scipy.integrate import RK45


class {"".join(part.capitalize() for part in identifier(method.name).split("_"))}Solver(RK45):
    order = {order}
    error_estimator_order = {min(order, embedded_order)}
    n_stages = {len(b)}
    A = np.array({_rows(PYTHON_DOUBLES, A, digits, "    ")})
    B = np.array([{PYTHON_DOUBLES.row(b, digits)}])
    C = np.array([{PYTHON_DOUBLES.row(c, digits)}])
    E = np.array([{PYTHON_DOUBLES.row(E, digits)}])
    # Between steps: the cubic polynomial with the values and derivatives at both ends.
    P = np.outer(np.append(B, 0), [0, 3, -2])
    P[0] += [1, -2, 1]
    P[-1] += [0, -1, 1]
"""


def _scipy_tableau(arrays: Mapping[str, Any]) -> Arrays:
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


def _matrix(rows: Sequence[Sequence[object]], digits: int | None) -> str:
    """A matrix; of one entry, with the two semicolons that tell it from a vector."""
    if len(rows) == 1:
        return f"[{JULIA_NUMBERS.row(rows[0], digits)};;]"
    return "[\n" + "".join(f"    {JULIA_NUMBERS.row(row, digits, ' ')}\n" for row in rows) + "]"


def _write_rungekutta_jl(method: RungeKutta) -> str:
    shown, order = rounded(method), orders(method)[0]
    left_out = "Embedded weights have no place in it." if method.embedded else ""
    name = quoted(method.name).replace("$", "\\$")
    return f"""# {header(method, "RungeKutta.jl", left_out, order=order)}
using RungeKutta

a = {_matrix(shown.A, shown.digits)}
b = [{JULIA_NUMBERS.row(shown.b, shown.digits)}]
c = [{JULIA_NUMBERS.row(shown.c, shown.digits)}]
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


def _write_sciml(method: RungeKutta) -> str:
    shown = rounded(method)
    digits, (order, embedded_order) = shown.digits, orders(method)
    options = [f"adaptiveorder={embedded_order}", "αEEst=αEEst"] if shown.embedded else []
    if method.is_explicit and method.A[-1] == method.b:
        options.append("fsal=true")
    embedded = f"αEEst = Float64[{JULIA_NUMBERS.row(shown.embedded[0], digits)}]\n" if shown.embedded else ""
    kind = "ExplicitRKTableau" if method.is_explicit else "ImplicitRKTableau"
    return f"""# {header(method, "SciML", order=order)}
import DiffEqBase

A = Float64{_matrix(shown.A, digits)}
c = Float64[{JULIA_NUMBERS.row(shown.c, digits)}]
α = Float64[{JULIA_NUMBERS.row(shown.b, digits)}]
{embedded}{identifier(method.name)}_tableau = DiffEqBase.{kind}({", ".join(["A", "c", "α", str(order), *options])})
"""


def _braces(values: Iterable[object], digits: int | None) -> str:
    return f"{{{C_DOUBLES.row(values, digits)}}}"


def _write_sundials(method: RungeKutta) -> str:
    fits = method.is_explicit or method.is_diagonally_implicit
    require(method, "SUNDIALS", holds=fits, what="explicit or diagonally implicit")
    shown = rounded(method)
    order, embedded_order = orders(method)
    matrix = "".join(f"    {C_DOUBLES.row(row, shown.digits)},\n" for row in shown.A)
    embedded = f"  sunrealtype d[] = {_braces(shown.embedded[0], shown.digits)};\n" if shown.embedded else ""
    arguments = f"{method.stages}, {order}, {embedded_order}, c, A, b, {'d' if shown.embedded else 'NULL'}"
    return f"""// {header(method, "SUNDIALS", order=order)}
#include <arkode/arkode_butcher.h>

static ARKodeButcherTable {identifier(method.name)}_table(void)
{{
  sunrealtype A[] = {{\n{matrix}  }};
  sunrealtype c[] = {_braces(shown.c, shown.digits)};
  sunrealtype b[] = {_braces(shown.b, shown.digits)};
{embedded}  return ARKodeButcherTable_Create({arguments});
}}
"""


def _printed_table(text: str) -> str:
    """What ``ARKodeButcherTable_Write`` prints as assignments of lists; other text unchanged."""
    if "{" in text:
        return text
    return re.sub(PRINTED, lambda match: f"{match[1]} = {{{', '.join(match[2].split())}}};\n", text, flags=re.MULTILINE)


def _write_petsc(method: RungeKutta) -> str:
    fits = method.is_explicit or method.is_diagonally_implicit
    require(method, "PETSc", holds=fits, what="explicit or diagonally implicit")
    shown = rounded(method)
    order, stages = orders(method)[0], method.stages
    register = "TSRKRegister" if method.is_explicit else "TSDIRKRegister"
    matrix = "".join(f"  {_braces(row, shown.digits)},\n" for row in shown.A)
    embedded = ""
    if shown.embedded:
        embedded = f"const PetscReal bembed[{stages}] = {_braces(shown.embedded[0], shown.digits)};\n"
    arguments = f"{order}, {stages}, &A[0][0], b, c, {'bembed' if embedded else 'NULL'}, 1, b"
    return f"""// {header(method, "PETSc", order=order)}
#include <petscts.h>

const PetscReal A[{stages}][{stages}] = {{\n{matrix}}};
const PetscReal b[{stages}] = {_braces(shown.b, shown.digits)};
const PetscReal c[{stages}] = {_braces(shown.c, shown.digits)};
{embedded}PetscCall({register}({quoted(method.name)}, {arguments}));
"""


FORMATS: dict[str, Format] = {
    "nodepy": Format(
        "python", r"nodepy|RungeKutta(?:Method|Pair)\(", r'\bname\s*=\s*"([^"\\\n]{1,100})"', ("A", "b", "bhat"),
        _write_nodepy, partial(_by_name, A="A", b="b", c="c", embedded="bhat", is_c_needed=False)),
    "diffrax": Format(
        "python", r"\b(?:Multi)?ButcherTableau\b", r"\b(\w+?)(?:_tableau)?\s*=\s*ButcherTableau",
        ("a_lower", "b_sol", "b_error", "c", "a_diagonal", "c1"), _write_diffrax, _diffrax_tableau),
    "scipy": Format(
        "python", r"\(\s*(?:\w+\.)?(?:RungeKutta|RK\d+|OdeSolver)\s*\)\s*:", r"class\s+(\w+?)(?:Solver)?\s*\(",
        ("A", "B", "C", "E"), _write_scipy, _scipy_tableau),
    "sundials": Format(
        "c", r"ARKodeButcherTable|sunrealtype|SUN_RCONST|\A\s*A =\s*$",
        r"ARKodeButcherTable\s+(\w+?)(?:_table)?\s*\(void\)", ("A", "b", "c", "d"), _write_sundials,
        partial(_by_name, A="A", b="b", c="c", embedded="d"), _printed_table),
    "petsc": Format(
        "c", r"PetscReal|TS(?:RK|DIRK)Register", r'TS(?:RK|DIRK)Register\("([^"\\\n]{1,100})"',
        ("A", "b", "c", "bembed"), _write_petsc,
        partial(_by_name, A="A", b="b", c="c", embedded="bembed", is_c_needed=False)),
    "rungekutta.jl": Format(
        "julia", r"\bTableau(?:\{\w+\})?\(|\A\s*#\s*\d+\s+\d+\s+\w+\s*$",
        r'\bTableau(?:\{\w+\})?\((?::|Symbol\(")([\w-]{1,100})', ("a", "b", "c"), _write_rungekutta_jl,
        partial(_by_name, A="a", b="b", c="c"), _tabulated),
    "sciml": Format(
        "julia", "[Ee]xplicitRKTableau|ImplicitRKTableau",
        r"\b(\w+?)(?:_tableau)?\s*=\s*(?:\w+\.)?(?:Ex|Im)plicitRKTableau", ("A", "c", "α", "αEEst"), _write_sciml,
        partial(_by_name, A="A", b="α", c="c", embedded="αEEst")),
}  # fmt: skip


def plain_format(text: str) -> Format:
    """The format of plain assignments of A, b, c and bhat, in the language whose brackets the text has."""
    nested = re.search(r"[\[(]\s*[\[(]", text)
    language = "c" if "{" in text else "python" if nested else "julia"
    return FORMATS["nodepy"]._replace(language=language, names=("A", "b", "c", "bhat"))
