"""Order conditions as source code: NumPy in vectors, C and Julia in scalars."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from math import prod
from typing import Any, NamedTuple

from bseries.conditions.condition_program import BANDS, IMAGE, ONE, PRODUCT, VECTOR, CoefficientBlock, ConditionProgram
from bseries.conditions.exact_values import check_stages, equations, named_blocks
from bseries.exceptions import SeriesError

Shape = tuple[int, ...]

LANGUAGES = ("numpy", "c", "julia")

MOST_ENTRIES = 10_000
"""Scalar code for larger Jacobians would take minutes to write, and longer to compile."""


def source(
    program: ConditionProgram, title: str, labels: Iterable[str], language: str, stages: int | None, jacobian: bool
) -> str:
    """Source code of residual and Jacobian in a language; see `OrderConditions.code`."""
    name = language.lower() if isinstance(language, str) else language
    if name not in LANGUAGES:
        raise SeriesError(f"language must be one of {', '.join(LANGUAGES)}, but was {language!r:.60}")
    if not program.equations:
        raise SeriesError("there must be conditions to write code for, but the assumptions imply them all")
    if name == "numpy":
        lines = [f"# {title}", *numpy_source(program, labels, jacobian)]
    else:
        lines = scalar_source(program, f"{title}; {check_stages(stages)} stages", name, check_stages(stages), jacobian)
    return "\n".join(lines) + "\n"


# NumPy: one line for each operation, for any number of stages.


def numpy_source(program: ConditionProgram, labels: Iterable[str], jacobian: bool) -> list[str]:
    """The lines of residual and Jacobian; a label for each equation goes into a comment."""
    lines = ["import numpy as np", "", "", *_numpy_header(program, "residual", program.size)]
    lines += ["    return np.array([", *_numpy_sums(program, labels), "    ])"]
    return [*lines, "", "", *_numpy_jacobian(program)] if jacobian else lines


ABOUT = {
    "residual": "Left-hand sides minus right-hand sides.",
    "jacobian": "Derivatives of the residual by the free coefficients, argument by argument, row by row.",
}


def _numpy_header(program: ConditionProgram, name: str, count: int) -> list[str]:
    """First lines of a function: constant matrices, sums of matrices, and the values of the operations."""
    matrices = []
    lines = [f"def {name}({', '.join(a.name for a in program.arguments)}):", f'    """{ABOUT[name]}"""']
    lines.append(f"    s = {program.arguments[0].name}.shape[-1]")
    for k, operator in enumerate(program.operators):
        blocks = [program.blocks[block].code for block in operator.blocks]
        matrices.append(blocks[0] if len(blocks) == 1 else f"m{k}")
        if operator.relation:
            lines.append(f"    m{k} = np.tri(s, s, {BANDS[operator.relation] - 1})")
        elif len(blocks) > 1:
            lines.append(f"    m{k} = {' + '.join(blocks)}")
    for k, (kind, x, y) in enumerate(program.operations[:count]):
        if kind == ONE:
            value = "np.ones(s)"
        elif kind == VECTOR:
            value = program.blocks[x].code
        elif kind == PRODUCT:
            value = f"v{x} * v{y}"
        else:
            value = f"{matrices[x]} @ v{y}" if kind == IMAGE else f"v{y} @ {matrices[x]}"
        lines.append(f"    v{k} = {value}")
    return lines


def _numpy_sums(program: ConditionProgram, labels: Iterable[str]) -> list[str]:
    blocks = program.blocks
    lines = []
    for label, (summands, right) in zip(labels, program.equations, strict=True):
        total = " + ".join(_times(term.factor, f"{blocks[term.block].code} @ v{term.value}") for term in summands)
        lines.append(f"        {total} - {right},  # {label}")
    return lines


def _times(factor: Fraction, value: str) -> str:
    if factor == 1:
        return value
    return f"{factor} * {f'({value})' if ' @ ' in value else value}"


def _numpy_jacobian(program: ConditionProgram) -> list[str]:
    gradients, count = program.gradients, len(program.equations)
    lines, columns = _numpy_header(program, "jacobian", len(program.operations)), []
    structures = iter(program.structures)
    for k, (argument, part) in enumerate(program.blocks):
        shape = ", ".join("s" * (1 + argument.is_matrix))
        lines.append(f"    d{k} = np.zeros(({count}, {shape}))  # by {argument.name} {part}".rstrip())
        band = BANDS.get(next(structures)) if argument.is_matrix else None
        free = f"[:, np.tri(s, s, {band - 1}, bool)]" if band is not None else f".reshape({count}, -1)"
        columns.append(f"d{k}{free}")
    for k, terms in enumerate(gradients):
        for factor, block, x, y in sorted(terms, key=lambda term: term[1:]):
            value = f"v{x}" if y < 0 else f"np.outer(v{x}, v{y})"
            lines.append(f"    d{block}[{k}] += {_times(factor, value)}")
    return [*lines, f"    return np.concatenate([{', '.join(columns)}], axis=1)"]


# C and Julia: assignments to scalars, printed by SymPy.


class ScalarLanguage(NamedTuple):
    """Syntax of a language: comments, declarations of temporaries, entries of arrays, the lines of a function."""

    comment: str
    declaration: str
    entry: Callable[[str, Shape, Shape], str]
    function: Callable[[str, list[str], str, Shape, list[str]], list[str]]


def _c_entry(name: str, at: Shape, shape: Shape) -> str:
    return f"{name}[{sum(k * prod(shape[d + 1 :]) for d, k in enumerate(at))}]"


def _julia_entry(name: str, at: Shape, shape: Shape) -> str:
    return f"{name}[{','.join(str(k + 1) for k in at)}]"


def _c_function(name: str, arguments: list[str], result: str, shape: Shape, body: list[str]) -> list[str]:
    given = ", ".join(f"const double *{argument}" for argument in arguments)
    zeros = f"    for (int i = 0; i < {prod(shape)}; ++i) {result}[i] = 0.0;"
    return [f"void {name}({given}, double *{result})", "{", zeros, *body, "}"]


def _julia_function(name: str, arguments: list[str], result: str, shape: Shape, body: list[str]) -> list[str]:
    element = f"promote_type({', '.join(f'eltype({argument})' for argument in arguments)})"
    zeros = f"    {result} = zeros({element}, {', '.join(map(str, shape))})"
    return [f"function {name}({', '.join(arguments)})", zeros, *body, f"    return {result}", "end"]


SCALAR_LANGUAGES = {
    "c": ScalarLanguage("//", "const double ", _c_entry, _c_function),
    "julia": ScalarLanguage("#", "", _julia_entry, _julia_function),
}


def scalar_source(program: ConditionProgram, title: str, language: str, stages: int, jacobian: bool) -> list[str]:
    """The lines of residual and Jacobian; in C, arrays are flat, row by row."""
    from sympy import Symbol

    size = len(program.equations) * stages * (stages + 1)
    if size > MOST_ENTRIES:
        raise SeriesError(f"stages must be fewer, or language numpy: the Jacobian has {size:,} entries to write")
    own = SCALAR_LANGUAGES[language]

    def symbol(block: CoefficientBlock, at: Shape) -> Any:
        return Symbol(own.entry(block.argument.name, (*block.stack, *at), block.argument.shape(stages)))

    blocks = named_blocks(program, stages, symbol)
    left = [equation.lhs - equation.rhs for equation in equations(program, blocks, nodes=False)]
    arguments = [argument.name for argument in program.arguments]
    entries: dict[Shape, Any] = {(k,): value for k, value in enumerate(left)}
    lines = [f"{own.comment} {title}", ""]
    lines += own.function("residual", arguments, "r", (len(left),), _assignments(language, "r", (len(left),), entries))
    if jacobian:
        unknowns = [blocks[k][at] for k, at in program.free_entries(stages)]
        shape = len(left), len(unknowns)
        slopes = {(k, j): value.diff(x) for k, value in enumerate(left) for j, x in enumerate(unknowns)}
        slopes = {at: value for at, value in slopes.items() if value != 0}
        rows = [", ".join(map(str, unknowns[k : k + 12])) for k in range(0, len(unknowns), 12)]
        lines += ["", *(f"{own.comment} {line}" for line in ("Columns of the Jacobian:", *rows))]
        lines += own.function("jacobian", arguments, "J", shape, _assignments(language, "J", shape, slopes))
    return lines


def _assignments(language: str, result: str, shape: Shape, entries: dict[Shape, Any]) -> list[str]:
    """Assignments to entries of the result, and to what they share."""
    from sympy import Symbol, cse, numbered_symbols
    from sympy.codegen.rewriting import create_expand_pow_optimization, optimize
    from sympy.printing.c import C99CodePrinter
    from sympy.printing.julia import JuliaCodePrinter

    own, printer = SCALAR_LANGUAGES[language], C99CodePrinter() if language == "c" else JuliaCodePrinter()
    products = [create_expand_pow_optimization(20)] if language == "c" else []  # C's pow is slow
    shared, values = cse(list(entries.values()), symbols=numbered_symbols("t", start=1))
    found = [(own.declaration, name, value) for name, value in shared]
    found += [("", Symbol(own.entry(result, at, shape)), value) for at, value in zip(entries, values, strict=True)]
    statements = [f"{start}{printer.doprint(optimize(value, products), name)}" for start, name, value in found]
    return [f"    {line}" for statement in statements for line in statement.split("\n")]
