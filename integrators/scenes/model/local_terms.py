"""Terms in few local variables, with numbers for parameters: the form that compiled code takes."""

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
"""An output that is the formula itself, not one of its derivatives."""


class Place(NamedTuple):
    """An entry of the state: offset + stride · (the site of this role in the row)."""

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
    """Where a term goes: sign · (the formula, or its derivative by a local variable) is added at a place."""

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
    """What a term adds at a place."""
    import sympy

    formula = term.formula
    if output.derivative != VALUE:
        formula = formula.diff(sympy.Symbol(f"x{output.derivative}"))
    return output.sign * formula


def check_numeric(terms: Iterable[LocalTerm]) -> None:
    """Refuse terms with parameters that are symbols.

    Raises:
        IntegratorError: There is one.
    """
    for term in terms:
        for symbol in sorted(map(str, term.formula.free_symbols)):
            if not LOCAL_NAME.fullmatch(symbol):
                raise IntegratorError(f"parameters.{symbol} must be a number in compiled code, but was a symbol")
