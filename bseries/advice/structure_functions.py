"""The structure B of a Hamiltonian scene y' = B(y) ∇H(y), and ∇H, as functions of states."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from ..evaluation import modified_field

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

    from integrators import Scene


def inverse_structure(scene: Scene) -> Callable[[np.ndarray], np.ndarray] | None:
    """B^(−1) of a Hamiltonian scene y' = B(y) ∇H(y), as a function of the state; None where there is none.

    Example:
        >>> import bseries as bs, numpy as np
        >>> f = bs.modified_field(bs.method("rk4"), bs.scene("lotka-volterra"), 1)
        >>> y = np.array([2.0, 3.0])
        >>> (inverse_structure(f.scene)(y) @ f(y, 0.1)).round(12).tolist()  # ∇H = (1 − 1/p, 1 − 2/q)
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


@lru_cache(maxsize=16)
def gradient(scene: Scene) -> Any:
    """A function that gives ∇H at many points (variables, n); None if the energy is not conserved.

    Example:
        >>> import bseries as bs, numpy as np
        >>> gradient(bs.scene("pendulum"))(np.array([[1.0], [0.0]])).ravel().tolist()
        [1.0, 0.0]
    """
    import numpy as np

    if not scene.is_hamiltonian:
        return None
    from integrators import method

    inverse = inverse_structure(scene) if scene.canonical_pair is not None else None
    if inverse is not None:
        field, matrix = modified_field(method("explicit-euler"), scene, 1), inverse(np.zeros(scene.dimension))
        return lambda y: matrix @ field.terms(y)[0]
    import sympy

    formula: Any = scene.hamiltonian
    values: Any = list(scene.parameter_values.items())
    gradients = [sympy.diff(formula.subs(values), x) for x in scene.symbols]
    function = sympy.lambdify([scene.symbols], gradients, "numpy", cse=True)
    return lambda y: np.array([np.broadcast_to(row, y.shape[1:]) for row in function(y)])
