"""Steps of kick–drift–kick and shadow energies in the precision of mpmath, term by term."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import sympy

from bseries.shadow.formulas import ShadowFormula
from integrators.scenes.checks import precise_field


def step_by_step(problem, masses, h, count):
    """Momenta, potentials and gradients along kick–drift–kick in the precision of mpmath, p before q in the state."""
    field, n = precise_field(problem), problem.dimension // 2
    energy = sympy.lambdify(problem.symbols, problem.hamiltonian, "mpmath", cse=True, dummify=True)
    q = [mpmath.mpf(x.p) / x.q for x in problem.start[n:]]
    p = [mpmath.mpf(x.p) / x.q for x in problem.start[:n]]

    def forces(q):
        y = [mpmath.mpf(0)] * n + q
        return [-x for x in field(y)[:n]], energy(*y)

    g, u = forces(q)
    states = [(p, u, g)]
    for _ in range(count):
        half = [x - h / 2 * y for x, y in zip(p, g, strict=True)]
        q = [x + h * y / m for x, y, m in zip(q, half, masses, strict=True)]
        g, u = forces(q)
        p = [x - h / 2 * y for x, y in zip(half, g, strict=True)]
        states.append((p, u, g))
    return states


def evaluated(formula: ShadowFormula, states, masses, h, n):
    """The shadow energy at state n, term by term as the docstring of `ShadowFormula` says."""

    def number(x: Fraction):
        return mpmath.mpf(x.numerator) / x.denominator

    def dot(a, b):
        return mpmath.fsum(x * y / m for x, y, m in zip(a, b, masses, strict=True))

    p, _, _ = states[n]
    value = dot(p, p) / 2
    for i in range(-formula.reach, formula.reach + 1):
        value += number(formula.potentials[abs(i)]) * states[n + i][1]
    for i, factor in enumerate(formula.works, 1):
        value += h * number(factor) * (dot(p, states[n + i][2]) - dot(p, states[n - i][2]))
    for (i, j), factor in formula.products.items():
        value += h * h * number(factor) * dot(states[n + i][2], states[n + j][2])
    return value
