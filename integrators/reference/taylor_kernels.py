"""Compiled Taylor steps: expand all series order by order, then sum them at the end of the step.

Series are in powers of s = (t − t_n)/unit, with a signed power of two near the step as unit: coefficients in t itself
may leave the range of doubles.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np

from foundation.machine_code import njit
from integrators.compile import machine
from integrators.compile.machine import fma
from integrators.exact import expressions
from integrators.exact.expressions import ELEMENTARY
from integrators.reference import double_double, taylor_program
from integrators.reference.double_double import (
    DoubleDouble,
    add,
    divide,
    inlined,
    integer_power,
    multiply,
    quick_two_sum,
    scale,
    split,
    square_root,
    strict,
    subtract,
    two_product,
    two_sum,
)
from integrators.reference.taylor_program import FUNCTION, LINEAR, POWER, PRODUCT, TaylorProgram

SOURCES = (double_double, expressions, machine, taylor_program)

RUNNING, DONE, STUCK = range(3)
LARGEST_STEP = 16.0
"""In units; needed where all high coefficients vanish, as at a point of symmetry."""
SMALLEST_STEP = 2.0**-64
"""As a fraction of the whole interval; near a pole, steps shrink by a constant factor."""
STEP_BITS = 24
"""Bits of a step, few enough that the time stays exact."""
BIAS = 2.0**-6
"""Relative bias of the perturbations: 1/n is always rounded alike, so amplitudes grow by 2^-110 a step."""
INVERSES = np.array([split(Fraction(1, max(n, 1))) for n in range(64)])

SIN, COS, TAN, ASIN, ACOS, ATAN, SINH, COSH, TANH, ASINH, ACOSH, ATANH, EXP, LOG, ERF = range(
    FUNCTION, FUNCTION + len(ELEMENTARY)
)


@inlined
def convolution(series: Any, x: int, y: int, first: int, end: int, k: int) -> DoubleDouble:
    """Σ_{first ≤ j < end} x_j y_{k−j}: the high parts exactly, the rest in doubles."""
    total, rest = 0.0, 0.0
    for j in range(first, end):
        product, error = two_product(series[x, j, 0], series[y, k - j, 0])
        total, lost = two_sum(total, product)
        rest += lost + fma(series[x, j, 1], series[y, k - j, 0], fma(series[x, j, 0], series[y, k - j, 1], error))
    return quick_two_sum(total, rest)


@inlined
def weighted(series: Any, x: int, y: int, first: int, end: int, k: int, start: float, increment: float) -> DoubleDouble:
    """Σ_{first ≤ j < end} (start + increment·j) x_j y_{k−j}; the weights are integers."""
    total, rest = 0.0, 0.0
    for j in range(first, end):
        weight = start + increment * j
        high, low = two_product(weight, series[x, j, 0])
        low = fma(weight, series[x, j, 1], low)
        product, error = two_product(high, series[y, k - j, 0])
        total, lost = two_sum(total, product)
        rest += lost + fma(low, series[y, k - j, 0], fma(high, series[y, k - j, 1], error))
    return quick_two_sum(total, rest)


@inlined
def linear(series: Any, registers: Any, weights: Any, first: int, end: int, k: int) -> DoubleDouble:
    """The k-th coefficient of a linear combination."""
    total, rest = 0.0, 0.0
    for i in range(first, end):
        x = registers[i]
        product, error = two_product(weights[i, 0], series[x, k, 0])
        total, lost = two_sum(total, product)
        rest += lost + fma(weights[i, 1], series[x, k, 0], fma(weights[i, 0], series[x, k, 1], error))
    return quick_two_sum(total, rest)


@inlined
def product(series: Any, x: int, y: int, k: int) -> DoubleDouble:
    """The k-th coefficient of a product; a square takes half the work."""
    square = x == y
    total = convolution(series, x, y, 0, (k + 1) // 2 if square else k + 1, k)
    if square:
        total = scale(total, 2.0)
        if k % 2 == 0:
            middle = (series[x, k // 2, 0], series[x, k // 2, 1])
            total = add(total, multiply(middle, middle))
    return total


@inlined
def power(series: Any, u: int, value: int, numerator: int, denominator: int, k: int) -> DoubleDouble:
    """The k-th coefficient of v = u^(a/b) for k > 0, from b u v' = a u' v."""
    total = weighted(series, value, u, 0, k, k, float(numerator * k), -float(numerator + denominator))
    return divide(total, scale((series[u, 0, 0], series[u, 0, 1]), float(denominator * k)))


@inlined
def function(series: Any, u: int, derivative: int, k: int) -> DoubleDouble:
    """The k-th coefficient of v = f(u) for k > 0, from v' = g u'."""
    total = weighted(series, u, derivative, 1, k + 1, k, 0.0, 1.0)
    return multiply(total, (INVERSES[k, 0], INVERSES[k, 1]))


@strict
def first_of_function(u: DoubleDouble, kind: int, numerator: int, denominator: int) -> DoubleDouble:
    """u^(a/b), or f(u)."""
    if kind == POWER:
        if denominator == 1:
            return integer_power(u, numerator)
        if denominator == 2:
            return integer_power(square_root(u), numerator)
        exponent = divide((float(numerator), 0.0), (float(denominator), 0.0))
        return double_double.exp(multiply(exponent, double_double.log(u)))
    if kind == SIN:
        return double_double.sin(u)
    if kind == COS:
        return double_double.cos(u)
    if kind == TAN:
        return double_double.tan(u)
    if kind == ASIN:
        return double_double.asin(u)
    if kind == ACOS:
        return double_double.acos(u)
    if kind == ATAN:
        return double_double.atan(u)
    if kind == SINH:
        return double_double.sinh(u)
    if kind == COSH:
        return double_double.cosh(u)
    if kind == TANH:
        return double_double.tanh(u)
    if kind == ASINH:
        return double_double.asinh(u)
    if kind == ACOSH:
        return double_double.acosh(u)
    if kind == ATANH:
        return double_double.atanh(u)
    if kind == EXP:
        return double_double.exp(u)
    if kind == LOG:
        return double_double.log(u)
    return double_double.erf(u)


@strict
def expand(program: TaylorProgram, series: Any, unit: float, order: int) -> None:
    """Compute all coefficients to this order from the values of the variables."""
    one, operations, derivatives, registers, weights = program
    for k in range(order + 1):
        for i in range(len(operations)):
            kind, a, b, c = operations[i, 0], operations[i, 1], operations[i, 2], operations[i, 3]
            target = one + 1 + i
            if kind == LINEAR:
                value = linear(series, registers, weights, a, b, k)
            elif kind == PRODUCT:
                value = product(series, a, b, k)
            elif k == 0:
                value = first_of_function((series[a, 0, 0], series[a, 0, 1]), kind, b, c)
            elif kind == POWER:
                value = power(series, a, target, b, c, k)
            else:
                value = function(series, a, b, k)
            series[target, k, 0], series[target, k, 1] = value
        if k < order:
            for i in range(one):
                derivative = scale(linear(series, registers, weights, derivatives[i], derivatives[i + 1], k), unit)
                value = multiply(derivative, (INVERSES[k + 1, 0], INVERSES[k + 1, 1]))
                series[i, k + 1, 0], series[i, k + 1, 1] = value


@strict
def step_size(series: Any, dimension: int, order: int) -> float:
    """The step, in units, from the second half of the coefficients; nan if some are not finite.

    These show the radius of convergence, relative to the size of each variable, the largest of its first coefficients.
    A step of radius/e² needs the fewest operations per digit and unit of time (Jorba, Zou 2005).
    """
    radius = math.inf
    for i in range(dimension):
        size = 0.0
        for k in range(order // 2 + 1):
            size = max(size, abs(series[i, k, 0]))
        for k in range(order // 2 + 1, order + 1):
            coefficient = abs(series[i, k, 0])
            if not coefficient < math.inf:
                return math.nan
            if coefficient > 0:
                radius = min(radius, (size / coefficient) ** (1.0 / k))
    return min(radius * math.exp(-2 - 0.7 / (order - 1)), LARGEST_STEP)


@strict
def at(series: Any, i: int, order: int, s: DoubleDouble) -> DoubleDouble:
    """The value of a variable by Horner's rule."""
    total = (0.0, 0.0)
    for k in range(order, -1, -1):
        total = add(multiply(total, s), (series[i, k, 0], series[i, k, 1]))
    return total


@strict
def evaluate(
    series: Any, dimension: int, order: int, step: float, unit: float, state: Any, times: Any, first: int, values: Any
) -> int:
    """Evaluate the solution and its size Σ |c_k step^k| at the times within a step; the index of the next time."""
    while first < len(times):
        s = scale(subtract((times[first, 0], times[first, 1]), (state[0], state[1])), 1 / unit)
        if s[0] > step:
            break
        for i in range(dimension):
            values[i, first, 0], values[i, first, 1] = at(series, i, order, s)
            size = 0.0
            for k in range(order, -1, -1):
                size = size * step + abs(series[i, k, 0])
            values[i, first, 2] = size
        first += 1
    return first


@njit(sources=SOURCES, nogil=True, error_model="numpy", fastmath=False)
def advance(
    program: TaylorProgram, series: Any, state: Any, order: int, perturbation: float, steps: int, times: Any,
    first: int, values: Any,
) -> tuple[int, int]:  # fmt: skip
    """Make some steps, and evaluate the solution at the times that they pass.

    Args:
        program: The operations.
        series: An array (registers, order + 1, 2) with the state in its first coefficients; overwritten.
        state: The time since the start as a double-double number, and the unit; updated.
        order: The order of the series.
        perturbation: Relative change of each variable after each step, of random sign, and relative extension of steps.
        steps: The largest number of expansions.
        times: Times since the start as double-double numbers (n, 2), of one sign and increasing in size.
        first: The index of the next time.
        values: An array (variables, n, 3) that receives the solution at these times, and its size within the step.

    Returns:
        The index of the next time, and the status: RUNNING, DONE, or STUCK (no step is possible).
    """
    dimension = program.dimension
    series[dimension, :, :] = 0.0
    series[dimension, 0, 0] = 1.0
    for _ in range(steps):
        unit = state[2]
        if not abs(unit) > SMALLEST_STEP * abs(times[-1, 0]):
            return first, STUCK
        expand(program, series, unit, order)
        step = step_size(series, dimension, order)
        if not step > 0:
            state[2] = unit * 2.0**-16
            continue
        mantissa, exponent = math.frexp(step)
        if exponent >= 0:
            step = math.ldexp(math.floor(math.ldexp(mantissa, STEP_BITS)), exponent - STEP_BITS)
            first = evaluate(series, dimension, order, step, unit, state, times, first, values)
            if first == len(times):
                return first, DONE
            for i in range(dimension):
                value = at(series, i, order, (step, perturbation * step))
                sign = math.copysign(1.0, value[0]) * math.copysign(1.0, value[1])  # its low bits are random
                series[i, 0, 0], series[i, 0, 1] = multiply(value, (1.0, (sign + BIAS) * perturbation))
            state[0], state[1] = add((state[0], state[1]), (step * unit, 0.0))
        state[2] = math.ldexp(unit, exponent - 1 if exponent > 0 else exponent)
    return first, RUNNING
