"""The first terms of the modified equation of a method on a scene, in floating-point arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.growth import is_unbounded
from bseries.analysis.structure import symmetry, symplecticity
from bseries.exceptions import SeriesError
from bseries.fields.modified_fields import modified_field
from integrators.methods.program.evaluations import Flow
from integrators.methods.program.transformations import mapped

if TYPE_CHECKING:
    import numpy as np

    from bseries.fields.modified_fields import SceneSeries
    from integrators import Program, Scene
    from integrators.methods.program.program import Method

ORDERS = 4, 7, 9, 11, 13
"""Orders tried for the first nonzero term."""
TERMS = 3
"""Least number of powers of h from the first on; a symmetric method has two of them nonzero."""
FARTHEST = 9
"""Largest order at which the structure of the method is checked."""
POINTS, SHIFT, SYMMETRIC = 5, 2.0**-16, 1e-5
"""Number of points for derivatives, relative differences, and the tolerance for symmetry."""
SPEEDS = 256
"""Number of states for the speeds of variables."""
NOISE = 1e-11
"""Smaller coefficients of methods with decimals or floats are 0."""


class ModifiedTerms(NamedTuple):
    """f_{p+1}, f_{p+2}, … of the modified equation y' = f(y) + h^p f_{p+1}(y) + h^{p+1} f_{p+2}(y) + …

    Attributes:
        field: The truncated modified equation.
        powers: The powers of h of these terms, starting with p.
    """

    field: SceneSeries
    powers: tuple[int, ...]

    def values(self, y: np.ndarray) -> np.ndarray:
        """The terms at many points (variables, n), without powers of h: (powers, variables, n)."""
        return self.field.terms(y)[list(self.powers)]

    def is_hamiltonian(self, y: np.ndarray, powers: Sequence[int]) -> bool:
        """Whether terms are Hamiltonian on the scene, by their derivatives at some states of a solution.

        They are if B^(−1) f_{k+1} is a gradient, B being the structure of the scene: if its derivative H is symmetric.
        Since variables may differ in size by many powers of ten, each has its own shift; with the shifts in a diagonal
        matrix D the entries of D H D are comparable.

        Example:
            >>> import bseries as bs, numpy as np
            >>> states = np.random.default_rng(1).normal(size=(2, 100))
            >>> for name in "rk4", "gauss2":
            ...     terms = modified_terms(bs.method(name), bs.scene("pendulum"))
            ...     print(terms.is_hamiltonian(states, terms.powers))
            False
            True
        """
        import numpy as np

        inverse = numeric_inverse_structure(self.field.scene)
        if inverse is None:
            return False
        shifts = SHIFT * self.sizes(y)
        for point in y[:, np.linspace(0, y.shape[1] - 1, POINTS + 1).astype(int)[1:]].T:
            shift = np.diag(shifts)
            around = np.hstack([point[:, None] + shift, point[:, None] - shift])
            forms = np.einsum("nij,kjn->kin", np.array([inverse(x) for x in around.T]), self.values(around))
            hessians = shifts[:, None] * (forms[:, :, : len(point)] - forms[:, :, len(point) :])
            for k, hessian in zip(self.powers, hessians, strict=True):
                differs, size = (abs(matrix).max() for matrix in (hessian - hessian.T, hessian))
                if k in powers and not differs <= SYMMETRIC * size:  # false for nan
                    return False
        return True

    def sizes(self, y: np.ndarray) -> np.ndarray:
        """Sizes of variables along a solution (variables, n).

        A variable that stays 0 has the size of its block, or of the whole state; an unbounded one, such as an angle,
        the distance that it moves while others change.
        """
        import numpy as np

        some = y[:, np.linspace(0, y.shape[1] - 1, min(SPEEDS, y.shape[1])).astype(int)]
        sizes, speeds = np.abs(y).max(axis=1), np.abs(self.field.terms(some)[0]).max(axis=1)
        on = np.array([is_unbounded(row) for row in y])
        changing = ~on & (speeds > 0)
        pace = (sizes[changing] / speeds[changing]).min(initial=np.inf)
        sizes[on] = np.fmin(sizes[on], pace * speeds[on])
        floors = np.full(len(sizes), sizes.max() or 1.0)
        for block in self.field.scene.blocks:
            own = slice(block.offset, block.end)
            floors[own] = sizes[own].max() or floors[own]
        return np.where(sizes > 0, sizes, floors)


def modified_terms(method: Method, scene: Scene, parts: Any = None) -> ModifiedTerms:
    """The first nonzero terms of the modified equation.

    Args:
        method: The method.
        scene: The scene.
        parts: As for `modified_field`.

    Raises:
        SeriesError: The assignment of parts is ambiguous, the method is not consistent, or its order is too high.

    Example:
        >>> import bseries as bs
        >>> [modified_terms(bs.method(name), bs.scene("kepler")).powers for name in ("rk4", "gauss2", "yoshida6")]
        [(4, 5, 6), (4, 6), (6, 8)]
    """
    exact = getattr(method, "algebra", None) is not None or (method.domain == "QQ" and method.digits is None)
    plain = method if exact else in_floats(method)
    for order in ORDERS:
        field = modified_field(plain, scene, order, parts=parts)
        _check_consistent(field, method)
        powers = _powers(field, exact)
        if powers or not len(field.trees.table.ids(order)):
            wanted = _enough(plain, powers[0]) if powers else order
            if wanted != order:
                field = modified_field(plain, scene, wanted, parts=parts)
                powers = _powers(field, exact)
            return ModifiedTerms(field, powers)
    raise SeriesError(f"method must have an order below {ORDERS[-1]} for terms of its modified equation, but has not")


def numeric_inverse_structure(scene: Scene) -> Callable[[np.ndarray], np.ndarray] | None:
    """B^(−1) of a Hamiltonian scene y' = B(y) ∇H(y), as a function of the state; None if there is none.

    Example:
        >>> import bseries as bs, numpy as np
        >>> f = bs.modified_field(bs.method("rk4"), bs.scene("lotka-volterra"), 1)
        >>> y = np.array([2.0, 3.0])
        >>> (numeric_inverse_structure(f.scene)(y) @ f(y, 0.1)).round(12).tolist()  # ∇H = (1 − 1/p, 1 − 2/q)
        [0.5, 0.333333333333]
    """
    import numpy as np

    if not scene.is_hamiltonian:
        return None
    if scene.canonical_pair is not None:
        p, q = scene.canonical_pair
        fixed = np.zeros((scene.dimension, scene.dimension))
        fixed[p.offset : p.end, q.offset : q.end] = np.eye(p.dimension)
        fixed[q.offset : q.end, p.offset : p.end] = -np.eye(p.dimension)
        return lambda y: fixed
    import sympy

    if scene.poisson is None:
        return None
    matrix: Any = sympy.Matrix(scene.poisson).subs(list(scene.parameter_values.items()))
    if matrix.det().equals(0):
        return None
    function = sympy.lambdify([scene.symbols], matrix, "numpy", cse=True)
    return lambda y: np.linalg.inv(np.array(function(y), float))


def in_floats(method: Method) -> Program:
    """A method with its numbers rounded to doubles: series of decimals are slow."""
    from integrators import Program

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


def _check_consistent(field: SceneSeries, method: Method) -> None:
    for tree in field.trees.table.ids(1):
        found = field.weights[tree]
        if abs(found - 1) > NOISE:
            name = method.name or "it"
            raise SeriesError(f"method must be consistent, but {name} follows {float(found):.3g} times the field")


def _enough(method: Method, first: int) -> int:
    """The order up to which terms show the structure of a method.

    A pseudo-symplectic method has Hamiltonian terms up to a later one, which causes the drift of conserved quantities:
    that one is included, and one more to assess it; likewise for methods that are symmetric in the first terms only.
    Methods of several parts are not checked: they have too many trees, and the known ones are made from flows or from
    the steps of a method, which are symplectic as a whole or not.

    References:
        A. Aubry, P. Chartier, Pseudo-symplectic Runge–Kutta methods, BIT 38 (1998) 439–461, doi:10.1007/BF02510253.
    """
    order = first + TERMS
    if order >= FARTHEST or len(method.names) > 1:
        return order
    checks = (symplecticity, "is_symplectic"), (symmetry, "is_symmetric")  # some tableaux know their structure
    breaks = [check(method, FARTHEST) for check, known in checks if not getattr(method, known, False)]
    return max([order, *(found.order + 2 for found in breaks if order <= found.order < FARTHEST)])


def _powers(field: SceneSeries, exact: bool) -> tuple[int, ...]:
    """The powers of h, from 1 on, with nonzero coefficients."""
    values, table = field.weights, field.trees.table
    least = 0.0 if exact else NOISE
    return tuple(n - 1 for n in range(2, field.order + 1) if any(abs(values[at]) > least for at in table.ids(n)))
