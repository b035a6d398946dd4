"""Optimisers with memory as methods for y' = f(y), f = −∇L: heavy-ball momentum and Nesterov's method."""

from __future__ import annotations

from collections.abc import Sequence

from bseries_base.errors import shown
from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry, multiply_entries, read_entry, sum_entries
from integrators.methods.kinds.memory import ONE, ZERO, GeneralLinear, LinearMultistep


def momentum(
    beta: object = "beta",
    *,
    parameters: Sequence[str] = ("beta",),
    name: str = "momentum",
    reference: str | None = "B. T. Polyak, USSR Comput. Math. Math. Phys. 4 (1964) 1–17",
) -> LinearMultistep:
    """Gradient descent with momentum, y_{n+1} = (1 + β) y_n − β y_{n−1} + h f(y_n) with f = −∇L.

    As ρ'(1) = 1 − β and σ(1) = 1, it solves the rescaled system y' = f(y)/(1 − β): the method is `rescaled`.

    Args:
        beta: The exact coefficient β ≠ 1, a number or text such as ``"9/10"``; by default a symbol.
        parameters, name, reference: As for `Splitting`.

    Raises:
        IntegratorError: `beta` is 1, a float or cannot be read.

    Example:
        >>> import bseries as bs
        >>> b = bs.modified_equation(bs.memory.momentum(), 2)
        >>> [str(b[tree].factor()) for tree in ("τ", "[τ]")]
        ['-1/(beta - 1)', '(beta + 1)/(2*(beta - 1)**3)']
    """
    value = _read_beta(beta, parameters)
    alpha = [value, sum_entries([-ONE, -value]), ONE]
    return LinearMultistep(
        alpha, [ZERO, ONE, ZERO], rescaled=True, parameters=parameters, name=name, reference=reference
    )


def nesterov(
    beta: object = "beta",
    *,
    lookahead: bool = False,
    parameters: Sequence[str] = ("beta",),
    name: str = "nesterov",
    reference: str | None = "Y. Nesterov, Soviet Math. Dokl. 27 (1983) 372–376",
) -> GeneralLinear:
    """Nesterov's method Y = y_n + β (y_n − y_{n−1}), y_{n+1} = Y + h f(Y), with the inputs y_n and y_{n−1}.

    It solves the rescaled system y' = f(y)/(1 − β), as `momentum` does.

    Args:
        beta: The exact coefficient β ≠ 1, a number or text such as ``"9/10"``; by default a symbol.
        lookahead: Follow the points Y instead of y; the two one-step methods are conjugate.
        parameters, name, reference: As for `Splitting`.

    Raises:
        IntegratorError: `beta` is 1, a float or cannot be read.

    Example:
        >>> import bseries as bs
        >>> b = bs.modified_equation(bs.memory.nesterov("1/2"), 2)
        >>> [str(b[tree]) for tree in ("τ", "[τ]")]
        ['2', '-4']
    """
    value = _read_beta(beta, parameters)
    row = [sum_entries([ONE, value]), multiply_entries(-ONE, value)]
    finishing = row if lookahead else [ONE, ZERO]
    return GeneralLinear(
        [[ZERO]], [row], [[ONE], [ZERO]], [row, [ONE, ZERO]],
        finishing=finishing, parameters=parameters, name=name, reference=reference,
    )  # fmt: skip


def _read_beta(beta: object, parameters: Sequence[str]) -> Entry:
    value = read_entry(beta, "beta", tuple(parameters))
    if value == 1 or isinstance(value, float):
        raise IntegratorError(f"beta must be an exact number or formula other than 1, but was {shown(beta)}")
    return value
