"""C: Butcher tables of SUNDIALS and tableaus of PETSc."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from integrators.core.text_files import LARGEST_NUMBER
from integrators.methods.exchange.array_text import C
from integrators.methods.exchange.tableau_parts import (
    Format,
    Numbers,
    at_least,
    header,
    identifier,
    one_row,
    orders,
    quoted,
    require,
    rounded,
    rounding,
    square,
    vector,
)
from integrators.methods.tableaux.runge_kutta import RungeKutta

DOUBLES = Numbers("{}.0", "{}.0 / {}.0", LARGEST_NUMBER)
PRINTED = r"^[ \t]*([Acbd])[ \t]*=([^=;{}]*?)(?=^[ \t]*[cbd][ \t]*=|\Z)"
"""A part of what ``ARKodeButcherTable_Write`` prints."""


def _require_stages_in_turn(method: RungeKutta, package: str) -> None:
    fits = method.is_explicit or method.is_diagonally_implicit
    require(method, package, holds=fits, what="explicit or diagonally implicit")


def _braces(values: Iterable[Any], digits: int | None) -> str:
    return f"{{{DOUBLES.row(values, digits)}}}"


def _write_sundials(method: RungeKutta) -> str:
    _require_stages_in_turn(method, "SUNDIALS")
    shown = rounded(method)
    order, embedded_order = orders(method)
    matrix = "".join(f"    {DOUBLES.row(row, shown.digits)},\n" for row in shown.A)
    lines = [
        f"// {header(method, 'SUNDIALS', one_row(method), rounding(method), at_least(order))}",
        "#include <arkode/arkode_butcher.h>",
        "",
        f"static ARKodeButcherTable {identifier(method.name)}_table(void)",
        "{",
        f"  sunrealtype A[] = {{\n{matrix}  }};",
        f"  sunrealtype c[] = {_braces(shown.c, shown.digits)};",
        f"  sunrealtype b[] = {_braces(shown.b, shown.digits)};",
    ]
    if shown.embedded:
        lines.append(f"  sunrealtype d[] = {_braces(shown.embedded[0], shown.digits)};")
    arguments = f"{method.stages}, {order}, {embedded_order}, c, A, b, {'d' if shown.embedded else 'NULL'}"
    return "\n".join([*lines, f"  return ARKodeButcherTable_Create({arguments});", "}", ""])


def _printed_table(text: str) -> str:
    """What ``ARKodeButcherTable_Write`` prints as assignments of lists; other text unchanged."""
    if "{" in text:
        return text
    return re.sub(PRINTED, lambda match: f"{match[1]} = {{{', '.join(match[2].split())}}};\n", text, flags=re.MULTILINE)


def _sundials_tableau(arrays: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    b = vector(arrays["b"])
    return square(arrays["A"], len(b)), b, arrays["c"], [arrays["d"]] if "d" in arrays else None


def _write_petsc(method: RungeKutta) -> str:
    _require_stages_in_turn(method, "PETSc")
    shown = rounded(method)
    order, stages, register = (
        orders(method)[0],
        method.stages,
        "TSRKRegister" if method.is_explicit else "TSDIRKRegister",
    )
    matrix = "".join(f"  {_braces(row, shown.digits)},\n" for row in shown.A)
    lines = [
        f"// {header(method, 'PETSc', one_row(method), rounding(method), at_least(order))}",
        "#include <petscts.h>",
        "",
        f"const PetscReal A[{stages}][{stages}] = {{\n{matrix}}};",
        f"const PetscReal b[{stages}] = {_braces(shown.b, shown.digits)};",
        f"const PetscReal c[{stages}] = {_braces(shown.c, shown.digits)};",
    ]
    if shown.embedded:
        lines.append(f"const PetscReal bembed[{stages}] = {_braces(shown.embedded[0], shown.digits)};")
    arguments = f"{order}, {stages}, &A[0][0], b, c, {'bembed' if shown.embedded else 'NULL'}, 1, b"
    return "\n".join([*lines, f"PetscCall({register}({quoted(method.name)}, {arguments}));", ""])


def _petsc_tableau(arrays: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    b = vector(arrays["b"])
    embedded = [arrays["bembed"]] if "bembed" in arrays else None
    return square(arrays["A"], len(b)), b, arrays.get("c"), embedded


SUNDIALS = Format(
    C, r"ARKodeButcherTable|sunrealtype|SUN_RCONST|\A\s*A =\s*$", r"ARKodeButcherTable\s+(\w+?)(?:_table)?\s*\(void\)",
    ("A", "b", "c", "d"), _write_sundials, _sundials_tableau, _printed_table,
)  # fmt: skip
PETSC = Format(
    C, r"PetscReal|TS(?:RK|DIRK)Register", r'TS(?:RK|DIRK)Register\("([^"\\\n]{1,100})"', ("A", "b", "c", "bembed"),
    _write_petsc, _petsc_tableau,
)  # fmt: skip
