"""The first terms of the modified equation of a method on a scene, in floating-point arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import sympy

from bseries.exceptions import SeriesError
from bseries.fields.modified_fields import SceneSeries, modified_field
from bseries.fields.modified_invariants import structure_matrix
from integrators.methods.programs.evaluations import Flow
from integrators.methods.programs.program import Method, Program, mapped
from integrators.scenes.scene import Scene

ORDERS = 4, 7, 9, 11, 13
"""Orders tried for the first nonzero term: one beyond 3, 6, 8, 10 and 12, so that few methods need two trials."""
TERMS = 3
"""Powers of h from the first on: the fewest of which two are nonzero for a symmetric method."""
SHIFT, SYMMETRIC = 2.0**-16, 1e-5
"""Relative differences for derivatives: about the cube root of the unit roundoff, which leaves errors of about its
square; the tolerance for symmetry is far above these and far below the asymmetry of other terms."""
POINTS = 5
"""Number of states whose derivatives are checked, at different places of the orbit."""
NOISE = 1e-11
"""Smaller coefficients of methods with decimals or floats are 0: decimals have 16 digits, and sums lose some."""


class ModifiedTerms(NamedTuple):
    """f_{p+1}, f_{p+2}, … of the modified equation y' = f(y) + h^p f_{p+1}(y) + h^{p+1} f_{p+2}(y) + …"""

    field: SceneSeries  # the truncated modified equation
    powers: tuple[int, ...]  # the powers of h of these terms, starting with p

    def values(self, y: np.ndarray) -> np.ndarray:
        """The terms at many points (variables, n), without powers of h: (powers, variables, n)."""
        return self.field.terms(y)[list(self.powers)]

    def is_hamiltonian(self, y: np.ndarray) -> bool:
        """Whether all terms are Hamiltonian on the scene, by their derivatives at some states of a solution.

        They are if B^(−1) f_{k+1} is a gradient, B being the structure of the scene: if its derivative H is symmetric.
        Since variables may differ in size by many powers of ten, each has its own shift; with the shifts in a diagonal
        matrix D the entries of D H D are comparable.

        Example:
            >>> import bseries as bs, numpy as np
            >>> states = np.random.default_rng(1).normal(size=(2, 100))
            >>> for name in "rk4", "gauss2":
            ...     print(modified_terms(bs.method(name), bs.scene("pendulum")).is_hamiltonian(states))
            False
            True
        """
        inverse = inverse_structure(self.field.scene)
        if inverse is None:
            return False
        some = y[:, np.linspace(0, y.shape[1] - 1, POINTS + 1).astype(int)[1:]]
        shifts = SHIFT * self.moves(some)
        for point in some.T:
            shift = np.diag(shifts)
            around = np.hstack([point[:, None] + shift, point[:, None] - shift])
            forms = np.einsum("nij,kjn->kin", np.array([inverse(x) for x in around.T]), self.values(around))
            hessians = shifts[:, None] * (forms[:, :, : len(point)] - forms[:, :, len(point) :])
            differs = abs(hessians - hessians.transpose(0, 2, 1)).max(axis=(1, 2))
            if not (differs <= SYMMETRIC * abs(hessians).max(axis=(1, 2))).all():  # false for nan
                return False
        return True

    def moves(self, y: np.ndarray) -> np.ndarray:
        """The distance of each variable in the time in which the first one moves by its size; sizes for those at rest.

        An angle may be as large as the number of its rotations, which is unrelated to the scale of f.
        """
        sizes, speeds = np.abs(y).max(axis=1), np.abs(self.field.terms(y)[0]).max(axis=1)
        on, moves = (speeds > 0) & (sizes > 0), sizes.copy()
        if on.any():
            moves[on] = (sizes[on] / speeds[on]).min() * speeds[on]
        for block in self.field.scene.blocks:
            own = slice(block.offset, block.end)
            moves[own][moves[own] == 0] = moves[own].max()
        moves[moves == 0] = sizes.max() or 1.0
        return moves


def modified_terms(method: Method, scene: Scene, parts: Any = None, *, order: int = 0) -> ModifiedTerms:
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

    def change(evaluation: Any) -> Any:
        changed = mapped(evaluation, lambda form: form.map(float))
        return changed._replace(time=float(changed.time)) if isinstance(changed, Flow) else changed

    return Program(
        [change(evaluation) for evaluation in program.evaluations],
        program.result.map(float),
        parts=program.names,
        auxiliary=program.auxiliary,
        name=program.name,
        max_children=program.max_children,
    )


def _powers(field: SceneSeries, exact: bool) -> tuple[int, ...]:
    """The powers of h, from 1 on, with nonzero coefficients."""
    values, table = field.weights, field.trees.table
    least = 0.0 if exact else NOISE
    return tuple(n - 1 for n in range(2, field.order + 1) if any(abs(values[at]) > least for at in table.ids(n)))


def inverse_structure(scene: Scene) -> Callable[[np.ndarray], np.ndarray] | None:
    """B^(−1) of a Hamiltonian scene y' = B(y) ∇H(y), as a function of the state; None if there is none.

    Example:
        >>> import bseries as bs, numpy as np
        >>> f = bs.modified_field(bs.method("rk4"), bs.scene("lotka-volterra"), 1)
        >>> y = np.array([2.0, 3.0])
        >>> (inverse_structure(f.scene)(y) @ f(y, 0.1)).round(12).tolist()  # ∇H = (1 − 1/p, 1 − 2/q)
        [0.5, 0.333333333333]
    """
    if not scene.is_hamiltonian or (scene.canonical_pair is None and scene.poisson is None):
        return None
    structure = structure_matrix(scene)
    if scene.poisson is None:
        fixed = -np.array(structure, float)
        return lambda y: fixed
    matrix: Any = sympy.Matrix(structure)
    if matrix.det().equals(0):
        return None
    function = sympy.lambdify([scene.symbols], matrix, "numpy", cse=True)
    return lambda y: np.linalg.inv(np.array(function(y), float))


@lru_cache(maxsize=16)
def gradient(scene: Scene) -> Any:
    """∇H as a function of many points (variables, n); None if the energy is not conserved.

    Example:
        >>> import bseries as bs, numpy as np
        >>> gradient(bs.scene("pendulum"))(np.array([[1.0], [0.0]])).ravel().tolist()
        [1.0, 0.0]
    """
    if not scene.is_hamiltonian:
        return None
    from integrators import method

    inverse = inverse_structure(scene) if scene.canonical_pair is not None else None
    if inverse is not None:
        field, matrix = modified_field(method("explicit-euler"), scene, 1), inverse(np.zeros(scene.dimension))
        return lambda y: matrix @ field.terms(y)[0]
    formula: Any = scene.hamiltonian
    values: Any = list(scene.parameter_values.items())
    gradients = [sympy.diff(formula.subs(values), x) for x in scene.symbols]
    function = sympy.lambdify([scene.symbols], gradients, "numpy", cse=True)
    return lambda y: np.array([np.broadcast_to(row, y.shape[1:]) for row in function(y)])
