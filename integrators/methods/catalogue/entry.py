"""Catalogue entry of a method."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from integrators.methods.program.program import Method


TABLEAU_KINDS = ("explicit", "embedded pair", "diagonally implicit", "implicit", "partitioned")
PROGRAM_KINDS = (
    *("continuous stage", "nystrom", "force gradient", "nystrom splitting", "splitting"),
    *("two-derivative", "additive", "exponential", "rosenbrock", "w-method"),
)
KINDS = (*TABLEAU_KINDS, *PROGRAM_KINDS)
"""All kinds, in the order of the catalogue."""


class MethodEntry(NamedTuple):
    """A method or a family of methods before it is built.

    Attributes:
        name: The name; a family's name is followed by its number of stages.
        kind: One of `KINDS`.
        stages: The number of stages; None for a family, whose name is followed by this number.
        order: The order claimed by the source; for a family its formula, such as ``"2s-1"``.
        description: One line about the method.
        reference: The source.
        build: Builds the method from ``name`` and ``reference``, and from ``stages`` (families) and the parameters.
        aliases: Other names of the method.
        parameters: Names of its free parameters.
        least_stages: The smallest number of stages of a family.
        options: Names of parameters with a customary value.
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
        """Whether the method is a `RungeKutta` or `PartitionedRungeKutta`."""
        return self.kind in TABLEAU_KINDS

    @property
    def is_family(self) -> bool:
        """Whether the number of stages follows the name, as in ``gauss3``."""
        return self.stages is None


def lower_rows(rows: Sequence[str], columns: int) -> list[list[str]]:
    """The rows of a lower triangular matrix, padded with zeros; entries are separated by spaces."""
    return [[*row.split(), *["0"] * (columns - len(row.split()))] for row in rows]
