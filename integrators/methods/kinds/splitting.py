"""Splitting methods: exact flows of the parts of the field, one after another."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.entries import read_entry, sum_entries
from integrators.methods.program.program_method import ProgramMethod, read_parts
from integrators.methods.tableaux.tableau_input import in_color_order

if TYPE_CHECKING:
    from integrators.exact.entries import Entry
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import ProgramBuilder


class Splitting(ProgramMethod):
    """A splitting method for y' = f^a(y) + f^b(y) + …, with any number of parts.

    One step is φ^(part_s)_(c_s h) ∘ … ∘ φ^(part_1)_(c_1 h): the exact flows of the parts, the first one first.
    Neighbouring flows of the same part become one.

    Args:
        flows: pairs (part, coefficient), in the order in which they are applied.
        parts: the names of all parts, in the order of the colours 0, 1, …; by default p and q, others as they first
            appear.
        parameters: the symbols that formulas in text may use.
        name: what messages call the method.
        reference: where the method was published.
        digits: for coefficients published as decimals, how many significant digits are correct.

    Raises:
        IntegratorError: a pair is none, its part is not among `parts`, or its coefficient is no number or formula.

    Example:
        >>> strang = Splitting([("a", "1/2"), ("b", 1), ("a", "1/2")])
        >>> print(strang)
        k1 = z(1) - z(0), z' = 1/2 h f_a(z), z(0) = y
        k2 = z(1) - z(0), z' = h f_b(z), z(0) = y + k1
        k3 = z(1) - z(0), z' = 1/2 h f_a(z), z(0) = y + k1 + k2
        y1 = y + k1 + k2 + k3

    References:
        R. I. McLachlan, G. R. W. Quispel, Acta Numerica 11 (2002) 341–434, doi:10.1017/S0962492902000053;
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.5.
    """

    flows: tuple[tuple[str, Entry], ...]

    def __init__(
        self,
        flows: Iterable[tuple[str, Any]],
        *,
        parts: Sequence[str] | None = None,
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
        digits: int | None = None,
    ) -> None:
        symbols = tuple(parameters)
        pairs = [_read_flow(flow, i, symbols) for i, flow in enumerate(items(flows, "flows"), 1)]
        names = read_parts(in_color_order(dict.fromkeys(part for part, _ in pairs)) if parts is None else parts)
        for part, _ in pairs:
            if part not in names:
                raise IntegratorError(f"flows must be of the parts {', '.join(names)}, but one was of {part!r:.60}")
        merged = [(part, sum_entries(x for _, x in group)) for part, group in groupby(pairs, key=itemgetter(0))]
        self._set({"flows": tuple(merged)}, parts=names, name=name, reference=reference, digits=digits)

    @property
    def stages(self) -> int:
        """The number of flows."""
        return len(self.flows)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        y = builder.y
        for part, coefficient in self.flows:
            y = y + builder.flow(y, part, time=coefficient)
        return y


def lie_trotter(parts: Sequence[str] = ("a", "b")) -> Splitting:
    """The Lie–Trotter splitting: one step of every part, the first part first.

    Args:
        parts: the names of the parts.

    Returns:
        The method, of order 1.

    Example:
        >>> lie_trotter(["a", "b", "c"]).flows
        (('a', Fraction(1, 1)), ('b', Fraction(1, 1)), ('c', Fraction(1, 1)))

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, formula (II.5.1).
    """
    return Splitting([(part, 1) for part in read_parts(parts)], name="lie-trotter")


def strang(parts: Sequence[str] = ("a", "b")) -> Splitting:
    """The Strang splitting: half steps of the parts forwards, then backwards.

    Args:
        parts: the names of the parts.

    Returns:
        The method, symmetric and of order 2.

    Example:
        >>> print([(part, str(x)) for part, x in strang(["a", "b", "c"]).flows])
        [('a', '1/2'), ('b', '1/2'), ('c', '1'), ('b', '1/2'), ('a', '1/2')]

    References:
        G. Strang, SIAM J. Numer. Anal. 5 (1968) 506–517, doi:10.1137/0705041;
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, formula (II.5.3).
    """
    there = [(part, "1/2") for part in read_parts(parts)]
    return Splitting([*there, *there[::-1]], name="strang")


def _read_flow(flow: Any, i: int, symbols: Sequence[str]) -> tuple[str, Entry]:
    if isinstance(flow, str) or not isinstance(flow, Sequence) or len(flow) != 2 or not isinstance(flow[0], str):
        raise IntegratorError(f"flows[{i}] must be a part and its coefficient, but was {shorten(repr(flow))}")
    return flow[0], read_entry(flow[1], f"flows[{i}]", symbols)
