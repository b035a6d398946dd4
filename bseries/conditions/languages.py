"""Order conditions as source code: straight-line assignments to scalars, printed by SymPy for each language.

NumPy and numba have vector code instead; see `numpy_code` and `numba_code`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import prod
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions.layout import known_stages, layout, named_blocks
from bseries.conditions.numba_code import numba_source
from bseries.conditions.numpy_code import numpy_source
from bseries.conditions.scalar_equations import ScalarInterpreter, gradient, left_side
from bseries.exceptions import SeriesError

if TYPE_CHECKING:
    from bseries.conditions.condition_program import EquationSystem

Shape = tuple[int, ...]


class Assignments(NamedTuple):
    """Temporaries (name, expression) in order, results (index, expression), and the columns of a Jacobian.

    `temporary_count` is the largest number in the name of a temporary.
    """

    temporaries: list[tuple[str, Any]]
    results: list[tuple[tuple[int, ...], Any]]
    columns: list[str]
    temporary_count: int


class FunctionSource(NamedTuple):
    """A function to write: its name, arguments and result with their shapes, and its assignments as text."""

    name: str
    arguments: dict[str, Shape]
    result: str
    shape: Shape
    temporaries: int
    body: list[str]


class Language(NamedTuple):
    """Syntax of a language: entries of arrays (indices from 0), temporaries, comments, functions."""

    entry: Callable[[str, Shape, Shape], str]
    temporary: str
    comment: str
    printer: Callable[[], Any]
    function: Callable[[FunctionSource], list[str]]
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


def _python(f: FunctionSource) -> list[str]:
    zeros = f"[0] * {f.shape[-1]}"
    start = f"{f.result} = {zeros if len(f.shape) == 1 else f'[{zeros} for _ in range({f.shape[0]})]'}"
    lines = [start, *f.body, f"return {f.result}"]
    return [f"def {f.name}({', '.join(f.arguments)}):", *_indented(lines)]


def _julia(f: FunctionSource) -> list[str]:
    element = f"promote_type({', '.join(f'eltype({name})' for name in f.arguments)})"
    lines = [f"{f.result} = zeros({element}, {', '.join(map(str, f.shape))})", *f.body, f"return {f.result}"]
    return [f"function {f.name}({', '.join(f.arguments)})", *_indented(lines), "end"]


def _octave(f: FunctionSource) -> list[str]:
    sizes = ", ".join(map(str, (*f.shape, 1)[:2]))
    lines = [f"{f.result} = zeros({sizes});", *f.body]
    return [f"function {f.result} = {f.name}({', '.join(f.arguments)})", *_indented(lines), "end"]


def _c(f: FunctionSource) -> list[str]:
    taken = [f"const double *{name}" for name in f.arguments]
    zero = f"for (int i = 0; i < {prod(f.shape)}; ++i) {f.result}[i] = 0.0;"
    return [f"void {f.name}({', '.join(taken)}, double *{f.result})", "{", *_indented([zero, *f.body]), "}"]


def _fortran(f: FunctionSource) -> list[str]:
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
    "fortran": Language(
        _from_one("()"),
        "t({})",
        "!",
        _fortran_printer,
        _fortran,
    ),
    "octave": Language(_from_one("()"), "t{}", "%", _octave_printer, _octave, preamble=("1;  % a script file",)),
}
ALL_LANGUAGES = ("python", "numpy", "numba", "julia", "c", "fortran", "octave")

MOST_ENTRIES = 200_000
"""Code for larger Jacobians would take minutes to write, and longer to compile."""


def source(
    system: EquationSystem, title: str, labels: Iterable[str], language: str, stages: int | None, jacobian: bool
) -> str:
    """Source code of residual and Jacobian in a language; see `OrderConditions.code`.

    The rows of r and J are the conditions, the columns of J the free coefficients, argument by argument, row by row.
    In C matrices are flat, row by row. The title and a label for each equation are written as comments.
    """
    name = language.lower() if isinstance(language, str) else language
    if name not in ALL_LANGUAGES:
        raise SeriesError(f"language must be one of {', '.join(ALL_LANGUAGES)}, but was {language!r:.60}")
    if not system.equations:
        raise SeriesError("there must be conditions to write code for, but the assumptions imply them all")
    if name not in LANGUAGES:
        vectors = numba_source(system, jacobian) if name == "numba" else numpy_source(system, labels, jacobian)
        return "\n".join([f"# {title}", *vectors]) + "\n"
    own = LANGUAGES[name]
    count = known_stages(stages)
    size = len(system.equations) * count * (count + 1)
    if size > MOST_ENTRIES:
        raise SeriesError(
            f"stages must be fewer, or language numpy or numba: the Jacobian has {size:,} entries to write"
        )
    lines = [f"{own.comment} {title}; {count} stages", *own.preamble, ""]
    lines += _function(system, own, "residual", "r", count, _residual_assignments(system, count, own))
    if jacobian:
        found = _jacobian_assignments(system, count, own)
        rows = [", ".join(found.columns[k : k + 12]) for k in range(0, len(found.columns), 12)]
        lines += ["", *([""] if own.comment == "#" else [])]
        lines += [f"{own.comment} {line}" for line in ("Columns of the Jacobian:", *rows)]
        lines += _function(system, own, "jacobian", "J", count, found)
    return "\n".join(lines) + "\n"


def _function(
    system: EquationSystem, language: Language, name: str, result: str, stages: int, found: Assignments
) -> list[str]:
    """The lines of one function."""
    from sympy import Symbol

    printer = language.printer()
    shape = (len(system.equations), len(found.columns)) if name == "jacobian" else (len(system.equations),)
    body = [
        language.declare + printer.doprint(value, assign_to=Symbol(temporary)) for temporary, value in found.temporaries
    ]
    body += [printer.doprint(value, assign_to=Symbol(language.entry(result, at, shape))) for at, value in found.results]
    arguments = {argument.name: argument.shape(stages) for argument in system.program.arguments}
    return language.function(FunctionSource(name, arguments, result, shape, found.temporary_count, body))


class _TemporaryNames:
    """Names of temporaries: one for each different expression that is not a number or symbol."""

    def __init__(self, pattern: str):
        self._pattern = pattern
        self._names: dict[Any, Any] = {}

    def __call__(self, value: Any) -> Any:
        if isinstance(value, int) or value.is_Symbol or value.is_Number:
            return value
        if value not in self._names:
            from sympy import Symbol

            self._names[value] = Symbol(self._pattern.format(len(self._names) + 1))
        return self._names[value]

    def __len__(self) -> int:
        return len(self._names)

    def needed(self, results: Sequence[Any]) -> list[tuple[str, Any]]:
        """The assignments on which the results depend."""
        used = {symbol for result in results for symbol in result.free_symbols}
        kept = []
        for value, name in reversed(self._names.items()):
            if name in used:
                used |= value.free_symbols
                kept.append((name.name, value))
        return kept[::-1]


def _interpreter(system: EquationSystem, stages: int, language: Language) -> tuple[ScalarInterpreter, _TemporaryNames]:
    from sympy import Symbol

    def symbol(argument: Any, at: tuple[int, ...]) -> Any:
        return Symbol(language.entry(argument.name, at, argument.shape(stages)))

    names = _TemporaryNames(language.temporary)
    program = system.program
    blocks = named_blocks(program, system.structures, stages, symbol)
    return ScalarInterpreter(program, stages, blocks, names), names


def _residual_assignments(system: EquationSystem, stages: int, language: Language) -> Assignments:
    from sympy import sympify

    interpreter, names = _interpreter(system, stages, language)
    values = system.program.run(interpreter, system.size)
    results = [
        ((k,), sympify(left_side(equation, interpreter, values) - equation.right, strict=True))
        for k, equation in enumerate(system.equations)
    ]
    return _assignments(names, results, [])


def _jacobian_assignments(system: EquationSystem, stages: int, language: Language) -> Assignments:
    """The assignments of the nonzero entries of the Jacobian."""
    from sympy import sympify

    interpreter, names = _interpreter(system, stages, language)
    gradients = system.gradients  # appends operations to the program
    values = system.program.run(interpreter)
    free = [entry for entry in layout(system.program, system.structures, stages) if entry.is_free]
    results = []
    for k, terms in enumerate(gradients):
        derivatives = gradient(system.program, terms, stages, values)
        for column, entry in enumerate(free):
            value = sympify(derivatives[entry.block][entry.place], strict=True)
            if value != 0:
                results.append(((k, column), value))
    columns = [language.entry(entry.argument.name, entry.at, entry.argument.shape(stages)) for entry in free]
    return _assignments(names, results, columns)


def _assignments(names: _TemporaryNames, results: list[tuple[tuple[int, ...], Any]], columns: list[str]) -> Assignments:
    temporaries = names.needed([value for _, value in results])
    return Assignments(temporaries, results, columns, len(names))
