"""Compositions, adjoints, repeated steps, linear combinations and extrapolations of methods."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import reduce
from math import prod
from typing import Any

from integrators.core.arguments import is_listed, items, read_whole
from integrators.core.errors import IntegratorError, shorten, shown
from integrators.exact.entries import (
    Entry,
    certainly_differs,
    multiply_entries,
    read_entry,
    relative_error,
    sum_entries,
)
from integrators.methods.kinds.splitting import Splitting
from integrators.methods.programs.evaluations import Evaluation, LinearForm
from integrators.methods.programs.program import (
    ChildBounds,
    Method,
    Program,
    RepeatedProgram,
    appended,
    common_bounds,
    reversed_step,
)

MAX_STEPS = 1000


def composition(steps: Iterable[tuple[Method, Any]], *, name: str | None = None) -> Program | Splitting:
    """Composition of methods, each with a fraction of the step.

    Args:
        steps: pairs (method, fraction) in the order of application, with the step fraction · h. The methods must have
            the same parts; fractions are numbers or formulas such as "1/(2-root(2,3))" and may be negative.
        name: the name in messages.

    Returns:
        The composition Φ^s_(γ_s h) ∘ … ∘ Φ^1_(γ_1 h): a `Splitting` if all methods are, otherwise a program.

    Raises:
        IntegratorError: a pair is invalid, or the methods differ in their parts.

    Example:
        Half a step of the explicit Euler method, then of the implicit one, is the implicit trapezoidal rule:

        >>> from integrators import method
        >>> print(composition([(method("explicit-euler"), "1/2"), (method("implicit-euler"), "1/2")]))
        k1 = h f(y)
        k2 = h f(y + 1/2*k1 + 1/2*k2)
        y1 = y + 1/2*k1 + 1/2*k2

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.4.
    """
    pairs = _read_pairs(steps, "steps", "fraction")
    methods = [method for method, _ in pairs]
    name = name or f"composition of {_names(methods)}"
    flows = [
        (part, multiply_entries(x, fraction))
        for method, fraction in pairs
        if isinstance(method, Splitting)
        for part, x in method.flows
    ]
    if all(isinstance(method, Splitting) for method in methods):
        return Splitting(flows, parts=methods[0].names, name=name, digits=_digits(methods))
    evaluations: list[Evaluation] = []
    end = LinearForm(1)
    for method, fraction in pairs:
        end = _append(evaluations, method.program, fraction, end, methods[0])
    return _finish(evaluations, end, methods, name)


def adjoint_method(method: Method, *, name: str | None = None) -> Program | Splitting:
    """The adjoint Φ*_h = Φ_(−h)⁻¹ of a method.

    Args:
        method: the method.
        name: the name of the adjoint in messages.

    Returns:
        The adjoint: the flows in reverse order for a `Splitting`, otherwise a program with the same evaluations.

    Raises:
        IntegratorError: `method` is not a method.

    Example:
        >>> from integrators import method
        >>> print(adjoint_method(method("explicit-euler")))
        k1 = h f(y + k1)
        y1 = y + k1

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, definition II.3.1.
    """
    method = _read_method(method, "method")
    name = name or f"adjoint of {method.name}"
    if isinstance(method, Splitting):
        return Splitting(method.flows[::-1], parts=method.names, name=name, digits=method.digits)
    return _finish(*reversed_step(method.program), [method], name)


def repeat(method: Method, count: int, *, name: str | None = None) -> Program | Splitting:
    """Several steps of equal length as one method.

    Args:
        method: the method.
        count: the number of steps.
        name: the name of the result in messages.

    Returns:
        `count` steps of h / count.

    Raises:
        IntegratorError: `method` is not a method, or `count` not an integer from 1 to 1000.

    Example:
        >>> from integrators import method
        >>> print(repeat(method("explicit-euler"), 2))
        k1 = h f(y)
        k2 = h f(y + 1/2*k1)
        y1 = y + 1/2*k1 + 1/2*k2
    """
    count = _read_count(count, "count")
    method = _read_method(method, "method")
    name = name or f"{count} steps of {method.name}"
    if isinstance(method, Splitting):
        return composition([(method, Fraction(1, count))] * count, name=name)
    return RepeatedProgram(method.program, count, name)


def linear_combination(terms: Iterable[tuple[Method, Any]], *, name: str | None = None) -> Program:
    """Weighted mean of the results of several methods.

    Args:
        terms: pairs (method, weight); the weights sum to 1. The methods must have the same parts.
        name: the name of the result in messages.

    Returns:
        The method y1 = Σ_j w_j Φ^j_h(y0).

    Raises:
        IntegratorError: a pair is invalid, the methods differ in their parts, or the weights do not sum to 1.

    Example:
        >>> from integrators import method
        >>> print(linear_combination([(method("explicit-euler"), "1/2"), (method("implicit-euler"), "1/2")]))
        k1 = h f(y)
        k2 = h f(y + k2)
        y1 = y + 1/2*k1 + 1/2*k2
    """
    pairs = _read_pairs(terms, "terms", "weight")
    methods, weights = [method for method, _ in pairs], [weight for _, weight in pairs]
    total = sum_entries(weights)
    if certainly_differs(total, 1, relative_error("float" if isinstance(total, float) else "QQ", None)):
        raise IntegratorError(f"terms must have weights that sum to 1, but they sum to {total!s:.60}")
    evaluations: list[Evaluation] = []
    ends = [_append(evaluations, method.program, Fraction(1), LinearForm(1), methods[0]) for method in methods]
    increments = (end - LinearForm(1) for end in ends)
    end = sum((increment.times(w) for increment, w in zip(increments, weights, strict=True)), LinearForm(1))
    return _finish(evaluations, end, methods, name or f"combination of {_names(methods)}")


def extrapolation(
    method: Method, order: int, steps: Sequence[int] = (1, 2), *, symmetric: bool = False, name: str | None = None
) -> Program:
    """Richardson extrapolation: a linear combination of the results of n_j steps of length h / n_j for several n_j.

    With m numbers of steps the weights remove the powers h^p, …, h^(p+m−2) from the error of a method of order p. The
    error of a symmetric method has only the powers h^p, h^(p+2), …, so each further number of steps gains two orders.

    Args:
        method: the method.
        order: its order p.
        steps: the numbers of steps n_j, all different.
        symmetric: whether the error has only powers h^p, h^(p+2), ….
        name: the name of the result in messages.

    Returns:
        A method of order p + m − 1, or p + 2(m − 1) if `symmetric`.

    Raises:
        IntegratorError: `order` is not a positive integer, or `steps` are not distinct positive integers.

    Example:
        >>> from integrators import method
        >>> print(extrapolation(method("explicit-euler"), order=1))  # the explicit midpoint rule
        k1 = h f(y)
        k2 = h f(y)
        k3 = h f(y + 1/2*k2)
        y1 = y - k1 + k2 + k3

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.9.
    """
    method, order = _read_method(method, "method"), _read_count(order, "order")
    counts = [_read_count(n, f"steps[{j}]") for j, n in enumerate(items(steps, "steps"), 1)]
    if not counts or len(set(counts)) < len(counts):
        raise IntegratorError(f"steps must be different numbers, but were {shorten(str(counts))}")
    weights = _extrapolation_weights(counts, order, 2 if symmetric else 1)
    terms = [(repeat(method, n), weight) for n, weight in zip(counts, weights, strict=True)]
    return linear_combination(terms, name=name or f"extrapolation of {method.name}")


def _extrapolation_weights(counts: Sequence[int], order: int, gap: int) -> list[Fraction]:
    """w_j with Σ w_j = 1 and Σ w_j n_j^−(p + gap·i) = 0 for i < m − 1.

    With x_j = n_j^−gap the numbers w_j n_j^−p annihilate polynomials of degree below m − 1 in x_j, as the coefficients
    1 / Π_(i≠j) (x_j − x_i) of a divided difference do.
    """
    x = [Fraction(1, n**gap) for n in counts]
    found = [n**order / prod((a - b for b in x if b != a), start=Fraction(1)) for n, a in zip(counts, x, strict=True)]
    return [w / sum(found) for w in found]


def _append(
    evaluations: list[Evaluation], program: Program, factor: Entry, start: LinearForm, first: Method
) -> LinearForm:
    """Append a step from `start`, with parts numbered as in the first method; return its end point."""
    parts = [first.names.index(part) for part in program.names]
    added, end = appended(program, factor, first=len(evaluations), start=start, parts=parts)
    evaluations += added
    return end


def _finish(evaluations: Sequence[Evaluation], end: LinearForm, methods: Sequence[Method], name: str) -> Program:
    first = methods[0].program
    labels = {"name": name, "digits": _digits(methods)}
    bounds = reduce(common_bounds, (_bounds(method.program, first.names) for method in methods))
    return Program(evaluations, end, parts=first.names, auxiliary=first.auxiliary, max_children=bounds, **labels)


def _bounds(program: Program, names: Sequence[str]) -> ChildBounds | None:
    """The bounds of a method with its parts in the order of `names`."""
    if program.max_children is None:
        return None
    order = [program.names.index(name) for name in names]
    rows = [program.max_children[part] for part in order]
    return tuple((*(row[part] for part in order), *row[len(names) :]) for row in rows)


def _digits(methods: Iterable[Method]) -> int | None:
    return min((method.digits for method in methods if method.digits is not None), default=None)


def _names(methods: Iterable[Method]) -> str:
    return shorten(", ".join(method.name for method in methods))


def _read_pairs(pairs: Any, argument: str, number: str) -> list[tuple[Method, Entry]]:
    """The methods and numbers of a sequence of pairs, all with the same parts."""
    read: list[tuple[Method, Entry]] = []
    for i, pair in enumerate(items(pairs, argument), 1):
        if not is_listed(pair) or len(pair) != 2:
            raise IntegratorError(f"{argument}[{i}] must be a method and its {number}, but was {shown(pair)}")
        method = _read_method(pair[0], f"{argument}[{i}]")
        read.append((method, read_entry(pair[1], f"{number} of {argument}[{i}]")))
        first, program = read[0][0].program, method.program
        if set(program.names) != set(first.names) or set(program.auxiliary) != set(first.auxiliary):
            raise IntegratorError(
                f"{argument} must be methods with the same parts, but {shorten(first.name)} has {_parts(first)} "
                f"and {shorten(program.name)} has {_parts(program)}"
            )
    if not read:
        raise IntegratorError(f"{argument} must have at least one pair, but was empty")
    return read


def _parts(program: Program) -> str:
    return ", ".join(filter(None, program.names)) or "no parts"


def _read_method(method: Any, argument: str) -> Method:
    if not isinstance(method, Method):
        raise IntegratorError(f"{argument} must be a method, but was {shown(method)}")
    return method


def _read_count(count: object, argument: str) -> int:
    return read_whole(count, argument, f"an integer from 1 to {MAX_STEPS}", 1, MAX_STEPS)
