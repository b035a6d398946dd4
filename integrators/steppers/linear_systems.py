"""Slopes that depend on one another linearly, as in Rosenbrock methods."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import IntegratorError

if TYPE_CHECKING:
    from .plan import Group
    from .source import StepperSource


def is_linear_system(group: Group) -> bool:
    """Whether the slopes of a group are derivatives along each other, at points that are known."""
    return all(call.node.kind == "derivative" for call in group.calls)


def linear_system_lines(group: Group, writer: StepperSource) -> list[str]:
    """Statements for a group."""
    raise IntegratorError("method must not need linear systems yet")
