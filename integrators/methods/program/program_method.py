"""Base class of the methods other than tableaux, which are read through their programs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import check_digits, read_labels
from integrators.core.errors import IntegratorError, shown
from integrators.methods.program.program import Method, Program, ProgramBuilder

if TYPE_CHECKING:
    from integrators.methods.program.child_bounds import ChildBounds
    from integrators.methods.program.evaluations import LinearForm


class ProgramMethod(Method):
    """A method given by the coefficients of its kind.

    A kind sets its coefficients by `_set` and records the evaluations of a step in `_lower`.
    """

    def _set(
        self,
        coefficients: dict[str, Any],
        *,
        parts: Sequence[str] = (),
        name: str | None,
        reference: str | None,
        digits: int | None = None,
    ) -> None:
        labels = read_labels(name, reference)
        check_digits(digits)
        self.__dict__.update(
            coefficients,
            names=tuple(parts) or ("",),
            digits=digits,
            **labels,
            _coefficients=tuple(coefficients.values()),
        )

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        """Record the evaluations of a step and return its end."""
        raise NotImplementedError

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.names, self.digits, *self.__dict__["_coefficients"]

    @property
    def _auxiliary(self) -> tuple[str, ...]:
        """The parts that do not belong to the field."""
        return ()

    @cached_property
    def max_children(self) -> ChildBounds | None:
        """Bounds on derivatives of each part with respect to each part, and in all; None if unbounded."""
        return None

    @cached_property
    def program(self) -> Program:
        """The step as a program."""
        builder = ProgramBuilder(self.names if self.names != ("",) else (), auxiliary=self._auxiliary)
        end = self._lower(builder)
        labels = {"name": self.name, "reference": self.reference, "digits": self.digits}
        return builder.program(end, **labels, max_children=self.max_children)

    def __str__(self) -> str:
        return str(self.program)

    def __repr__(self) -> str:
        parts = ", ".join(filter(None, self.names))
        stages = f"{self.stages} stage{'s' * (self.stages != 1)}"
        return f"<{type(self).__name__} {self.name}: {', '.join(filter(None, (parts, stages)))}>"


def read_parts(parts: Any, *, count: int | None = None) -> tuple[str, ...]:
    """The names of the parts of a field, checked: `count` different names, or two or more if None."""
    if isinstance(parts, str) or not isinstance(parts, Sequence):
        raise IntegratorError(f"parts must be a sequence of names, but was {shown(parts)}")
    if len(parts) != count if count is not None else len(parts) < 2:
        raise IntegratorError(f"parts must be {count or 'two or more'} names, but were {len(parts)}")
    ProgramBuilder(parts)  # checks the names
    return tuple(parts)
