"""Substitution of fields on rooted trees into series and methods, its inverse, and modifying integrators.

Substitution into a method composes the field with the series of each stage (see `bseries.exact.kernels`): n² operations
per tree and stage, and restricted tables are closed. Substitution into a series is a sum over all 2^(n−1) partitions of
a tree; no polynomial algorithm is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import partial
from typing import Any

from bseries.algebra import stages as inputs
from bseries.algebra.bseries import BSeries, check_trees
from bseries.algebra.modified import exact_values, of_method, series_to, table_of
from bseries.algebra.series import Series, check_field, check_flow, fewest_digits
from bseries.algebra.stages import MethodStages, RationalStages
from bseries.algebra.uncertainty import Uncertainty, by_differences
from bseries.exact import bounds, denominators, recursions
from bseries.exact.arithmetic import WrappedParts, wrapped_parts
from bseries.exact.bounds import Bound
from bseries.exact.denominators import twos
from bseries.exact.domains import Values, alike, apply, ring_element
from bseries.exact.rationals import Operation, RationalValues
from bseries.exceptions import SeriesError
from integrators.methods.catalogue.registry import as_method
from integrators.methods.programs.program import Method
from trees.counting import normal_limits, refuse_table_beyond_memory
from trees.table import TreeTable


def substitute(b: BSeries, a: BSeries | Method) -> BSeries:
    """Substitution b ★ a: the field b replaces f in a series or a method.

    With f_b the field of b, B(b ★ a, y) for f is B(a, y) for f_b. On coloured trees every part f^[ν] is replaced by
    the terms of b whose root has the colour ν.

    Args:
        b: A field.
        a: A method, or a series (flow or field) on the same trees. Methods are much faster, and allow any table.

    Returns:
        b ★ a, on the trees of b: a flow if a is one, a field if a is one.

    Raises:
        SeriesError: b is no field; a has other trees or colours; a is a series, and the table is restricted.
        TreeError: a is a series, and the partitions of all trees do not fit in memory.

    Example:
        The exact flow of the modified equation is the method:

        >>> import bseries as bs
        >>> rk4 = bs.method("rk4")
        >>> bs.substitute(bs.modified_equation(rk4, 6), bs.exact_flow(6)) == bs.series(rk4, 6)
        True

    References:
        P. Chartier, E. Hairer, G. Vilmart, *Algebraic structures of B-series*, Found. Comput. Math. 10 (2010),
        theorem 3.2, doi:10.1007/s10208-010-9065-1.
    """
    check_trees(b, "b")
    check_field(b, "b")
    if isinstance(a, Series):
        return _into_series(b, a)
    method = inputs.check_method(a)
    if b.names != method.names:
        raise SeriesError(f"b must have the colours of the method, {_listed(method.names)}, but has {_listed(b.names)}")
    _check_memory(b.table, method)
    stages, (values,) = inputs.in_one_domain(method, b.order, [b.stored])

    def expression(arithmetic: Any, field: Any, stages: Any) -> Any:
        return recursions.into_stages(stages(), b.table, arithmetic, field=field(field=True))

    digits = [x for x in (b.digits, method.digits) if x is not None]
    result = apply(b.table, [values, stages], _substitution(expression, values, stages))
    return BSeries(b.table, result, 1, names=b.names, digits=min(digits, default=None))


def _into_series(b: BSeries, a: BSeries) -> BSeries:
    check_trees(a, "a")
    b.check_same_basis(a)
    _check_all_trees(a, "a")
    first, second = (values.reduced for values in alike([b.stored, a.stored]))

    def expression(arithmetic: Any, field: Any, base: Any) -> Any:
        return recursions.into_series(base(field=False), b.table, arithmetic, field=field(field=True))

    operation = _substitution(expression, first, second)
    if isinstance(second, RationalValues):
        integers = _integers(first.denominators, second.denominators)
        operation = operation._replace(units=1 if integers else 2, integers=integers)
    values = apply(b.table, [first, second], operation)
    return BSeries(b.table, values, a.empty, names=b.names, digits=fewest_digits(a, b))


def modifying_integrator(
    method: Method | BSeries | str, order: int | TreeTable | None = None, *, max_children: Any = None
) -> BSeries:
    """Modifying integrator: the field for which the method gives the exact solution of y' = f(y).

    With b the result, the method applied to y' = f_h(y) = Σ_τ h^(|τ|−1) / σ(τ) · b(τ) F(τ)(y) is formally the exact
    flow of f, substitute(b, method) = exact_flow; with the series truncated it is a method of higher order.

    Args:
        method: A method, or any flow series.
        order: Largest number of nodes N, by default 5, or the order of a series. For a method also a table of trees.
        max_children: Which trees to include, as for `trees.TreeTable`.

    Raises:
        SeriesError: `method` is neither a method nor a flow; its weights sum to 0 for some part of the field; it has
            auxiliary parts; `order` exceeds the order of the series.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is (refused before any work).

    Example:
        >>> import bseries as bs
        >>> b = bs.modifying_integrator(bs.method("implicit-midpoint"), 3)
        >>> [(str(tree), str(value)) for tree, value in b.items() if value]
        [('τ', '1'), ('[[τ]]', '-1/12'), ('[τ,τ]', '1/12')]

    References:
        P. Chartier, E. Hairer, G. Vilmart, *Numerical integrators based on modified differential equations*, Math.
        Comp. 76 (2007) 1941–1953, doi:10.1090/S0025-5718-07-01967-9.
    """
    method = as_method(method)
    if isinstance(method, BSeries):
        a = series_to(method, order, max_children)
        check_flow(a, "method")
        return _solve(a, exact_values(a.table), "method").with_label(a.label, "modifying")
    table = table_of(method, order, max_children)
    for color in inputs.auxiliary_colors(method):
        raise SeriesError(f"method must have parts of the field only, but {method.names[color]} is none")
    _check_memory(table, method)
    values_of = partial(_modifying_values, method, table)
    stages = inputs.stages_in_field(method, table.max_order)

    def uncertainty(method: Method, stages: MethodStages, table: TreeTable) -> Uncertainty:
        return by_differences(method, stages, table, lambda x: values_of(x).coefficients())

    found = of_method(method, table, values_of, 0, stages, uncertainty)
    return found.with_label(method.name, "modifying")


def _modifying_values(method: Method, table: TreeTable, stages: MethodStages) -> Values:
    """The modifying integrator of a method with these stages."""
    target, sums = exact_values(table), stages.weight_sums(table.colors)
    inverses = _inverses(sums, stages, f"sums of the weights of {method.name}", method.names)

    def expression(arithmetic: Any, stages: Any) -> Any:
        exact = target.load(table, arithmetic, field=True)
        return recursions.into_stages(stages(), table, arithmetic, target=exact, inverses=inverses)

    if not isinstance(stages, RationalStages):
        return apply(table, [stages], _operation(expression, (), lambda known: ()))
    numerators = _numerators(sums)
    powers = tuple(stages.step**n for n in range(table.max_order + 1))
    flow, largest = stages.bound(table.max_order), max(map(abs, inverses))
    operation = _operation(
        expression,
        denominators.solved(powers, target.denominators, numerators),
        lambda known: bounds.solved(flow, target.bound, largest, known),
    )
    integers = stages.integers if numerators % 2 else None
    operation = operation._replace(
        units=1 if integers else 2, avoid=numerators, integers=integers, passes=2 * stages.stages.size
    )
    return apply(table, [stages], operation)


def substitution_inverse(b: BSeries) -> BSeries:
    """Inverse in the substitution group: the field x with substitute(x, b) = substitute(b, x) = f.

    Args:
        b: A field with b(•) ≠ 0, on all trees of a table.

    Raises:
        SeriesError: b is no field, vanishes at a single node, or its table is restricted.

    Example:
        >>> import bseries as bs
        >>> b = bs.modified_equation(bs.method("explicit-euler"), 4)
        >>> x = bs.algebra.substitution_inverse(b)
        >>> identity = bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 4, empty=0)
        >>> bs.substitute(x, b) == bs.substitute(b, x) == identity
        True
        >>> x == bs.modifying_integrator(bs.method("explicit-euler"), 4)
        True

    References:
        D. Calaque, K. Ebrahimi-Fard, D. Manchon, *Two interacting Hopf algebras of trees*, Adv. Appl. Math. 47 (2011)
        282–308, doi:10.1016/j.aam.2009.08.003.
    """
    check_trees(b, "b")
    check_field(b, "b")
    identity = RationalValues(b.table, [int(at < b.table.colors) for at in range(len(b))], [1] * (b.order + 1), 1)
    return _solve(b, identity, "b")


def _solve(a: BSeries, target: RationalValues, name: str) -> BSeries:
    """The field b with b ★ a = target."""
    _check_all_trees(a, name)
    values: Any = a.stored.reduced
    roots = [values.raw[c] if values.kind == "ring" else values[c] for c in range(a.table.colors)]
    inverses = _inverses(roots, values, f"coefficients of single nodes in {name}", a.names)

    def expression(arithmetic: Any, base: Any) -> Any:
        wanted = target.load(a.table, arithmetic, field=True)
        return recursions.into_series(base(field=False), a.table, arithmetic, target=wanted, inverses=inverses)

    if not isinstance(values, RationalValues):
        operation = _operation(expression, (), lambda known: ())
    else:
        numerators, flow, largest = _numerators(roots), values.bound, max(map(abs, inverses))
        operation = _operation(
            expression,
            denominators.solved(values.denominators, target.denominators, numerators),
            lambda known: bounds.solved(flow, target.bound, largest, known),
        )._replace(avoid=numerators)
    operation = operation._replace(passes=2 ** (a.order - 1) // a.order + 1)
    return BSeries(a.table, apply(a.table, [values], operation), 0, names=a.names, digits=a.digits)


def _operation(expression: Any, denominators: Sequence[int], bound: Callable[[Bound], Bound]) -> Operation:
    """An operation with known denominators, computed modulo odd primes, since it is not homogeneous."""
    return Operation(
        expression,
        bound,
        lambda n, _: denominators[n],
        lambda *_: math.lcm(*denominators),
        field=True,
        units=2,
    )


def _substitution(expression: Any, b: Any, a: Any) -> Operation:
    """The operation that gives b ★ a; only rational values need bounds."""
    if not isinstance(b, RationalValues):
        return _operation(expression, (), lambda known: ())
    orders = range(b.basis.max_order + 1)
    is_method = isinstance(a, RationalStages)
    skeletons = tuple(a.step**n for n in orders) if is_method else a.denominators
    flow = a.bound(b.basis.max_order) if is_method else a.bound
    operation = _operation(
        expression,
        denominators.substituted(skeletons, b.denominators),
        lambda known: bounds.substituted(flow, b.bound),
    )
    passes = 2 * a.stages.size if is_method else 2 ** (b.basis.max_order - 1) // b.basis.max_order + 1
    return operation._replace(passes=passes)


def _integers(parts: Sequence[int], skeletons: Sequence[int]) -> WrappedParts | None:
    """The arithmetic modulo 2^64 in which these denominators become odd; None if that of the skeleton • is even."""
    if skeletons[1] % 2 == 0:
        return None
    offset = max((-(-twos(d) // (m - 1)) for m, d in enumerate(skeletons) if m > 1), default=0)
    slope = max(-(-(twos(d) + offset) // n) for n, d in enumerate(parts) if n > 0)
    return wrapped_parts(slope, offset)


def _inverses(sums: Sequence[Any], domain: Any, what: str, names: Sequence[str]) -> list[Any]:
    """1/x for each colour."""
    if not all(sums):
        name = names[[bool(x) for x in sums].index(False)]
        raise SeriesError(f"{what} must not be 0, to be divided by, but {f'those for {name} are' if name else 'are'}")
    if domain.kind == "ring":
        return [domain.ring.exquo(ring_element(domain.ring, Fraction(1)), x) for x in sums]
    return [1 / x for x in sums]


def _numerators(sums: Sequence[Any]) -> int:
    """The common multiple of the numerators, which divisions by these numbers bring into denominators."""
    return math.lcm(*(abs(x.numerator) for x in sums if isinstance(x, Fraction)))


def _check_all_trees(a: BSeries, name: str) -> None:
    table = a.table
    if table.limits != normal_limits(table.colors, None):
        raise SeriesError(
            f"{name} must be a method, or a series on all trees up to an order (skeletons leave restricted tables), "
            f"but was a series on {table!r}"
        )


def _check_memory(table: TreeTable, method: Method) -> None:
    """Refuse computations beyond the memory: two rows for each tree and stage."""
    trees = table.offsets[-2]
    rows = 2 * (table.max_order + 3) * trees * max(1, getattr(method, "stages", 1))
    refuse_table_beyond_memory(8 * (rows + 4 * len(table)), f"substitution into {method.name} on {len(table)} trees")


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if any(names) else "none but one"
