"""SciPy: methods as solvers for `solve_ivp`, and scenes as right-hand sides."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from foundation.extras import optional_module
from integrators.compile.black_boxes import failure, forget_failure
from integrators.compile.scene_source import compiled_scene
from integrators.core.errors import IntegratorError, shorten
from integrators.methods.catalogue.registry import as_method
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import numpy as np

    from integrators.bindings.scipy_pairs import PairSolver


def scipy_solver(method: RungeKutta | str) -> type[PairSolver]:
    """A solver class of SciPy from an embedded pair, for ``solve_ivp(…, method=scipy_solver(method))``.

    Steps are those of SciPy's own Runge–Kutta solvers, with the options of ``scipy.integrate.RK45``; the order of the
    estimated error comes from the tableau. The weights `b` advance the solution. States may be complex.

    Between steps the solution is continuously differentiable, and of order p − 1 for a method of order p ≤ 9 (p for
    p ≤ 3). An interpolated step needs one additional evaluation of the right-hand side with ``verner65``, four with
    ``dop853``, and none with the other pairs of the catalogue.

    Args:
        method: An explicit method with one or two rows of embedded weights, such as ``method("tsit5")``.

    Returns:
        A class, the same for equal methods of the same name. Its attribute ``method`` is the method.

    Raises:
        IntegratorError: The method has symbols, is implicit or inconsistent, or has no usable embedded weights.
        ImportError: SciPy is not installed.

    Example:
        >>> from scipy.integrate import solve_ivp
        >>> from integrators import method
        >>> tsit5 = scipy_solver(method("tsit5"))
        >>> found = solve_ivp(lambda t, y: -y, (0, 1), [1.0], method=tsit5, rtol=1e-8, atol=1e-10)
        >>> print(f"{found.y[0, -1]:.7f}", tsit5.order, tsit5.error_estimator_order)
        0.3678794 5 4

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, II.4.
    """
    optional_module("scipy.integrate", "scipy_solver")
    from integrators.bindings.scipy_pairs import solver_class

    found = as_method(method)
    if not isinstance(found, RungeKutta):
        raise IntegratorError(f"method must be a RungeKutta, but was {shorten(repr(found))}")
    return solver_class(found, found.name)


def right_hand_side(scene: Scene | str) -> Callable[[float, np.ndarray[Any, Any]], np.ndarray[Any, Any]]:
    """The field of a scene as a compiled function f(t, y), for `solve_ivp` and other solvers.

    Args:
        scene: The scene; its parameters must be numbers. Scenes are autonomous: if the field depends on the time, the
            time is one of the variables, and the argument t is ignored.

    Returns:
        A function of the time and of a state, one real number for each variable, that returns a new array.

    Raises:
        IntegratorError: `scene` is not a scene, or a parameter is a symbol; when called: y is not such a state, or a
            compiled function of the scene raises an error.

    Example:
        >>> from scipy.integrate import solve_ivp
        >>> from integrators import method, scene
        >>> kepler = scene("kepler")
        >>> span = (0, 6.283185307179586)
        >>> found = solve_ivp(
        ...     right_hand_side(kepler), span, kepler.y0, method=scipy_solver(method("dop853")), rtol=1e-12, atol=1e-12
        ... )
        >>> bool(abs(found.y[:, -1] - kepler.y0).max() < 1e-9)
        True
    """
    scene = as_scene(scene)
    import numpy as np

    field, shape = compiled_scene(scene).field, (scene.dimension,)

    def fun(t: float, y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        if np.iscomplexobj(y):
            raise IntegratorError("y must be real, but was complex")
        state = np.ascontiguousarray(y, dtype=float)
        if state.shape != shape:
            raise IntegratorError(f"y must have the shape {shape}, but had {state.shape}")
        out = np.empty(shape)
        forget_failure()
        field(state, out)
        if (raised := failure()) is not None:
            raise raised
        return out

    return fun
