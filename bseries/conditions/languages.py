"""Order conditions as source code: a straight line of assignments to scalars, printed by SymPy for each language.

NumPy and numba get vectors instead; see `numpy_code` and `numba_code`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions.numba_code import numba_source
from bseries.conditions.numpy_code import numpy_source
from bseries.conditions.scalars import jacobian_assignments, residual_assignments
from bseries.exceptions import SeriesError

if TYPE_CHECKING:
    from bseries.conditions.listing import OrderConditions
    from bseries.conditions.scalars import Assignments

Shape = tuple[int, ...]


class Function(NamedTuple):
    """A function to be written: its name, its arguments and result with their shapes, its assignments as text."""

    name: str
    arguments: dict[str, Shape]
    result: str
    shape: Shape
    temporaries: int
    body: list[str]


class Language(NamedTuple):
    """How a language writes an entry of an array (counted from 0), a temporary, a comment, and a function."""

    entry: Callable[[str, Shape, Shape], str]
    temporary: str
    comment: str
    printer: Callable[[], Any]
    function: Callable[[Function], list[str]]
    declare: str = ""
    preamble: tuple[str, ...] = ()


def _from_one(brackets: str) -> Callable[[str, Shape, Shape], str]:
    def entry(name: str, at: Shape, shape: Shape) -> str:
        return f"{name}{brackets[0]}{','.join(str(k + 1) for k in at)}{brackets[1]}"

    return entry


def _chained(name: str, at: Shape, shape: Shape) -> str:
    return name + "".join(f"[{k}]" for k in at)


def _flat(name: str, at: Shape, shape: Shape) -> str:
    return f"{name}[{sum(k * prod(shape[d + 1 :]) for d, k in enumerate(at))}]"


def _python_printer() -> Any:
    from sympy.printing.pycode import PythonCodePrinter

    class Printer(PythonCodePrinter):
        def _print_Rational(self, expr: Any) -> str:
            return f"Fraction({expr.p}, {expr.q})"

    return Printer({"fully_qualified_modules": False})


def _c_printer() -> Any:
    from sympy.printing.c import C99CodePrinter

    class Printer(C99CodePrinter):
        def _print_Pow(self, expr: Any) -> str:
            return "*".join([self.parenthesize(expr.base, 50)] * int(expr.exp))

    return Printer()


def _fortran_printer() -> Any:
    from sympy.printing.fortran import FCodePrinter

    return FCodePrinter({"source_format": "free", "standard": 2008, "name_mangling": False})


def _julia_printer() -> Any:
    from sympy.printing.julia import JuliaCodePrinter

    return JuliaCodePrinter()


def _octave_printer() -> Any:
    from sympy.printing.octave import OctaveCodePrinter

    return OctaveCodePrinter()


def _python(f: Function) -> list[str]:
    zeros = f"[0] * {f.shape[-1]}"
    start = f"{f.result} = {zeros if len(f.shape) == 1 else f'[{zeros} for _ in range({f.shape[0]})]'}"
    lines = [start, *f.body, f"return {f.result}"]
    return [f"def {f.name}({', '.join(f.arguments)}):", *_indented(lines)]


def _julia(f: Function) -> list[str]:
    element = f"promote_type({', '.join(f'eltype({name})' for name in f.arguments)})"
    lines = [f"{f.result} = zeros({element}, {', '.join(map(str, f.shape))})", *f.body, f"return {f.result}"]
    return [f"function {f.name}({', '.join(f.arguments)})", *_indented(lines), "end"]


def _octave(f: Function) -> list[str]:
    sizes = ", ".join(map(str, (*f.shape, 1)[:2]))
    lines = [f"{f.result} = zeros({sizes});", *f.body]
    return [f"function {f.result} = {f.name}({', '.join(f.arguments)})", *_indented(lines), "end"]


def _c(f: Function) -> list[str]:
    taken = [f"const double *{name}" for name in f.arguments]
    zero = f"for (int i = 0; i < {prod(f.shape)}; ++i) {f.result}[i] = 0.0;"
    return [f"void {f.name}({', '.join(taken)}, double *{f.result})", "{", *_indented([zero, *f.body]), "}"]


def _fortran(f: Function) -> list[str]:
    shapes = {**f.arguments, f.result: f.shape}
    lines = ["implicit none"]
    for name, shape in shapes.items():
        intent = "out" if name == f.result else "in"
        lines.append(f"double precision, intent({intent}) :: {name}({', '.join(map(str, shape))})")
    if f.temporaries:
        lines.append(f"double precision :: t({f.temporaries})")
    lines += [f"{f.result} = 0", *f.body]
    return [f"subroutine {f.name}({', '.join(shapes)})", *_indented(lines), f"end subroutine {f.name}"]


def _indented(lines: Sequence[str]) -> list[str]:
    return ["    " + part for line in lines for part in line.split("\n")]


LANGUAGES = {
    "python": Language(_chained, "t{}", "#", _python_printer, _python, preamble=("from fractions import Fraction", "")),
    "julia": Language(_from_one("[]"), "t{}", "#", _julia_printer, _julia),
    "c": Language(_flat, "t{}", "//", _c_printer, _c, declare="const double "),
    "fortran": Language(_from_one("()"), "t({})", "!", _fortran_printer, _fortran),
    "octave": Language(_from_one("()"), "t{}", "%", _octave_printer, _octave, preamble=("1;  % a script file",)),
}
VECTOR_LANGUAGES = {"numpy": numpy_source, "numba": numba_source}
ALL_LANGUAGES = ("python", "numpy", "numba", "julia", "c", "fortran", "octave")


MOST_ENTRIES = 200_000
"""Code for larger Jacobians would take minutes to write, and longer to compile."""


def source(conditions: OrderConditions, language: str, stages: int | None, jacobian: bool) -> str:
    """The source code of residual and Jacobian in a language; see `OrderConditions.code`.

    The rows of r and J are the conditions, the columns of J the free coefficients, argument by argument, row by row.
    In C matrices are flat, row by row.
    """
    name = language.lower() if isinstance(language, str) else language
    if name not in ALL_LANGUAGES:
        raise SeriesError(f"language must be one of {', '.join(ALL_LANGUAGES)}, but was {language!r:.60}")
    if not len(conditions):
        raise SeriesError("there must be conditions to write code for, but the assumptions imply them all")
    if name in VECTOR_LANGUAGES:
        return "\n".join([f"# {_title(conditions)}", *VECTOR_LANGUAGES[name](conditions, jacobian)]) + "\n"
    own = LANGUAGES[name]
    count = conditions.known_stages(stages)
    size = len(conditions) * count * (count + 1)
    if size > MOST_ENTRIES:
        raise SeriesError(
            f"stages must be fewer, or language numpy or numba: the Jacobian has {size:,} entries to write"
        )
    lines = [f"{own.comment} {_title(conditions)}; {count} stages", *own.preamble, ""]
    lines += _written(conditions, own, "residual", "r", count, residual_assignments(conditions, count, own))
    if jacobian:
        found = jacobian_assignments(conditions, count, own)
        lines += [
            "",
            *([""] if own.comment == "#" else []),
            *(f"{own.comment} {line}" for line in _column_lines(found.columns)),
        ]
        lines += _written(conditions, own, "jacobian", "J", count, found)
    return "\n".join(lines) + "\n"


def _title(conditions: OrderConditions) -> str:
    return f"{len(conditions)} order conditions of {conditions.kind} methods: order {conditions.order}"


def _column_lines(columns: Sequence[str]) -> list[str]:
    """What the columns are, a few to a line."""
    rows = [", ".join(columns[k : k + 12]) for k in range(0, len(columns), 12)]
    return ["Columns of the Jacobian:", *rows]


def _written(
    conditions: OrderConditions, language: Language, name: str, result: str, stages: int, found: Assignments
) -> list[str]:
    """One function."""
    from sympy import Symbol

    printer = language.printer()
    shape = (len(conditions), len(found.columns)) if name == "jacobian" else (len(conditions),)
    body = [
        language.declare + printer.doprint(value, assign_to=Symbol(temporary)) for temporary, value in found.temporaries
    ]
    body += [printer.doprint(value, assign_to=Symbol(language.entry(result, at, shape))) for at, value in found.results]
    arguments = {argument.name: argument.shape(stages) for argument in conditions.system.program.arguments}
    return language.function(Function(name, arguments, result, shape, found.temporary_count, body))
