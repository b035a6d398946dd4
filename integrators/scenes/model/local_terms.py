"""Local form of terms: formulas in few local variables with numbers for parameters, the input of code generation."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from integrators.core.errors import IntegratorError
from integrators.scenes.model.terms import Sites

if TYPE_CHECKING:
    import sympy

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


def output_formula(term: LocalTerm, output: Output) -> sympy.Expr:
    """The formula that an output adds to the field."""
    import sympy

    formula = term.formula
    if output.derivative != VALUE:
        formula = formula.diff(sympy.Symbol(f"x{output.derivative}"))
    return output.sign * formula


def check_numeric(terms: Iterable[LocalTerm]) -> None:
    """Refuse terms with symbolic parameters."""
    for term in terms:
        for symbol in sorted(map(str, term.formula.free_symbols)):
            if not LOCAL_NAME.fullmatch(symbol):
                raise IntegratorError(f"parameters.{symbol} must be a number in compiled code, but was a symbol")
