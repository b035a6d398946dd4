"""System of ordinary differential equations in the form of sums over sites, and its local form.

In the local form, terms are formulas in few local variables with numbers for parameters, the input of code generation.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from integrators.core.errors import IntegratorError
from integrators.core.immutable import ImmutableValue
from integrators.scenes.model.blocks import Block, canonical_blocks
from integrators.scenes.model.formulas import as_float
from integrators.scenes.model.terms import Sites, Summand, numbered

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from integrators.scenes.model.black_boxes import BlackBox


LOCAL_NAME = re.compile("[xd][0-9]+")
VALUE = -1
"""Marks an output that is the formula itself, not one of its derivatives."""


class Place(NamedTuple):
    """Index into the state: offset + stride · row[role], for a row of sites."""

    role: int
    offset: int
    stride: int

    def at(self, row: Sequence[int]) -> int:
        """The index in the state, for a row of sites."""
        return self.offset + self.stride * row[self.role]


class Argument(NamedTuple):
    """A local variable: y[plus], or y[plus] − y[minus]."""

    plus: Place
    minus: Place | None


class Output(NamedTuple):
    """A contribution to the field: sign · (the formula or its derivative by a local variable), added at a place."""

    derivative: int
    place: Place
    sign: int


class Data(NamedTuple):
    """A parameter with a value for each site."""

    role: int
    values: tuple[sympy.Expr, ...]


class LocalTerm(NamedTuple):
    """One formula, its local variables x0, x1, … and data d0, d1, …, its outputs and its sites."""

    formula: sympy.Expr
    arguments: tuple[Argument, ...]
    data: tuple[Data, ...]
    outputs: tuple[Output, ...]
    sites: Sites
    part: str | None

    def data_at(self, row: Sequence[int]) -> dict[sympy.Symbol, sympy.Expr]:
        """The values of d0, d1, … at a row of sites."""
        import sympy

        return {sympy.Symbol(f"d{k}"): data.values[row[data.role]] for k, data in enumerate(self.data)}


def output_formula(term: LocalTerm, output: Output) -> sympy.Expr:
    """The formula that an output adds to the field."""
    import sympy

    formula = term.formula
    if output.derivative != VALUE:
        formula = formula.diff(sympy.Symbol(f"x{output.derivative}"))
    return output.sign * formula


class System(ImmutableValue):
    """A system y' = f(y), given as summands over index sets."""

    name: str  # the name in messages
    blocks: tuple[Block, ...]
    # their values: a number, a tuple with a number for each site, or a symbol
    parameters: Mapping[str, sympy.Expr | tuple[sympy.Expr, ...]]
    # the matrix of a Poisson structure; None for the canonical structure
    poisson: tuple[tuple[sympy.Expr, ...], ...] | None
    invariants: Mapping[str, sympy.Expr]  # first integrals by name
    positive: tuple[sympy.Expr, ...]  # formulas that are positive wherever the field is defined
    start: tuple[sympy.Expr, ...] | None  # exact start values, or None
    summands: tuple[Summand, ...]  # the formulas of the field, or of the Hamiltonian
    base_summands: tuple[Summand, ...]  # the summands without effects
    notes: tuple[str, ...]  # transformations applied to the declared system

    @cached_property
    def variables(self) -> tuple[str, ...]:
        """The names of all variables, in the order of the state."""
        return tuple(variable for block in self.blocks for variable in block.variables)

    @cached_property
    def places(self) -> Mapping[str, int]:
        """The index of each variable in the state."""
        return MappingProxyType({name: k for k, name in enumerate(self.variables)})

    @property
    def dimension(self) -> int:
        """The number of variables."""
        return self.blocks[-1].end

    @property
    def canonical_pair(self) -> tuple[Block, Block] | None:
        """The blocks of momenta and positions, if these are the whole state of a canonical system."""
        pair = canonical_blocks(self.blocks) if self.poisson is None else None
        return pair if pair is not None and 2 * pair[0].dimension == self.dimension else None

    @cached_property
    def symbols(self) -> tuple[sympy.Symbol, ...]:
        """The variables as SymPy symbols."""
        import sympy

        return tuple(map(sympy.Symbol, self.variables))

    @cached_property
    def parameter_values(self) -> Mapping[str, sympy.Expr]:
        """The values of parameters by their names in flat formulas: m1, m2, … for a parameter with a value per site."""
        scalars = {name: value for name, value in self.parameters.items() if not isinstance(value, tuple)}
        return MappingProxyType(scalars | numbered(self.parameters))

    @property
    def is_hamiltonian(self) -> bool:
        """Whether a Hamiltonian that does not depend on time generates the whole field."""
        return bool(self.summands) and all(summand.target is None for summand in self.summands)

    @cached_property
    def black_boxes(self) -> tuple[BlackBox, ...]:
        """The compiled functions in the field."""
        from integrators.scenes.model.black_boxes import Entry

        entries = (entry for summand in self.summands for entry in summand.formula.atoms(Entry))
        return tuple(dict.fromkeys(entry.args[0] for entry in entries))

    @cached_property
    def local_terms(self) -> tuple[LocalTerm, ...]:
        """The field as terms in few local variables; parameters that are symbols stay in the formulas."""
        raise NotImplementedError

    @cached_property
    def numeric_terms(self) -> tuple[LocalTerm, ...]:
        """The local terms, checked to have numbers for parameters: the input of code generation."""
        for term in self.local_terms:
            for symbol in sorted(map(str, term.formula.free_symbols)):
                if not LOCAL_NAME.fullmatch(symbol):
                    raise IntegratorError(f"parameters.{symbol} must be a number in compiled code, but was a symbol")
        return self.local_terms

    @property
    def y0(self) -> np.ndarray:
        """The start values as doubles; an `IntegratorError` if there are none."""
        return self._y0.copy()

    @cached_property
    def _y0(self) -> np.ndarray:
        if self.start is None:
            raise IntegratorError(f"start must be given for {self.name}, but was not")
        import numpy as np

        return np.array([as_float(value) for value in self.start])

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """The names of the parts of the field, sorted."""
        return tuple(sorted({summand.part for summand in self.summands if summand.part is not None}))
