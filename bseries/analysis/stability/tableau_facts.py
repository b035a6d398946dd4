"""Linear stability and contractivity of a tableau, collected for reports."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from bseries.analysis.stability import contractivity, linear_stability
from bseries.analysis.stability.field_elements import has_exact_zero_test
from bseries.analysis.stability.rational_functions import StabilityFunction
from integrators.core.errors import IntegratorError
from integrators.exact.expressions import format_number
from integrators.methods.tableaux.runge_kutta import RungeKutta

MOST_STAGES = 30
"""Methods with more stages would take many seconds."""

OF_FUNCTION: dict[str, Callable[[StabilityFunction], Any]] = {
    "stability_function": str,
    "stability_at_infinity": lambda function: function.at_infinity,
    "linear_order": linear_stability.linear_order,
    "dispersion_order": linear_stability.dispersion_order,
    "dissipation_order": lambda R: math.inf if (order := linear_stability.dissipation_order(R)) is None else order,
    "i_stable": linear_stability.is_i_stable,
    "a_stable": linear_stability.is_a_stable,
    "l_stable": linear_stability.is_l_stable,
    "stability_angle": linear_stability.stability_angle,
    "real_stability_interval": linear_stability.real_stability_interval,
    "imaginary_stability_interval": linear_stability.imaginary_stability_interval,
    "linear_ssp_coefficient": contractivity.linear_ssp_coefficient,
}
OF_TABLEAU: dict[str, Callable[[RungeKutta], Any]] = {
    "algebraically_stable": contractivity.is_algebraically_stable,
    "ssp_coefficient": contractivity.ssp_coefficient,
}

SLOW_FORMULAS = ("dispersion_order", "dissipation_order")
"""Facts that take SymPy seconds for formulas with both roots and symbols."""


def tableau_properties(method: RungeKutta) -> dict[str, Any]:
    """Linear stability and contractivity of a tableau as JSON-ready data.

    Args:
        method: a Runge–Kutta method.

    Returns:
        The keys stability_function, stability_at_infinity, linear_order, dispersion_order, dissipation_order, i_stable,
        a_stable, l_stable, stability_angle, real_stability_interval, imaginary_stability_interval,
        linear_ssp_coefficient, algebraically_stable, ssp_coefficient and undecided. Orders are integers, answers are
        booleans, other numbers are text (``"inf"`` if infinite). Undecided values are None, with the reason in
        ``undecided``.

    Raises:
        IntegratorError: `method` is no `RungeKutta`.

    Example:
        >>> from integrators import method
        >>> facts = tableau_properties(method("lobatto-iiic3"))
        >>> facts["l_stable"], facts["algebraically_stable"], facts["linear_order"], facts["ssp_coefficient"]
        (True, True, 4, '0')
        >>> facts["undecided"]
        {'linear_ssp_coefficient': 'the stability function is no polynomial'}
    """
    undecided: dict[str, str] = {}
    if linear_stability.checked_method(method).stages > MOST_STAGES:
        names = (*OF_FUNCTION, *OF_TABLEAU)
        reason = f"more than {MOST_STAGES} stages would take long: ask for each fact by its own function"
        return dict.fromkeys(names) | {"undecided": dict.fromkeys(names, reason)}
    try:
        function = linear_stability.stability_function(method)
    except IntegratorError as error:
        found: dict[str, Any] = dict.fromkeys(OF_FUNCTION)
        undecided |= dict.fromkeys(OF_FUNCTION, str(error))
    else:
        if function.parameters and not all(map(has_exact_zero_test, (*function.p, *function.q))):
            undecided |= dict.fromkeys(SLOW_FORMULAS, "formulas with roots and symbols would take long")
        found = {name: None if name in undecided else _ready(ask(function)) for name, ask in OF_FUNCTION.items()}
    found |= {name: _ready(ask(method)) for name, ask in OF_TABLEAU.items()}
    for name, value in found.items():
        if value is None and name not in undecided:
            undecided[name] = _reason(name, found, method)
    return found | {"undecided": undecided}


def _ready(value: Any) -> Any:
    """A value for JSON: numbers other than integers as text."""
    return value if value is None or isinstance(value, bool | int | str) else format_number(value)


def _reason(name: str, found: Mapping[str, Any], method: RungeKutta) -> str:
    if name == "linear_ssp_coefficient" and found["stability_at_infinity"] != "inf":
        return "the stability function is no polynomial"
    if method.parameters:
        return f"depends on {', '.join(method.parameters)}"
    if method.precision:
        return "the digits of the tableau do not show it"
    return "the tableau has roots of too high a degree"
