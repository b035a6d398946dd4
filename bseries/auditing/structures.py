"""Structures that sources claim of their tableaus: symplectic, symmetric, SSP, FSAL, and the stage order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import Any

from bseries.analysis.simplifying_assumptions import simplifying_assumptions
from bseries.analysis.stability.criteria import ssp_coefficient
from bseries.auditing.corrections import digits_wanted
from integrators import RungeKutta

STRUCTURES: dict[str, Callable[[RungeKutta], bool | None]] = {
    "symplectic": lambda method: method.is_symplectic,
    "symmetric": lambda method: method.is_symmetric,
    "SSP": lambda method: _is_ssp(method),
    "FSAL": lambda method: _is_fsal(method),
}
"""None where the coefficients leave it open."""


def violated(method: RungeKutta, claimed: Iterable[str]) -> Iterator[str]:
    """The structures among those claimed that a method lacks; of rounded numbers, to the digits that orders need."""
    rounded = method.with_digits(digits_wanted(method)) if method.digits else method
    yield from (name for name in claimed if STRUCTURES[name](rounded) is False)


def stage_order_of(method: RungeKutta, most: int) -> int:
    """The largest q, up to one, for which B(q) and C(q) hold: exactly, or to the digits that orders need."""
    if method.domain != "decimal" and not method.digits:
        found = simplifying_assumptions(method, most)
        return min(found.B, found.C, most)
    near = Fraction(1, 10 ** digits_wanted(method))
    entries: Any = (*method.A, method.b)
    *A, b = [[Fraction(x) for x in row] for row in entries]
    nodes = [sum(row, Fraction()) for row in A]
    for q in range(1, most + 1):
        powers = [c ** (q - 1) for c in nodes]
        exact = [*(c**q / q for c in nodes), Fraction(1, q)]
        sums = [sum((x * y for x, y in zip(row, powers, strict=True)), Fraction()) for row in (*A, b)]
        if any(abs(x - y) > near * max(1, abs(y)) for x, y in zip(sums, exact, strict=True)):
            return q - 1
    return most


def _is_ssp(method: RungeKutta) -> bool | None:
    """Whether the SSP coefficient is positive; open where entries that should be 0 may be negative by rounding."""
    entries = [float(x) for row in (*method.to_float().A, method.to_float().b) for x in row]  # type: ignore[arg-type]
    if method.digits and all(x > -(10.0 ** -digits_wanted(method)) for x in entries):
        return None
    coefficient = ssp_coefficient(method)
    return None if coefficient is None else coefficient > 0


def _is_fsal(method: RungeKutta) -> bool:
    """Whether the last stage is evaluated at the result of the step, with either row of weights."""
    last, near = method.to_float().A[-1], 10.0 ** -digits_wanted(method)
    rows = (method.to_float().b, *method.to_float().embedded)
    return any(all(abs(x - y) < near for x, y in zip(last, row, strict=True)) for row in rows)  # type: ignore[operator]
