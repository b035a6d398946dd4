"""What the catalogue knows about a method before it is built."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

    from integrators.methods.program.program import Method


TABLEAU_KINDS = ("explicit", "embedded pair", "diagonally implicit", "implicit", "partitioned")
PROGRAM_KINDS = (
    *("additive", "continuous stage", "exponential", "force gradient", "nystrom", "nystrom splitting", "rosenbrock"),
    *("splitting", "two-derivative", "w-method"),
)


class MethodEntry(NamedTuple):
    """One method, or one family of methods, of the catalogue.

    Attributes:
        name: The name; a family's name is followed by its number of stages.
        kind: One of `TABLEAU_KINDS` or `PROGRAM_KINDS`.
        stages: Number of stages; None for a family, whose stages are given behind its name.
        order: The order claimed by the source; for a family its formula, such as ``"2s-1"``.
        description: What the method is, in one line.
        reference: Where it was published.
        build: Builds the method from ``name`` and ``reference``, and from ``stages`` (families) and the parameters.
        aliases: Other names that find it.
        parameters: Names of its free parameters.
        least_stages: The smallest number of stages a family has.
        options: Names of parameters that have a customary value, and need not be given.
    """

    name: str
    kind: str
    stages: int | None
    order: int | str
    description: str
    reference: str
    build: Callable[..., Method]
    aliases: tuple[str, ...] = ()
    parameters: tuple[str, ...] = ()
    least_stages: int = 1
    options: tuple[str, ...] = ()

    @property
    def is_tableau(self) -> bool:
        """Whether the method is a `RungeKutta` or `PartitionedRungeKutta`, and not of a kind of its own."""
        return self.kind in TABLEAU_KINDS

    @property
    def is_family(self) -> bool:
        """Whether the number of stages is given behind the name, as in ``gauss3``."""
        return self.stages is None
