"""Derivatives of the field along vectors."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import IntegratorError

if TYPE_CHECKING:
    from .plan import Call
    from .source import StepperSource


def derivative_lines(call: Call, target: str, writer: StepperSource) -> list[str]:
    """Statements for a call."""
    raise IntegratorError("method must not need derivatives yet")
