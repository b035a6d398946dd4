"""Facts about methods with memory for the report of `check`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

from bseries.exceptions import SeriesError
from bseries_base.errors import shown
from integrators.core.errors import IntegratorError
from integrators.exact.expressions import format_number
from integrators.methods.catalogue.registry import as_method
from integrators.methods.kinds.memory import GeneralLinear, LinearMultistep, MethodWithMemory
from integrators.methods.programs.program import Method


def memory_properties(method: Method | str) -> dict[str, Any]:
    """Facts about a method with memory for the report of `check`, as JSON-ready data; those not decided are None.

    Args:
        method: A method with memory, or its name.

    Raises:
        SeriesError: `method` has no memory.

    Example:
        >>> import bseries as bs
        >>> facts = bs.analysis.memory_properties(bs.memory.bdf(2))
        >>> facts["error_constant"], facts["zero_stable"], facts["stability_angle"]
        ('-1/3', True, '90')
    """
    method = with_memory(method)
    asked: dict[str, Callable[[], object]] = {"zero_stable": lambda: cast(Any, method).zero_stable}
    found: dict[str, Any] = {}
    if isinstance(method, LinearMultistep):
        found = {"steps": method.steps, "error_constant": format_number(method.error_constant)}
        asked |= {
            "parasitic_modes": lambda: "; ".join(map(str, method.growth_parameters)) or "none",
            "a_stable": lambda: method.stability_angle == 90,
            "stability_angle": lambda: f"{method.stability_angle or 0:.12g}",
        }
    else:
        found = {"inputs": len(cast(GeneralLinear, method).V)}
    undecided = {}
    for name, ask in asked.items():
        try:
            found[name] = ask()
        except IntegratorError as error:
            found[name], undecided[name] = None, str(error)
    return found | {"undecided": undecided}


def with_memory(method: Method | str) -> MethodWithMemory:
    """The method of a name, or the method, which must have memory."""
    method = as_method(method)
    if not isinstance(method, MethodWithMemory):
        raise SeriesError(f"method must be a method with memory, such as memory.bdf(2), but was {shown(method)}")
    return method


def linear_multistep(method: Method | str) -> LinearMultistep:
    """The method of a name, or the method, which must be a linear multistep method."""
    method = as_method(method)
    if not isinstance(method, LinearMultistep):
        raise SeriesError(f"method must be a linear multistep method, such as memory.bdf(2), but was {shown(method)}")
    return method
