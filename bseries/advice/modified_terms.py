"""The first terms of the modified equation of a method on a scene, in floating-point numbers and quickly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from bseries.advice.growth import goes_on
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
"""How many terms are looked at to find the first that is not zero."""
TERMS = 3
"""How many powers of h are taken from the first on, at least: a symmetric method has two of them."""
FARTHEST = 9
"""Up to so many nodes it is looked whether the structure that the first terms have is that of the method."""
POINTS, SHIFT, SYMMETRIC = 5, 2.0**-16, 1e-5
"""At how many points derivatives are taken, by what differences relative to a state, and how symmetric they must be."""
SPEEDS = 256
"""At so many states it is seen how fast variables change."""
NOISE = 1e-11
"""Coefficients below that are zeros of methods that are given in decimals or floats."""


class ModifiedTerms(NamedTuple):
    """f_{p+1}, f_{p+2}, … of the modified equation y' = f(y) + h^p f_{p+1}(y) + h^{p+1} f_{p+2}(y) + …

    Attributes:
        field: The truncated modified equation.
        powers: The powers of h whose terms need not vanish; p is the first.
    """

    field: SceneSeries
    powers: tuple[int, ...]

    def values(self, y: np.ndarray) -> np.ndarray:
        """The terms at many points (variables, n), without powers of h: an array (powers, variables, n)."""
        return self.field.terms(y)[list(self.powers)]

    def is_hamiltonian(self, y: np.ndarray, powers: Sequence[int]) -> bool:
        """Whether terms are Hamiltonian on the scene, seen from their derivatives at some states of a solution.

        They are if B^(−1) f_{k+1} is a gradient, B being the structure of the scene: its derivative H is symmetric.
        Variables may differ in size by many powers of ten, hence each has a shift of its own; with these in a diagonal
        matrix D it is D H D whose entries can be compared.

        Args:
            y: The states, (variables, n).
            powers: Which terms.

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
                if k in powers and not differs <= SYMMETRIC * size:  # nor where they are not finite
                    return False
        return True

    def sizes(self, y: np.ndarray) -> np.ndarray:
        """How large variables get along a solution; of those that stay 0, their block, or all.

        Those that go on, such as angles, get as large as time allows: it is how far they go while others change.

        Args:
            y: The states, (variables, n).
        """
        import numpy as np

        some = y[:, np.linspace(0, y.shape[1] - 1, min(SPEEDS, y.shape[1])).astype(int)]
        sizes, speeds = np.abs(y).max(axis=1), np.abs(self.field.terms(some)[0]).max(axis=1)
        on = np.array([goes_on(row) for row in y])
        changing = ~on & (speeds > 0)
        pace = (sizes[changing] / speeds[changing]).min(initial=np.inf)
        sizes[on] = np.fmin(sizes[on], pace * speeds[on])
        floors = np.full(len(sizes), sizes.max() or 1.0)
        for block in self.field.scene.blocks:
            own = slice(block.offset, block.end)
            floors[own] = sizes[own].max() or floors[own]
        return np.where(sizes > 0, sizes, floors)


def modified_terms(method: Method, scene: Scene, parts: Any = None) -> ModifiedTerms:
    """The first terms of a modified equation that do not vanish.

    Args:
        method: The method.
        scene: The scene.
        parts: As for `modified_field`.

    Raises:
        SeriesError: The method's parts are not clear, it does not follow y' = f(y) at all, or its order is too high for
            terms to be had.

    Example:
        >>> import bseries as bs
        >>> [modified_terms(bs.method(name), bs.scene("kepler")).powers for name in ("rk4", "gauss2", "yoshida6")]
        [(4, 5, 6), (4, 6), (6, 8)]
    """
    exact = _is_rational(method)
    plain = method if exact else in_floats(method)
    for order in ORDERS:
        field = modified_field(plain, scene, order, parts=parts)
        _check_consistent(field, method)
        powers = _powers(field, exact)
        if powers or not _has_trees(field, order):
            wanted = _enough(plain, powers[0]) if powers else order
            if wanted != order:
                field = modified_field(plain, scene, wanted, parts=parts)
                powers = _powers(field, exact)
            return ModifiedTerms(field, powers)
    raise SeriesError(f"method must have an order below {ORDERS[-1]} for terms of its modified equation, but has not")


def numeric_inverse_structure(scene: Scene) -> Callable[[np.ndarray], np.ndarray] | None:
    """B^(−1) of a Hamiltonian scene y' = B(y) ∇H(y), as a function of the state; None where there is none.

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
    """A method with all its numbers rounded to doubles: series of decimals are slow, since their digits are counted."""
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
    """The order up to which terms tell of what structure they are.

    A pseudo-symplectic method is symplectic in the first terms and not in a later one, and what it conserves drifts by
    that one only; so it is taken, too, and one more that tells how good it is. So it is for methods that are symmetric
    in the first terms only. Methods of several parts are not looked at: their trees are too
    many, and those known are made from flows or from the steps of a method, which are symplectic as a whole or not.

    References:
        A. Aubry, P. Chartier, Pseudo-symplectic Runge–Kutta methods, BIT 38 (1998) 439–461, doi:10.1007/BF02510253.
    """
    order = first + TERMS
    if order >= FARTHEST or len(method.names) > 1:
        return order
    checks = (symplecticity, "is_symplectic"), (symmetry, "is_symmetric")  # which tableaux may tell at once
    breaks = [check(method, FARTHEST) for check, known in checks if not getattr(method, known, False)]
    return max([order, *(found.order + 2 for found in breaks if order <= found.order < FARTHEST)])


def _is_rational(method: Method) -> bool:
    """Whether the series of a method is computed in whole numbers."""
    return getattr(method, "algebra", None) is not None or (method.domain == "QQ" and method.digits is None)


def _powers(field: SceneSeries, exact: bool) -> tuple[int, ...]:
    """The powers of h, from 1 on, with coefficients that are not zero."""
    values, table = field.weights, field.trees.table
    least = 0.0 if exact else NOISE
    return tuple(n - 1 for n in range(2, field.order + 1) if any(abs(values[at]) > least for at in table.ids(n)))


def _has_trees(field: SceneSeries, order: int) -> bool:
    """Whether the scene has differentials of an order at all."""
    return len(field.trees.table.ids(order)) > 0
