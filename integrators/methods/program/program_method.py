"""What the kinds of methods that are no tableaux have in common: coefficients, and the program made from them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import check_digits, check_label
from integrators.core.errors import IntegratorError, shorten
from integrators.methods.program.program import Method, Program, ProgramBuilder

if TYPE_CHECKING:
    from integrators.methods.program.child_bounds import ChildBounds
    from integrators.methods.program.evaluations import LinearForm


class ProgramMethod(Method):
    """A method given by coefficients of its kind, and read through its `program`.

    A kind sets its coefficients with `_set` and says in `_lower` how a step is made of evaluations.
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
        check_label(name, "name")
        check_label(reference, "reference")
        check_digits(digits)
        self.__dict__.update(
            coefficients,
            names=tuple(parts) or ("",),
            name="custom" if name is None else name,
            reference=reference,
            digits=digits,
            _coefficients=tuple(coefficients.values()),
        )

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        """Record the evaluations of a step; the result is its end."""
        raise NotImplementedError

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.names, self.digits, *self.__dict__["_coefficients"]

    @property
    def _auxiliary(self) -> tuple[str, ...]:
        """Those of the parts that are no parts of the field."""
        return ()

    @cached_property
    def max_children(self) -> ChildBounds | None:
        """How often each part can be differentiated along each part, and in all; None without bound."""
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
    """The names of the parts of a field, checked.

    Args:
        parts: a sequence of different names.
        count: how many there must be; None: two or more.

    Returns:
        The names.

    Raises:
        IntegratorError: `parts` is no such sequence.
    """
    if isinstance(parts, str) or not isinstance(parts, Sequence):
        raise IntegratorError(f"parts must be a sequence of names, but was {shorten(repr(parts))}")
    if len(parts) != count if count is not None else len(parts) < 2:
        raise IntegratorError(f"parts must be {count or 'two or more'} names, but were {len(parts)}")
    ProgramBuilder(parts)  # refuses names that formulas and trees could not tell apart
    return tuple(parts)
