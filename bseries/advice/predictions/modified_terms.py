"""The first terms of the modified equation of a method on a scene, in floating-point arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np
import sympy

from bseries.exceptions import SeriesError
from bseries.fields.inputs import Formula
from bseries.fields.modified_fields import SceneSeries, modified_field
from bseries.fields.modified_invariants import structure_matrix
from integrators.exact.functions import as_function
from integrators.methods.programs.program import Method, Program, mapped
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene

Gradient: TypeAlias = Callable[[np.ndarray], np.ndarray]
"""∇H as a function of many points (variables, n)."""

ORDERS = 4, 7, 9, 11, 13
"""Orders tried for the first nonzero term: one beyond 3, 6, 8, 10 and 12, so that few methods need two trials."""
TERMS = 3
"""Powers of h from the first on: the fewest of which two are nonzero for a symmetric method."""
NOISE = 1e-11
"""Smaller coefficients of methods with decimals or floats are 0: decimals have 16 digits, and sums lose some."""


class ModifiedTerms(NamedTuple):
    """f_{p+1}, f_{p+2}, … of the modified equation y' = f(y) + h^p f_{p+1}(y) + h^{p+1} f_{p+2}(y) + …"""

    field: SceneSeries  # the truncated modified equation
    powers: tuple[int, ...]  # the powers of h of these terms, starting with p

    def values(self, y: np.ndarray) -> np.ndarray:
        """The terms at many points (variables, n), without powers of h: (powers, variables, n)."""
        return self.field.terms(y)[list(self.powers)]

    def moves(self, y: np.ndarray) -> np.ndarray:
        """The distance of each variable in the time in which the first one moves by its size; sizes for those at rest.

        An angle may be as large as the number of its rotations, which is unrelated to the scale of f.
        """
        sizes, speeds = np.abs(y).max(axis=1), np.abs(self.field.terms(y)[0]).max(axis=1)
        on = (speeds > 0) & (sizes > 0)
        moves = np.where(on, (sizes[on] / speeds[on]).min(initial=np.inf) * speeds, sizes)
        for block in self.field.scene.blocks:
            own = slice(block.offset, block.end)
            moves[own][moves[own] == 0] = moves[own].max()
        moves[moves == 0] = sizes.max() or 1.0
        return moves


def modified_terms(method: Method, scene: Scene, parts: Parts | None = None, *, order: int = 0) -> ModifiedTerms:
    """The terms of the modified equation at the first power of h with any, and at two more, or at more up to `order`.

    Example:
        >>> import bseries as bs
        >>> [modified_terms(bs.method(name), bs.scene("kepler")).powers for name in ("rk4", "gauss2", "yoshida6")]
        [(4, 5, 6), (4, 6), (6, 8)]
    """
    exact = getattr(method, "algebra", None) is not None or (method.domain == "QQ" and method.digits is None)
    plain = method if exact else in_floats(method)
    for trial in ORDERS:
        field = modified_field(plain, scene, trial, parts=parts)
        for tree in field.trees.table.ids(1):
            if abs((found := field.weights[tree]) - 1) > NOISE:
                name = method.name or "it"
                raise SeriesError(f"method must be consistent, but {name} follows {float(found):.3g} times the field")
        powers = _powers(field, exact)
        if powers or not len(field.trees.table.ids(trial)):
            wanted = max(order, powers[0] + TERMS) if powers else trial
            if wanted != trial:
                field = modified_field(plain, scene, wanted, parts=parts)
                powers = _powers(field, exact)
            return ModifiedTerms(field, powers)
    raise SeriesError(f"method must have an order below {ORDERS[-1]} for terms of its modified equation, but has not")


def in_floats(method: Method) -> Program:
    """A method with its numbers rounded to doubles, since series of decimals are slow."""
    program = method.program
    evaluations = [mapped(evaluation, lambda form: form.map(float), float) for evaluation in program.evaluations]
    return program.changed(evaluations=evaluations, result=program.result.map(float), digits=None)


def _powers(field: SceneSeries, exact: bool) -> tuple[int, ...]:
    """The powers of h, from 1 on, with nonzero coefficients."""
    values, table = field.weights, field.trees.table
    least = 0.0 if exact else NOISE
    return tuple(n - 1 for n in range(2, field.order + 1) if any(abs(values[at]) > least for at in table.ids(n)))


@lru_cache(maxsize=16)
def gradient(scene: Scene) -> Gradient | None:
    """∇H as a function of many points (variables, n); None if the energy is not conserved."""
    if not scene.is_hamiltonian:
        return None
    from integrators import method

    if scene.canonical_pair is not None and scene.poisson is None:
        field, matrix = modified_field(method("explicit-euler"), scene, 1), -np.array(structure_matrix(scene), float)
        return lambda y: matrix @ field.terms(y)[0]  # ∇H = J^(−1) f
    formula: Formula = scene.hamiltonian
    values = list(scene.parameter_values.items())
    gradients = [sympy.diff(formula.subs(values), x) for x in scene.symbols]
    function = as_function(scene.symbols, gradients, "numpy")
    return lambda y: np.array([np.broadcast_to(row, y.shape[1:]) for row in function(*y)])
