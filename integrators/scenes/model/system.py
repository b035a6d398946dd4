"""System: the differential equation of a scene with the effects that are on."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING

from integrators.core.immutable import ImmutableValue
from integrators.scenes.model.blocks import Block, canonical_blocks
from integrators.scenes.model.declarations import numbered
from integrators.scenes.model.local_terms import LocalTerm, check_numeric
from integrators.scenes.model.terms import Summand

if TYPE_CHECKING:
    import sympy


class System(ImmutableValue):
    """A system y' = f(y) of summands over index sets.

    Attributes:
        name: What messages call it.
        blocks: How the state is cut into pieces.
        parameters: Their values: a number, a tuple with one for each site, or a symbol.
        summands: The formulas of the field, or of the Hamiltonian.
        base_summands: Those without effects.
        poisson: The matrix of a Poisson structure; None for the canonical one.
        invariants: Formulas of first integrals by name.
        positive: Formulas that are positive wherever the field is defined.
        start: Exact start values, if there are some.
        notes: What has been done to the system that was declared, if anything.
    """

    name: str
    blocks: tuple[Block, ...]
    parameters: Mapping[str, sympy.Expr | tuple[sympy.Expr, ...]]
    poisson: tuple[tuple[sympy.Expr, ...], ...] | None
    invariants: Mapping[str, sympy.Expr]
    positive: tuple[sympy.Expr, ...]
    start: tuple[sympy.Expr, ...] | None
    summands: tuple[Summand, ...]
    base_summands: tuple[Summand, ...]
    notes: tuple[str, ...]

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """The names of all variables, in the order of the state."""
        return tuple(variable for block in self.blocks for variable in block.variables)

    @cached_property
    def places(self) -> Mapping[str, int]:
        """Where each variable stands in the state."""
        return MappingProxyType({name: k for k, name in enumerate(self.variables)})

    @property
    def dimension(self) -> int:
        """The number of variables."""
        return self.blocks[-1].end

    @property
    def canonical_pair(self) -> tuple[Block, Block] | None:
        """Momenta and positions, where these are the whole state and their structure is the canonical one."""
        pair = canonical_blocks(self.blocks) if self.poisson is None else None
        return pair if pair is not None and 2 * pair[0].dimension == self.dimension else None

    @cached_property
    def symbols(self) -> tuple[sympy.Symbol, ...]:
        """The variables as SymPy symbols."""
        import sympy

        return tuple(map(sympy.Symbol, self.variables))

    @cached_property
    def parameter_values(self) -> Mapping[str, sympy.Expr]:
        """The values of parameters by the names in flat formulas: m1, m2, … where there is one for each site."""
        scalars = {name: value for name, value in self.parameters.items() if not isinstance(value, tuple)}
        return MappingProxyType(scalars | numbered(self.parameters))

    @property
    def is_hamiltonian(self) -> bool:
        """Whether the whole field comes from a Hamiltonian that does not depend on time."""
        return bool(self.summands) and all(summand.target is None for summand in self.summands)

    @property
    def local_terms(self) -> tuple[LocalTerm, ...]:
        """The field as terms in few local variables; parameters that are symbols stay in the formulas."""
        raise NotImplementedError

    @cached_property
    def numeric_terms(self) -> tuple[LocalTerm, ...]:
        """The local terms, the form that compiled code takes.

        Raises:
            IntegratorError: A parameter is a symbol.
        """
        check_numeric(self.local_terms)
        return self.local_terms

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """The names of the parts of the field, sorted."""
        return tuple(sorted({summand.part for summand in self.summands if summand.part is not None}))
