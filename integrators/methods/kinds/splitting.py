"""Splitting methods: compositions of exact flows of the parts of the field."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from operator import itemgetter
from typing import Unpack

from bseries_base.errors import shown
from bseries_base.numbers import number_text
from bseries_base.table import Column, Document, Table, as_text
from integrators.core.arguments import is_listed, items
from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry, digits_of, read_entry, sum_entries
from integrators.methods.programs.builder import (
    SECOND_ORDER,
    Labels,
    ProgramBuilder,
    ProgramMethod,
    in_color_order,
    read_parts,
)
from integrators.methods.programs.evaluations import LinearForm


class Splitting(ProgramMethod):
    """A splitting method for y' = f^a(y) + f^b(y) + …, with any number of parts.

    One step is φ^(part_s)_(c_s h) ∘ … ∘ φ^(part_1)_(c_1 h): the exact flows of the parts, the first one first.
    Neighbouring flows of the same part become one.

    Args:
        flows: pairs (part, coefficient), in the order in which they are applied.
        parts: the names of all parts, in the order of the colours 0, 1, …; by default p and q, then other parts in the
            order of their first occurrence.
        parameters: the symbols allowed in formulas.
        name, reference: the name in messages, and the source.
        digits: the number of correct significant digits of decimal coefficients; by default that of floats in single
            or half precision.

    Raises:
        IntegratorError: a pair is invalid, its part is not in `parts`, or its coefficient is not a number or formula.

    Example:
        >>> import bseries as bs
        >>> strang = bs.Splitting([("a", "1/2"), ("b", 1), ("a", "1/2")])
        >>> print(strang)
        custom
        <BLANKLINE>
        step  flow of  coefficient of h
        ────  ───────  ────────────────
           1  a        1/2
           2  b        1
           3  a        1/2

    References:
        R. I. McLachlan, G. R. W. Quispel, Acta Numerica 11 (2002) 341–434, doi:10.1017/S0962492902000053;
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.5.
    """

    flows: tuple[tuple[str, Entry], ...]

    def __init__(
        self, flows: Iterable[tuple[str, object]], *, parts: Sequence[str] | None = None,
        parameters: Iterable[str] = (), name: str | None = None, reference: str | None = None,
        digits: int | None = None,
    ) -> None:  # fmt: skip
        symbols = tuple(parameters)
        given = items(flows, "flows")
        digits = digits_of(*given) if digits is None else digits
        pairs = [_read_flow(flow, i, symbols) for i, flow in enumerate(given, 1)]
        names = read_parts(in_color_order(dict.fromkeys(part for part, _ in pairs)) if parts is None else parts)
        for part, _ in pairs:
            if part not in names:
                raise IntegratorError(f"flows must be of the parts {', '.join(names)}, but one was of {part!r:.60}")
        merged = [(part, sum_entries(x for _, x in group)) for part, group in groupby(pairs, key=itemgetter(0))]
        self._set({"flows": tuple(merged)}, parts=names, name=name, reference=reference, digits=digits)

    def to_table(self) -> Table:
        """The flows: their parts and coefficients."""
        rows = [(n, part, number_text(x, self.digits)) for n, (part, x) in enumerate(self.flows, 1)]
        columns = (Column("step", True), Column("flow of"), Column("coefficient of h"))
        return Table(self.name, columns, rows, self.remarks, data=self.to_dict)

    __str__ = as_text

    def to_dict(self) -> Document:
        """The method as plain data."""
        flows = [{"part": part, "coefficient": number_text(x, self.digits)} for part, x in self.flows]
        return {"schema": 1, "kind": "method", "name": self.name, "flows": flows}

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        y = builder.y
        for part, coefficient in self.flows:
            y = y + builder.flow(y, part, time=coefficient)
        return y


class NystromSplitting(Splitting):
    """A splitting method for q'' = g(q), as a system p' = g(q), q' = M⁻¹ p.

    Its flows are kicks, of the part p, and drifts, of the part q. As the drift D is linear and the kick K depends only
    on the positions, brackets such as [K, [K, [K, D]]] vanish. There are fewer order conditions than for a `Splitting`,
    so methods of the same order have fewer stages or smaller errors. For other fields, such as that of a Hamiltonian
    T(p) + U(q) with T not quadratic, the order may be lower.

    Args:
        flows: pairs (part, coefficient), in the order in which they are applied.
        parts: the names of the parts for momenta and positions.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: there are not two parts, or the flows are not those of a `Splitting`.

    Example:
        >>> import bseries as bs
        >>> method = bs.methods.NystromSplitting([("q", "1/2"), ("p", 1), ("q", "1/2")])
        >>> method.flows
        (('q', Fraction(1, 2)), ('p', Fraction(1, 1)), ('q', Fraction(1, 2)))
        >>> method.max_children
        ((0, None), (1, 0))

    References:
        R. I. McLachlan, G. R. W. Quispel, Acta Numerica 11 (2002) 341–434, doi:10.1017/S0962492902000053; S. Blanes,
        P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313–330, doi:10.1016/S0377-0427(01)00492-7.
    """

    def __init__(
        self, flows: Iterable[tuple[str, object]], *, parts: Sequence[str] = ("p", "q"), **labels: Unpack[Labels]
    ) -> None:  # fmt: skip
        super().__init__(flows, parts=read_parts(parts, count=2), **labels)

    max_children = SECOND_ORDER


def lie_trotter(parts: Sequence[str] = ("a", "b")) -> Splitting:
    """The Lie–Trotter splitting of order 1: one step of each part, in the order of their names `parts`.

    Example:
        >>> import bseries as bs
        >>> bs.methods.lie_trotter(["a", "b", "c"]).flows
        (('a', Fraction(1, 1)), ('b', Fraction(1, 1)), ('c', Fraction(1, 1)))

    References:
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, formula (II.5.1).
    """
    return Splitting([(part, 1) for part in read_parts(parts)], name="lie-trotter")


def strang(parts: Sequence[str] = ("a", "b")) -> Splitting:
    """The symmetric Strang splitting of order 2: half steps of the parts in the order of their names, then in reverse.

    Example:
        >>> import bseries as bs
        >>> print([(part, str(x)) for part, x in bs.methods.strang(["a", "b", "c"]).flows])
        [('a', '1/2'), ('b', '1/2'), ('c', '1'), ('b', '1/2'), ('a', '1/2')]

    References:
        G. Strang, SIAM J. Numer. Anal. 5 (1968) 506–517, doi:10.1137/0705041;
        Hairer, Lubich, Wanner, *Geometric Numerical Integration*, formula (II.5.3).
    """
    there = [(part, "1/2") for part in read_parts(parts)]
    return Splitting([*there, *there[::-1]], name="strang")


def _read_flow(flow: object, i: int, symbols: Sequence[str]) -> tuple[str, Entry]:
    if not is_listed(flow) or len(flow) != 2 or not isinstance(flow[0], str):
        raise IntegratorError(f"flows[{i}] must be a part and its coefficient, but was {shown(flow)}")
    return flow[0], read_entry(flow[1], f"flows[{i}]", symbols)
