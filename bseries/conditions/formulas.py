"""Order conditions written out: text and LaTeX, exact numbers and SymPy equations, source code.

Numbers and expressions are entries of NumPy arrays of objects, so that products of matrices and vectors are NumPy's and
every sum and product is one of the entries'.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import reduce
from itertools import groupby
from math import prod
from operator import add
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.conditions.condition_program import (
    BANDS,
    IMAGE,
    ONE,
    PRODUCT,
    VECTOR,
    CoefficientBlock,
    ConditionProgram,
    Equation,
    EquationTerm,
)
from bseries.exceptions import SeriesError
from bseries_base.numbers import latex_number
from trees.counting import check_order
from trees.formulas import factor_text, index_letters

if TYPE_CHECKING:
    import numpy as np
    import sympy
    from numpy.typing import ArrayLike

Blocks = Sequence["np.ndarray"]
Shape = tuple[int, ...]

MOST_STAGES = 1000
LATEX = {"ā": r"\bar{a}", "b̄": r"\bar{b}", "α": r"\alpha", "β": r"\beta", "γ": r"\gamma", "≤": r"\le"}


# Text and LaTeX.


class Factor(NamedTuple):
    """A factor of a product: a symbol with the numbers of its indices, to a power."""

    symbol: str
    part: str
    indices: tuple[int, ...]
    exponent: int


def left_text(program: ConditionProgram, equation: Equation, *, latex: bool = False) -> str:
    """The left-hand side of an equation."""
    return " + ".join(_summand_text(program, summand, latex) for summand in equation.summands)


def _summand_text(program: ConditionProgram, summand: EquationTerm, latex: bool) -> str:
    """A sum of products over indices: one for the root, and one for each edge that is not a single factor."""
    block = program.blocks[summand.block]
    factors = [Factor(block.argument.symbol, block.part, (0,), 1)]
    relations = [""]  # of each index to the previous one
    _visit(program, summand.value, 0, factors, relations)
    indices = index_letters(len(relations), latex)
    parts = [_sign(relations, indices, latex)]
    for symbol, part, at, exponent in factors:
        own = [indices[k] for k in at]
        subscript = ("," if len(own[-1]) > 1 and not latex else "").join(own)
        parts.append(factor_text(LATEX.get(symbol, symbol) if latex else symbol, part, subscript, exponent, latex))
    if summand.factor != 1:
        parts.insert(0, latex_number(summand.factor, None) if latex else str(summand.factor))
    return " ".join(parts)


def _sign(relations: Sequence[str], indices: Sequence[str], latex: bool) -> str:
    """Σ with the relations of its indices."""
    chain = indices[-1]
    for relation, index in zip(reversed(relations[1:]), reversed(indices[:-1]), strict=True):
        chain += (f" {LATEX.get(relation, relation)} " if latex else relation) + index
    if latex:
        return f"\\sum_{{{chain if any(relations) else ','.join(indices)}}}"
    return f"Σ_{{{chain}}}" if any(relations) else "Σ"


def _visit(program: ConditionProgram, stage: int, at: int, factors: list[Factor], relations: list[str]) -> None:
    """Append the factors of a stage vector: first those with the index `at` only, then branch by branch."""
    branches = []
    for factor, equal in groupby(program.factors[stage]):
        exponent = len(list(equal))
        kind, which, branch = program.operations[factor]
        if kind != IMAGE:
            leaf = program.blocks[which].argument.symbol, program.blocks[which].part
        else:
            leaf = program.operators[which].row_sum if branch == ONE else "", program.operators[which].part
        if not leaf[0]:
            branches += [factor] * exponent
        elif leaf == factors[0][:2] and at == 0:  # x · x^(r−1) at the root is x^r
            factors[0] = factors[0]._replace(exponent=exponent + 1)
        else:
            factors.append(Factor(*leaf, (at,), exponent))
    for factor in branches:
        _, which, branch = program.operations[factor]
        operator, own = program.operators[which], len(relations)
        relations.append(operator.relation)
        if not operator.relation:
            factors.append(Factor(operator.symbol, operator.part, (at, own), 1))
        _visit(program, branch, own, factors, relations)


# Exact numbers and SymPy equations.


def check_stages(stages: object) -> int:
    """Check a number of stages."""
    if stages is None:
        raise SeriesError("stages must be given to write the equations out, but was not")
    count = check_order(stages, "stages")
    if count > MOST_STAGES:
        raise SeriesError(f"stages must be {MOST_STAGES} or less, but was {count}")
    return count


def read_arrays(
    program: ConditionProgram,
    arrays: Sequence[ArrayLike],
    stages: int | None,
    read: Callable[[ArrayLike, str], np.ndarray] | None = None,
) -> list[np.ndarray]:
    """Read arrays of coefficients, by default of exact numbers, for a number of stages or that of the first array."""
    if len(arrays) != len(program.arguments):
        names = ", ".join(argument.name for argument in program.arguments)
        raise SeriesError(f"arguments must be {names}, but were {len(arrays)}")
    found: list[np.ndarray] = []
    for argument, given in zip(program.arguments, arrays, strict=True):
        found.append((read or _read_exact)(given, argument.name))
        shape = argument.shape(found[0].shape[-1] if stages is None else stages)
        if found[-1].shape != shape:
            raise SeriesError(f"{argument.name} must have the shape {shape}, but had {found[-1].shape}")
    return found


def read_blocks(program: ConditionProgram, arrays: Sequence[ArrayLike], stages: int | None) -> Blocks:
    """Read arrays of exact coefficients, as an array for each block."""
    read = zip(program.arguments, read_arrays(program, arrays, stages), strict=True)
    return [block for argument, array in read for block in (array if argument.is_stack else [array])]


def _read_exact(values: ArrayLike, name: str) -> Any:
    """An array of numbers or expressions; decimals become fractions, which mix with other numbers."""
    import numpy as np

    try:
        array = np.array(values, object)
    except ValueError:  # arrays of different shapes
        array = np.array([])
    if array.ndim == 0 and not isinstance(values, str | bytes | dict | set):
        raise SeriesError(f"{name} must be an array, but was {values!r:.60}")
    if not array.size or any(isinstance(entry, list | tuple) for entry in array.flat):
        raise SeriesError(f"{name} must have rows of one length, one at least, but was {values!r:.60}")
    for entry in array.flat:
        if isinstance(entry, str | bytes | dict | set):
            raise SeriesError(f"{name} must hold numbers in lists, tuples or arrays, but had {entry!r:.60}")
        if not hasattr(entry, "__mul__"):
            raise SeriesError(f"{name} must hold numbers or expressions, but had {entry!r:.60}")
    fractions = np.frompyfunc(lambda x: Fraction(x) if isinstance(x, Decimal) and x.is_finite() else x, 1, 1)
    return fractions(array)


def named_blocks(program: ConditionProgram, stages: int, name: Callable[[CoefficientBlock, Shape], object]) -> Blocks:
    """The entries of every block by their names; 0 where the structure excludes them."""
    import numpy as np

    blocks = [np.zeros(block.argument.part_shape(stages), object) for block in program.blocks]
    for k, at in program.free_entries(stages):
        blocks[k][at] = name(program.blocks[k], at)
    return blocks


def symbols(program: ConditionProgram, stages: int) -> Blocks:
    """The coefficients as symbols: a_21, a__p_21 for part p, a_10_1 for ten or more stages."""
    import sympy

    def symbol(block: CoefficientBlock, at: Sequence[int]) -> sympy.Symbol:
        name = block.argument.name.lower() + (f"__{block.part}" if block.part else "")
        return sympy.Symbol(f"{name}_{('_' if stages > 9 else '').join(str(k + 1) for k in at)}")

    return named_blocks(program, stages, symbol)


def stage_matrices(program: ConditionProgram, blocks: Blocks) -> list[np.ndarray]:
    """The stage matrices: sums of blocks, or triangular matrices of ones."""
    import numpy as np

    stages = blocks[0].shape[-1]
    return [
        np.tri(stages, k=BANDS[op.relation] - 1, dtype=int).astype(blocks[0].dtype)
        if op.relation
        else reduce(add, [blocks[k] for k in op.blocks])
        for op in program.operators
    ]


def left_sides(
    program: ConditionProgram, blocks: Blocks, row_sums: Mapping[int, np.ndarray] | None = None
) -> list[Any]:
    """The left-hand sides of all equations; row sums of stage matrices may be given as symbols."""
    import numpy as np

    matrices, values = stage_matrices(program, blocks), []
    for kind, x, y in program.operations[: program.size]:
        if kind == ONE:
            values.append(np.ones(blocks[0].shape[-1], int).astype(object))
        elif kind == VECTOR:
            values.append(blocks[x])
        elif kind == PRODUCT:
            values.append(values[x] * values[y])
        else:
            values.append(row_sums[x] if y == ONE and row_sums else matrices[x] @ values[y])

    left = []
    for equation in program.equations:
        products = [(factor, blocks[block] @ values[value]) for factor, block, value in equation.summands]
        left.append(sum(product if factor == 1 else factor * product for factor, product in products))
    return left


def equations(program: ConditionProgram, blocks: Blocks, *, nodes: bool) -> list[Any]:
    """The equations in given coefficients; with `nodes`, row sums are symbols, which more equations define."""
    import numpy as np
    import sympy

    exact = np.frompyfunc(lambda entry: sympy.sympify(entry, strict=True), 1, 1)
    blocks = [exact(block) for block in blocks]
    known, definitions = _nodes(program, blocks) if nodes else ({}, [])
    found = [
        sympy.Eq(sympy.sympify(left, strict=True), sympy.sympify(equation.right, strict=True), evaluate=False)
        for left, equation in zip(left_sides(program, blocks, known), program.equations, strict=True)
    ]
    return found + definitions


def _nodes(program: ConditionProgram, blocks: Blocks) -> tuple[dict[int, np.ndarray], list[Any]]:
    """Symbols for the row sums of each stage matrix, and their definitions."""
    import sympy

    known, definitions = {}, []
    for k, (operator, matrix) in enumerate(zip(program.operators, stage_matrices(program, blocks), strict=True)):
        name = f"c__{operator.part}" if operator.part else "c"
        known[k] = totals = matrix.sum(axis=1)
        for i, total in enumerate(totals):
            if total != 0:  # zero for a row without free entries, such as the first of an explicit method
                totals[i] = sympy.Symbol(f"{name}_{i + 1}")
                definitions.append(sympy.Eq(totals[i], total, evaluate=False))
    return known, definitions


# Source code: NumPy in vectors, C and Julia in scalars.

LANGUAGES = ("numpy", "c", "julia")

MOST_ENTRIES = 10_000
"""Scalar code for larger Jacobians would take minutes to write, and longer to compile."""

ABOUT = {
    "residual": "Left-hand sides minus right-hand sides.",
    "jacobian": "Derivatives of the residual by the free coefficients, argument by argument, row by row.",
}


def source(
    program: ConditionProgram, title: str, labels: Iterable[str], language: str, stages: int | None, jacobian: bool
) -> str:
    """Source code of residual and Jacobian in a language; see `OrderConditions.code`."""
    name = language.lower() if isinstance(language, str) else language
    if name not in LANGUAGES:
        raise SeriesError(f"language must be one of {', '.join(LANGUAGES)}, but was {language!r:.60}")
    if not program.equations:
        raise SeriesError("there must be conditions to write code for, but the assumptions imply them all")
    if name != "numpy":
        count = check_stages(stages)
        return "\n".join(_scalar_source(program, f"{title}; {count} stages", name == "c", count, jacobian)) + "\n"
    lines = [f"# {title}", "import numpy as np", "", "", *_numpy_header(program, "residual", program.size)]
    lines.append("    return np.array([")
    for label, (summands, right) in zip(labels, program.equations, strict=True):
        terms = (_times(x.factor, f"{program.blocks[x.block].code} @ v{x.value}") for x in summands)
        lines.append(f"        {' + '.join(terms)} - {right},  # {label}")
    lines.append("    ])")
    return "\n".join(lines + ["", "", *_numpy_jacobian(program)] * jacobian) + "\n"


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


def _times(factor: Fraction, value: str) -> str:
    if factor == 1:
        return value
    return f"{factor} * {f'({value})' if ' @ ' in value else value}"


def _numpy_jacobian(program: ConditionProgram) -> list[str]:
    gradients, count = program.gradients, len(program.equations)
    lines, columns = _numpy_header(program, "jacobian", len(program.operations)), []
    for k, ((argument, part), band) in enumerate(zip(program.blocks, program.bands, strict=True)):
        shape = ", ".join("s" * (1 + argument.is_matrix))
        lines.append(f"    d{k} = np.zeros(({count}, {shape}))  # by {argument.name} {part}".rstrip())
        free = f"[:, np.tri(s, s, {band - 1}, bool)]" if band is not None else f".reshape({count}, -1)"
        columns.append(f"d{k}{free}")
    for k, terms in enumerate(gradients):
        for factor, block, x, y in sorted(terms, key=lambda term: term[1:]):
            value = f"v{x}" if y < 0 else f"np.outer(v{x}, v{y})"
            lines.append(f"    d{block}[{k}] += {_times(factor, value)}")
    return [*lines, f"    return np.concatenate([{', '.join(columns)}], axis=1)"]


def _scalar_source(program: ConditionProgram, title: str, in_c: bool, stages: int, jacobian: bool) -> list[str]:
    """The lines of residual and Jacobian: assignments to scalars; in C, arrays are flat, row by row."""
    size = len(program.equations) * stages * (stages + 1)
    if size > MOST_ENTRIES:
        raise SeriesError(f"stages must be fewer, or language numpy: the Jacobian has {size:,} entries to write")
    comment = "//" if in_c else "#"

    def symbol(block: CoefficientBlock, at: Shape) -> sympy.Symbol:
        return _entry(block.argument.name, (*block.stack, *at), block.argument.shape(stages), in_c)

    blocks = named_blocks(program, stages, symbol)
    left = [equation.lhs - equation.rhs for equation in equations(program, blocks, nodes=False)]
    arguments = [argument.name for argument in program.arguments]
    entries: dict[Shape, sympy.Expr] = {(k,): value for k, value in enumerate(left)}
    lines = [f"{comment} {title}", "", *_function("residual", arguments, "r", (len(left),), entries, in_c)]
    if jacobian:
        unknowns = [blocks[k][at] for k, at in program.free_entries(stages)]
        slopes = {(k, j): value.diff(x) for k, value in enumerate(left) for j, x in enumerate(unknowns)}
        slopes = {at: value for at, value in slopes.items() if value != 0}
        rows = [", ".join(map(str, unknowns[k : k + 12])) for k in range(0, len(unknowns), 12)]
        lines += ["", *(f"{comment} {line}" for line in ("Columns of the Jacobian:", *rows))]
        lines += _function("jacobian", arguments, "J", (len(left), len(unknowns)), slopes, in_c)
    return lines


def _entry(name: str, at: Shape, shape: Shape, in_c: bool) -> sympy.Symbol:
    """An entry of an array as a symbol."""
    from sympy import Symbol

    if in_c:
        return Symbol(f"{name}[{sum(k * prod(shape[d + 1 :]) for d, k in enumerate(at))}]")
    return Symbol(f"{name}[{','.join(str(k + 1) for k in at)}]")


def _function(
    name: str, arguments: list[str], result: str, shape: Shape, entries: dict[Shape, sympy.Expr], in_c: bool
) -> list[str]:
    """A function that assigns entries of its result, after what they share."""
    from sympy import cse, numbered_symbols
    from sympy.codegen.rewriting import create_expand_pow_optimization, optimize
    from sympy.printing.c import C99CodePrinter
    from sympy.printing.julia import JuliaCodePrinter

    shared, values = cse(list(entries.values()), symbols=numbered_symbols("t", start=1))
    found = [("const double " * in_c, name, value) for name, value in shared]
    found += [("", _entry(result, at, shape, in_c), value) for at, value in zip(entries, values, strict=True)]
    printer = C99CodePrinter() if in_c else JuliaCodePrinter()
    products = [create_expand_pow_optimization(20)] if in_c else []  # C's pow is slow
    statements = [f"{start}{printer.doprint(optimize(value, products), name)}" for start, name, value in found]
    body = [f"    {line}" for statement in statements for line in statement.split("\n")]
    if in_c:
        given = ", ".join(f"const double *{argument}" for argument in arguments)
        zeros = f"    for (int i = 0; i < {prod(shape)}; ++i) {result}[i] = 0.0;"
        return [f"void {name}({given}, double *{result})", "{", zeros, *body, "}"]
    element = f"promote_type({', '.join(f'eltype({argument})' for argument in arguments)})"
    zeros = f"    {result} = zeros({element}, {', '.join(map(str, shape))})"
    return [f"function {name}({', '.join(arguments)})", zeros, *body, f"    return {result}", "end"]
