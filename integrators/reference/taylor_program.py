"""A scene as a list of operations on power series, from which the Taylor series of its solutions follow.

Sums over sites are written out row by row from the graph of the local formula, so that a scene of many particles is
read as fast as one of two.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from fractions import Fraction
from itertools import accumulate, chain
from typing import TYPE_CHECKING, Any, NamedTuple

from integrators.compile.operation_graph import OperationGraph, Reader, reachable
from integrators.core.errors import IntegratorError, shorten
from integrators.reference.double_double import split
from integrators.reference.taylor_operations import LINEAR, Operations
from integrators.scenes.model.local_terms import VALUE

if TYPE_CHECKING:
    import numpy as np

    from integrators.reference.taylor_operations import Term
    from integrators.scenes.model.local_terms import LocalTerm
    from integrators.scenes.scene import Scene

WORKING_DIGITS = 60
"""Numbers in formulas are known to so many digits, twice as many as they are rounded to in the end."""


class TaylorProgram(NamedTuple):
    """The operations of a scene as arrays.

    Attributes:
        dimension: The number of variables: the registers before the one of the constant 1.
        operations: The rows of `Operations`; LINEAR has the first and the end of its terms.
        slopes: Where the terms of each derivative y_i' begin, and where the last ones end.
        registers: The register of each term of a linear combination.
        weights: Its coefficient, as a double-double number.
    """

    dimension: int
    operations: np.ndarray
    slopes: np.ndarray
    registers: np.ndarray
    weights: np.ndarray


def taylor_program(scene: Scene) -> TaylorProgram:
    """The operations that give f(y) for a scene.

    Args:
        scene: The scene; its parameters must be numbers.

    Raises:
        IntegratorError: A parameter is a symbol, a number is not real or beyond the range of doubles, or a formula is
            nested too deeply.

    Example:
        >>> from integrators import Scene
        >>> program = taylor_program(Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)"))
        >>> len(program.operations)  # sin q, cos q and −sin q
        3
        >>> program.slopes - program.slopes[0], program.registers[program.slopes[0] :]
        (array([0, 1, 2]), array([3, 0]))
    """
    import mpmath

    operations = Operations(scene.dimension)
    slopes: list[list[Term]] = [[] for _ in range(scene.dimension)]
    try:
        with mpmath.workdps(WORKING_DIGITS):
            for term in scene.numeric_terms:
                _add(term, operations, slopes)
            return _arrays(operations, [operations.merged(slope) for slope in slopes])
    except RecursionError:
        raise IntegratorError("formula must be nested less deeply, but was nested beyond the limit of Python") from None
    except ZeroDivisionError:
        raise IntegratorError("formula must not divide by zero, but does") from None


def fraction_of(value: Any) -> Fraction:
    """A real number of Python or mpmath as the fraction that it is, one of SymPy to 60 digits if it is irrational.

    Raises:
        IntegratorError: It is infinite, or cannot be told from zero.
    """
    if isinstance(value, int | Fraction):
        return Fraction(value)
    if getattr(value, "is_Rational", False):
        return Fraction(int(value.p), int(value.q))
    from mpmath import isfinite
    from mpmath.libmp import to_rational

    try:
        number = value.evalf(WORKING_DIGITS, strict=True) if hasattr(value, "evalf") else value
    except ArithmeticError:
        raise IntegratorError(f"numbers must be told from zero, but one was {shorten(str(value))}") from None
    if not isfinite(number):
        raise IntegratorError(f"numbers must be finite, but one was {number}")
    return Fraction(*to_rational(number._mpf_))


def _add(term: LocalTerm, operations: Operations, slopes: list[list[Term]]) -> None:
    """Add what a term gives at every row of its sites to the slopes."""
    import sympy

    locals_ = [*(f"x{k}" for k in range(len(term.arguments))), *(f"d{k}" for k in range(len(term.data)))]
    graph = OperationGraph()
    reader = Reader(graph, {sympy.Symbol(name): name for name in locals_})
    wanted = {
        k: reader.read(term.formula if k == VALUE else term.formula.diff(sympy.Symbol(f"x{k}")))
        for k in sorted({output.derivative for output in term.outputs})
    }
    nodes = reachable(graph, [node for _, node in wanted.values()])
    data = [[_number(value) for value in data.values] for data in term.data]
    one, unit = operations.one, operations.unit
    for row in term.sites.rows():
        leaves = {f"d{k}": (data[k][row[role]], one) for k, (role, _) in enumerate(term.data)}
        for k, (plus, minus) in enumerate(term.arguments):
            leaves[f"x{k}"] = operations.sum([(unit, plus.at(row)), *([(-unit, minus.at(row))] if minus else [])])
        values = _evaluated(graph, nodes, leaves, operations)
        for k, place, sign in term.outputs:
            coefficient, register = values[wanted[k][1]]
            slopes[place.at(row)].append((sign * _number(wanted[k][0]) * coefficient, register))


def _number(value: Any) -> Any:
    """An exact number in working precision."""
    from mpmath import mpf

    exact = fraction_of(value)
    return mpf(exact.numerator) / exact.denominator


def _evaluated(
    graph: OperationGraph, nodes: Iterable[int], leaves: Mapping[str, Term], operations: Operations
) -> dict[int, Term]:
    """What the nodes of a graph are, given its variables and data."""
    values: dict[int, Term] = {}

    def scaled(term: Any) -> Term:
        coefficient, register = values[term[1]]
        return _number(term[0]) * coefficient, register

    for node in nodes:
        kind, *content = graph.nodes[node]
        if kind == "name":
            values[node] = leaves[content[0]]
        elif kind == "sum":
            values[node] = operations.sum(map(scaled, content[0]))
        elif kind == "product":
            values[node] = operations.product(operations.power(values[factor], n) for factor, n in content[0])
        elif kind == "call":
            values[node] = operations.function(content[0], scaled(content[1]))
        else:
            values[node] = operations.general_power(*map(scaled, content))
    return values


def _arrays(operations: Operations, slopes: list[tuple[Term, ...]]) -> TaylorProgram:
    import numpy as np

    combinations = [*operations.combinations, *slopes]
    ends = [0, *accumulate(map(len, combinations))]
    rows = [[LINEAR, ends[row[1]], ends[row[1] + 1], 0] if row[0] == LINEAR else row for row in operations.rows]
    terms = list(chain.from_iterable(combinations))
    return TaylorProgram(
        dimension=operations.one,
        operations=np.array(rows, dtype=np.int64).reshape(-1, 4),
        slopes=np.array(ends[len(operations.combinations) :], dtype=np.int64),
        registers=np.array([register for _, register in terms], dtype=np.int64),
        weights=np.array([_weight(coefficient) for coefficient, _ in terms], dtype=float).reshape(-1, 2),
    )


def _weight(number: Any) -> tuple[float, float]:
    try:
        return split(fraction_of(number))
    except OverflowError:
        raise IntegratorError(
            f"formula must have numbers in the range of doubles, but has {shorten(str(number))}"
        ) from None
