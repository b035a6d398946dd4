"""Terms: a formula in a few local variables, and the sites it is summed over.

A field of many particles is the sum of a few formulas over particles, neighbours or pairs. What is said about a formula
once (its derivatives, its degree, its code) holds at every site, so nothing here grows with the number of particles.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from integrators.core.arguments import check_label
from integrators.core.errors import IntegratorError, shorten
from integrators.core.immutable import ImmutableValue
from integrators.scenes.model.blocks import ROLES, Block

if TYPE_CHECKING:
    import sympy

KINDS = {"single": 0, "each": 1, "chain": 2, "ring": 2, "pairs": 2}
"""How many sites a term of each kind looks at; ``single`` looks at variables, not at sites."""


class Sites(NamedTuple):
    """What a term is summed over: a kind, the number of sites there are, and for ``table`` the rows of sites.

    Sites count from 0 here, from 1 where users write them.
    """

    kind: str
    count: int = 1  # type: ignore[assignment]  # not the method of tuples
    table: tuple[tuple[int, ...], ...] = ()

    @property
    def roles(self) -> int:
        """How many sites a row has."""
        return len(self.table[0]) if self.kind == "table" else KINDS[self.kind]

    def rows(self) -> Iterator[tuple[int, ...]]:
        """The rows of sites, in the order in which compiled code takes them."""
        n = self.count
        if self.kind == "table":
            return iter(self.table)
        if self.kind == "pairs":
            return combinations(range(n), 2)
        if self.kind in ("chain", "ring"):
            return ((i, (i + 1) % n) for i in range(n if self.kind == "ring" else n - 1))
        return ((i,) for i in range(n))

    @property
    def size(self) -> int:
        """The number of rows."""
        n = self.count
        sizes = {"table": len(self.table), "pairs": n * (n - 1) // 2, "chain": n - 1}
        return sizes.get(self.kind, n)


class Term(ImmutableValue):
    """A part of a field or of a Hamiltonian: a formula summed over sites.

    Args:
        over: ``"single"`` (the formula uses the variables as they are called), ``"each"`` site, neighbours along a
            ``"chain"`` or a ``"ring"``, ``"pairs"`` of sites i < j, or a list of tuples of site numbers from 1. The
            formula then uses ``q_i`` (``qx_i``, ``qy_i`` in the plane), ``q_j``, …, and ``m_i`` for a parameter that
            has a value for each site.
        hamiltonian: The formula of a term of the Hamiltonian.
        field: Maps variables (``"p"``, or ``"p_i"`` over sites) to what is added to their derivatives.
        part: The part of the field that the term belongs to, for methods that treat parts differently.

    Raises:
        IntegratorError: Not exactly one of `hamiltonian` and `field` is given, or `over` is none of these.

    Example:
        >>> spring = Term(over="ring", hamiltonian="exp(q_i - q_j)")
        >>> drag = Term(over="each", field={"p_i": "-gamma*p_i"})
    """

    over: str | tuple[tuple[int, ...], ...]
    hamiltonian: Any
    field: tuple[tuple[str, Any], ...]
    part: str | None

    def __init__(
        self, *, over: Any = "single", hamiltonian: Any = None, field: Mapping[str, Any] | None = None,
        part: str | None = None,
    ):  # fmt: skip
        if (hamiltonian is None) == (field is None):
            given = "both" if field is not None else "neither"
            raise IntegratorError(f"a term must have either hamiltonian or field, but had {given}")
        if field is not None and not (isinstance(field, Mapping) and field):
            raise IntegratorError(f"field must map variables to formulas, but was {shorten(repr(field))}")
        check_label(part, "part")
        self.__dict__.update(
            over=_read_over(over),
            hamiltonian=hamiltonian,
            field=tuple((getattr(target, "name", target), formula) for target, formula in (field or {}).items()),
            part=part,
        )

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.over, self.hamiltonian, self.field, self.part

    def __repr__(self) -> str:
        content = self.hamiltonian if self.hamiltonian is not None else dict(self.field)
        return f"Term(over={self.over!r}, {content!r})"


def _read_over(over: Any) -> str | tuple[tuple[int, ...], ...]:
    over = over.tolist() if hasattr(over, "tolist") else over
    if isinstance(over, str) and over in KINDS:
        return over
    if isinstance(over, Sequence) and not isinstance(over, str) and over:
        rows = [tuple(row) if isinstance(row, Sequence) and not isinstance(row, str) else () for row in over]
        whole = all(type(site) is int and site >= 1 for row in rows for site in row)
        if whole and 1 <= len(rows[0]) <= len(ROLES) and all(len(row) == len(rows[0]) for row in rows):
            return tuple(tuple(site - 1 for site in row) for row in rows)
    raise IntegratorError(
        f"over must be one of {', '.join(KINDS)}, or rows of 1 to {len(ROLES)} site numbers from 1, "
        f"but was {shorten(repr(over))}"
    )


Key: TypeAlias = "tuple[str | None, Sites, str | None]"
"""Where a formula goes: target, sites and part of a `Summand`."""


class Summand(NamedTuple):
    """A term as a scene keeps it: one formula, and where it goes.

    Attributes:
        formula: In flat names, or in local names (``qx_i``) where `sites` is not single; parameters are symbols.
        target: The variable (or local name) to whose derivative it is added; None for a term of the Hamiltonian.
        sites: What it is summed over.
        part: The part of the field it belongs to, if any.
    """

    formula: sympy.Expr
    target: str | None
    sites: Sites
    part: str | None


def sorted_summands(formulas: Mapping[Key, sympy.Expr], blocks: Iterable[Block]) -> tuple[Summand, ...]:
    """Summands in an order of their own, which does not tell who declared them; nothing is added by a zero."""
    summands = [Summand(formula, *key) for key, formula in formulas.items() if key[0] is None or formula != 0]
    places = {}
    if any(summand.target is not None and summand.sites.kind == "single" for summand in summands):
        places = {name: block.offset + k for block in blocks for k, name in enumerate(block.variables)}

    def order(summand: Summand) -> tuple[Any, ...]:
        target = summand.target or ""
        return summand.part or "", summand.sites, places.get(target, -1), target

    return tuple(sorted(summands, key=order))
