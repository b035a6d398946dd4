"""SciPy: methods as solvers for `solve_ivp`, scenes as right-hand sides, and methods from SciPy's solver classes.

SciPy keeps tableaux in doubles. A double is read as a fraction if it is the double nearest to one with a denominator of
at most `LARGEST_DENOMINATOR`, as three of 100,000 random doubles are. Fractions are used only if all entries are such,
and row sums and order conditions then hold exactly.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from math import isfinite
from typing import TYPE_CHECKING, Any

from foundation.extras import optional_module
from integrators.compile.scene_source import compiled_scene
from integrators.core.errors import IntegratorError, shorten
from integrators.methods.catalogue.registry import as_method
from integrators.methods.catalogue.registry import method as named_method
from integrators.methods.tableaux.elementary_weights import order_of_difference, order_of_weights
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import numpy as np

    from integrators.bindings.scipy_pairs import PairSolver

    Row = list[float]

LARGEST_DENOMINATOR = 10**6
DOUBLE_DIGITS = 16


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
        IntegratorError: `scene` is not a scene, or a parameter is a symbol; when called: y is not such a state.

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

    if not isinstance(scene, Scene):
        raise IntegratorError(f"scene must be a Scene, but was {shorten(repr(scene))}")
    field, shape = compiled_scene(scene).field, (scene.dimension,)

    def fun(t: float, y: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        if np.iscomplexobj(y):
            raise IntegratorError("y must be real, but was complex")
        state = np.ascontiguousarray(y, dtype=float)
        if state.shape != shape:
            raise IntegratorError(f"y must have the shape {shape}, but had {state.shape}")
        out = np.empty(shape)
        field(state, out)
        return out

    return fun


def from_scipy(solver: type) -> RungeKutta:
    """The Runge–Kutta method of a solver class of SciPy.

    Args:
        solver: ``RK23``, ``RK45``, ``DOP853`` or ``Radau`` of ``scipy.integrate``; a class with the attributes A, B, C,
            E, order and error_estimator_order of ``RK45``, where E is the embedded weights minus B; or a class from
            `scipy_solver`.

    Returns:
        The method with its embedded weights. It is exact if the fractions behind the doubles are certain, as for
        ``RK23`` and ``RK45``; else its entries are the shortest decimals of the doubles, with 16 digits. ``Radau`` is
        the exact ``radau-iia3``; its error estimate involves the Jacobian and is not a row of weights.

    Raises:
        IntegratorError: `solver` is not such a class.

    Example:
        >>> from scipy.integrate import DOP853, RK45
        >>> from integrators import method
        >>> from_scipy(RK45) == method("dormand-prince54")
        True
        >>> dop853 = from_scipy(DOP853)
        >>> dop853.domain, dop853.digits, float(dop853.b[0]), len(dop853.embedded)
        ('decimal', 16, 0.054293734116568765, 2)
    """
    known = getattr(solver, "method", None)
    if isinstance(known, RungeKutta):
        return known
    integrate = sys.modules.get("scipy.integrate")
    if integrate is not None and solver is integrate.Radau:
        radau: Any = named_method("radau-iia3")
        return radau
    A, b, c, differences, orders = _read(solver)

    def tableau(number: Callable[[float], Fraction], digits: int | None = None) -> RungeKutta:
        weights, *rows = [list(map(number, row)) for row in (b, *differences)]
        embedded = [[x + y for x, y in zip(weights, row, strict=True)] for row in rows]
        matrix, nodes = [list(map(number, row)) for row in A], list(map(number, c))
        return RungeKutta(matrix, weights, nodes, embedded=embedded, name=solver.__name__, digits=digits, warn=False)

    if all(float(_fraction(x)) == x for row in (*A, b, c, *differences) for x in row):
        exact = tableau(_fraction)
        if _is_confirmed(exact, *orders):
            return exact
    return tableau(lambda x: Fraction(Decimal(repr(x))), DOUBLE_DIGITS)


def _fraction(x: float) -> Fraction:
    """The nearest fraction with a small denominator."""
    return Fraction(x).limit_denominator(LARGEST_DENOMINATOR)


def _read(solver: Any) -> tuple[list[Row], Row, Row, list[Row], tuple[int, int]]:
    """A, b, c, the embedded weights minus the weights, and the orders of a class like ``RK45`` or ``DOP853``."""
    try:
        orders = int(solver.order), int(solver.error_estimator_order)
        A = [_doubles(row) for row in solver.A]
        b, c = _doubles(solver.B), _doubles(solver.C)
        if hasattr(solver, "E5"):
            differences = [[-x for x in _doubles(row)] for row in (solver.E5, solver.E3)]
        else:
            differences = [_doubles(solver.E)]
        if any(len(row) != len(b) + 1 for row in differences):
            raise ValueError
    except (AttributeError, TypeError, ValueError):
        name = getattr(solver, "__name__", repr(solver))
        raise IntegratorError(
            f"solver must be a Runge–Kutta class of SciPy, such as RK45, but was {shorten(name)}"
        ) from None
    if any(row[-1] for row in differences):  # the estimate uses the derivative at the end of the step
        A, b, c = [*A, b], [*b, 0.0], [*c, 1.0]
    stages = len(b)
    return [row + [0.0] * (stages - len(row)) for row in A], b, c, [row[:stages] for row in differences], orders


def _doubles(values: Any) -> Row:
    row = [float(x) for x in values]
    if not all(map(isfinite, row)):
        raise ValueError
    return row


def _is_confirmed(exact: RungeKutta, order: int, error_order: int) -> bool:
    """Whether the nodes are the row sums and the orders those that the class names, exactly."""
    import numpy as np

    A, b, embedded = (np.array(rows, dtype=object) for rows in (exact.A, exact.b, exact.embedded))
    return (
        exact.row_sums == exact.c
        and order_of_weights(A, b) == order
        and all(order_of_difference(A, row - b) == error_order for row in embedded)
    )
