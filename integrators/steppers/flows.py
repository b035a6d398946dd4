"""Flows of pieces of the field that feel what they move."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import IntegratorError

if TYPE_CHECKING:
    from .plan import Call
    from .source import StepperSource


def flow_lines(call: Call, target: str, writer: StepperSource) -> list[str]:
    """Statements for a call."""
    raise IntegratorError("method must not need flows yet")
