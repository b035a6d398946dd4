"""What series cost, order by order, in a process of its own; prints a list of JSON.

`algebra DOMAIN` computes modified equations of one two-stage method in numbers of that domain, `scene SCENE METHOD
ROUTE` evaluates f_h on a scene. Both go on until one order takes longer than the limit given last.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from fractions import Fraction
from math import log10
from time import process_time
from typing import Any

import numba  # noqa: F401  (once it is loaded, kernels run compiled)
import numpy as np

import bseries as bs
from benchmarks.timing import peak_memory, time_calls

LARGEST_TABLE = 16
"""Larger tables of trees are not kept for the next caller."""
DOMAINS: dict[str, Callable[[], Any]] = {
    "float": lambda: bs.method("sdirk2", gamma=1 / 3),
    "exact": lambda: bs.method("sdirk2", gamma=Fraction(1, 3)),
    "algebraic": lambda: bs.method("crouzeix3"),  # gamma = (3 + √3)/6
    "symbolic": lambda: bs.method("sdirk2"),
}
LARGEST_ORDER = 12
"""Of a series on a scene."""
POINTS, PRECISE_POINTS = 400, 5
STEP = 1.0
"""So large that the terms of high order count for the digits that are right."""
SAMPLE = 0.2
"""CPU seconds of calls for one time: an order has its turn only once."""
DIGITS = 40
MOST_DIGITS = -log10(2.0**-53)
"""A float has no more that are right."""


def seconds_of(function: Callable[[], object]) -> float:
    """CPU seconds of a call."""
    return time_calls(function, SAMPLE, process_time).seconds


def algebra(domain: str, limit: float) -> list[dict[str, Any]]:
    """Seconds with trees and splits at hand, peak memory with them, and digits, for each order."""
    method = DOMAINS[domain]()
    field = bs.modified_equation(method, 1)
    before, found = peak_memory(), []
    for order in range(1, LARGEST_TABLE + 1):
        field = bs.modified_equation(method, order)
        seconds = seconds_of(lambda n=order: bs.modified_equation(method, n))
        found.append(
            {
                "domain": domain,
                "order": order,
                "trees": len(field),
                "seconds": seconds,
                "bytes": peak_memory() - before,
            }
        )
        if seconds > limit:
            break
    digits = right_digits(field) if domain == "float" else largest_digits(field)
    return [{**row, "digits": number} for row, number in zip(found, digits, strict=True)]


def by_order(field: bs.BSeries, numbers: Iterable[float]) -> list[float]:
    """The largest of these numbers, one for each tree, among the trees of each order."""
    largest = [0.0] * field.order
    for order, number in zip(field.table.order.tolist(), numbers, strict=True):
        largest[order - 1] = max(largest[order - 1], number)
    return largest


def largest_digits(field: bs.BSeries) -> list[float]:
    """For each order, the digits of the largest numerator or denominator in a coefficient."""
    return [len(str(int(number))) for number in by_order(field, map(largest_integer, field.coefficients()))]


def largest_integer(coefficient: Any) -> int:
    """The largest numerator or denominator of a fraction, or in an expression."""
    if isinstance(coefficient, Fraction):
        return max(abs(coefficient.numerator), coefficient.denominator)
    from sympy import Rational

    return max(max(abs(int(x.p)), int(x.q)) for x in coefficient.atoms(Rational))


def right_digits(field: bs.BSeries) -> list[float]:
    """For each order, the digits that are right in the worst of the coefficients that are not zero."""
    exact = bs.modified_equation(DOMAINS["exact"](), field.order).coefficients()
    errors = (abs(Fraction(x) / y - 1) if y else 0 for x, y in zip(field.coefficients(), exact, strict=True))
    return [digits_of(float(error)) for error in by_order(field, map(float, errors))]


def digits_of(error: float) -> float:
    """The decimal digits that are right, given a relative error."""
    return min(MOST_DIGITS, -log10(error)) if error else MOST_DIGITS


def scene(name: str, method: str, route: str, limit: float) -> list[dict[str, Any]]:
    """Seconds per point and until the first value, peak memory, and digits that are right, for each order."""
    model = bs.scene(name)
    points = model.y0[:, None] + 0.01 * np.random.default_rng(1).random((model.dimension, POINTS))
    bs.modified_field(bs.method(method), model, 1, route=route)(points, STEP)
    before, found = peak_memory(), []
    for order in range(1, LARGEST_ORDER + 1):
        begin = process_time()
        field = bs.modified_field(bs.method(method), model, order, route=route)
        values = field(points, STEP)
        ready = process_time() - begin
        found.append(
            {
                "scene": name,
                "method": method,
                "route": route,
                "order": order,
                "trees": len(field.trees.table),
                "of": field.trees.total,
                "seconds": seconds_of(lambda f=field: f(points, STEP)) / POINTS,
                "ready": ready,
                "bytes": peak_memory() - before,
                "digits": digits_of(
                    max(precise_error(field, points[:, k], values[:, k]) for k in range(PRECISE_POINTS))
                ),
            }
        )
        if ready > limit:
            break
    return found


def precise_error(field: bs.fields.SceneSeries, point: np.ndarray, value: np.ndarray) -> float:
    """The largest relative error of a component of the value at a point."""
    precise = field.precise(point.tolist(), STEP, DIGITS)
    return max(float(abs(x - y) / abs(y)) if y else abs(x) for x, y in zip(value.tolist(), precise, strict=True))


if __name__ == "__main__":
    task, *arguments, limit = sys.argv[1:]
    if task == "algebra":
        print(json.dumps(algebra(arguments[0], float(limit))))
    else:
        name, method, route = arguments
        print(json.dumps(scene(name, method, route, float(limit))))
