"""Simplified Newton iteration for slopes that depend on one another in stiff systems."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import IntegratorError

if TYPE_CHECKING:
    from .plan import Group
    from .source import StepperSource


def newton_lines(group: Group, writer: StepperSource) -> list[str]:
    """Statements for a group."""
    raise IntegratorError("solver must be fixed-point as yet")
