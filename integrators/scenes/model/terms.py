"""Terms and effects, of which scenes are declared.

A term is a formula in a few local variables, summed over particles, neighbours or pairs ("sites"). Derivatives, degrees
and code of a formula are the same at every site, so their cost does not depend on the number of particles.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from itertools import combinations
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from bseries_base.errors import shorten, shown
from integrators.core.arguments import as_lists, check_label, is_listed, items
from integrators.core.errors import IntegratorError
from integrators.core.immutable import ImmutableValue
from integrators.scenes.model.blocks import ROLES, Block

if TYPE_CHECKING:
    import sympy


KINDS = {"single": 0, "each": 1, "chain": 2, "ring": 2, "pairs": 2}
"""The number of sites in a row for each kind of index set; ``single`` has variables instead of sites."""


class Sites(NamedTuple):
    """Index set of a sum: its kind, the total number of sites, and the rows of sites of a ``table``.

    Sites are numbered from 0 here, from 1 in user input.
    """

    kind: str
    count: int = 1  # type: ignore[assignment]  # not the method of tuples
    table: tuple[tuple[int, ...], ...] = ()

    @property
    def roles(self) -> int:
        """The number of sites in a row."""
        return len(self.table[0]) if self.kind == "table" else KINDS[self.kind]

    def rows(self) -> Iterator[tuple[int, ...]]:
        """The rows of sites, in the order of compiled code."""
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
        over: ``"single"`` (a formula in the names of variables), ``"each"`` site, neighbours along a ``"chain"`` or a
            ``"ring"``, ``"pairs"`` of sites i < j, or a list of tuples of site numbers from 1. Formulas over sites use
            ``q_i`` (``qx_i``, ``qy_i`` in the plane), ``q_j``, …, and ``m_i`` for a parameter with a value for each
            site.
        hamiltonian: The formula of a term of the Hamiltonian.
        field: Maps variables (``"p"``, or ``"p_i"`` over sites) to contributions to their derivatives.
        part: The part of the field to which the term belongs, for methods that treat parts differently.

    Raises:
        IntegratorError: Not exactly one of `hamiltonian` and `field` is given, or `over` is invalid.

    Example:
        >>> import bseries as bs
        >>> spring = bs.Term(over="ring", hamiltonian="exp(q_i - q_j)")
        >>> drag = bs.Term(over="each", field={"p_i": "-gamma*p_i"})
    """

    over: str | tuple[tuple[int, ...], ...]
    hamiltonian: object
    field: tuple[tuple[str, object], ...]
    part: str | None

    def __init__(
        self, *, over: object = "single", hamiltonian: object = None, field: Mapping[str, object] | None = None,
        part: str | None = None,
    ):  # fmt: skip
        if (hamiltonian is None) == (field is None):
            given = "both" if field is not None else "neither"
            raise IntegratorError(f"a term must have either hamiltonian or field, but had {given}")
        if field is not None and not (isinstance(field, Mapping) and field):
            raise IntegratorError(f"field must map variables to formulas, but was {shown(field)}")
        check_label(part, "part")
        self.__dict__.update(
            over=_read_over(over),
            hamiltonian=hamiltonian,
            field=tuple((getattr(target, "name", target), formula) for target, formula in (field or {}).items()),
            part=part,
        )

    @property
    def _data(self) -> tuple[object, ...]:
        return self.over, self.hamiltonian, self.field, self.part

    def __repr__(self) -> str:
        content = self.hamiltonian if self.hamiltonian is not None else dict(self.field)
        return f"Term(over={self.over!r}, {content!r})"


def _read_over(over: object) -> str | tuple[tuple[int, ...], ...]:
    over = as_lists(over)
    if isinstance(over, str) and over in KINDS:
        return over
    if is_listed(over) and over:
        rows = [tuple(row) if is_listed(row) else () for row in over]
        whole = all(type(site) is int and site >= 1 for row in rows for site in row)
        if whole and 1 <= len(rows[0]) <= len(ROLES) and all(len(row) == len(rows[0]) for row in rows):
            return tuple(tuple(site - 1 for site in row) for row in rows)
    raise IntegratorError(
        f"over must be one of {', '.join(KINDS)}, or rows of 1 to {len(ROLES)} site numbers from 1, "
        f"but was {shown(over)}"
    )


Key: TypeAlias = "tuple[str | None, Sites, str | None]"
"""The target, sites and part of a `Summand`."""


class Summand(NamedTuple):
    """One formula of a term, with the derivative to which it contributes."""

    formula: sympy.Expr  # in flat names, or in local names (``qx_i``) if `sites` is not single; parameters are symbols
    # the variable (or local name) whose derivative it contributes to; None for a term of the Hamiltonian
    target: str | None
    sites: Sites  # the index set of the sum
    part: str | None  # the part of the field to which it belongs, if any


def sorted_summands(formulas: Mapping[Key, sympy.Expr], blocks: Iterable[Block]) -> tuple[Summand, ...]:
    """Nonzero summands in a canonical order, independent of the order of declaration."""
    summands = [Summand(formula, *key) for key, formula in formulas.items() if key[0] is None or formula != 0]
    places = {}
    if any(summand.target is not None and summand.sites.kind == "single" for summand in summands):
        places = {name: block.offset + k for block in blocks for k, name in enumerate(block.variables)}

    def order(summand: Summand) -> tuple[object, ...]:
        target = summand.target or ""
        return summand.part or "", summand.sites, places.get(target, -1), target

    return tuple(sorted(summands, key=order))


class Effect(ImmutableValue):
    """An effect of a scene: terms with their own variables and parameters.

    An effect that is off does not appear in formulas or code.

    Args:
        hamiltonian, field, terms: What it adds, as for `Scene`.
        variables, parameters: Its own, as for `Scene`; no other effect may have any of these names.
        start: Start values of its own variables, or of the time.
        breaks: The names of the first integrals of the base system that it destroys.
        summary: One line about the effect.

    Raises:
        IntegratorError: It adds nothing, or an argument has the wrong type.

    Example:
        >>> import bseries as bs
        >>> damping = bs.Effect(field={"p": "-gamma*p"}, parameters={"gamma": "1/10"}, summary="linear friction")
    """

    def __init__(
        self, *, hamiltonian: object = None, field: Mapping[str, object] | None = None, terms: Iterable[Term] = (),
        variables: Mapping[str, object] | None = None, parameters: Mapping[str, object] | None = None,
        start: Mapping[str, object] | None = None, breaks: Iterable[str] = (), summary: str | None = None,
    ):  # fmt: skip
        mappings = {"field": field, "variables": variables, "parameters": parameters, "start": start}
        for name, value in mappings.items():
            if value is not None and not isinstance(value, Mapping):
                raise IntegratorError(f"{name} of an effect must be a mapping, but was {shown(value)}")
            self.__dict__[name] = MappingProxyType({key: _immutable(entry) for key, entry in (value or {}).items()})
        check_label(summary, "summary of an effect", lines=True)
        terms, breaks = tuple(items(terms, "terms of an effect")), tuple(items(breaks, "breaks"))
        self.__dict__.update(hamiltonian=hamiltonian, terms=terms, breaks=breaks, summary=summary)
        if hamiltonian is None and not field and not terms:
            raise IntegratorError("an effect must have a hamiltonian, a field or terms, but had none")

    hamiltonian: object
    field: Mapping[str, object]
    terms: tuple[Term, ...]
    variables: Mapping[str, object]
    parameters: Mapping[str, object]
    start: Mapping[str, object]
    breaks: tuple[str, ...]
    summary: str | None

    @property
    def arguments(self) -> dict[str, object]:
        """The arguments of the constructor."""
        mappings = {name: dict(self.__dict__[name]) for name in ("field", "variables", "parameters", "start")}
        return {**mappings, **{name: self.__dict__[name] for name in ("hamiltonian", "terms", "breaks", "summary")}}

    @property
    def _data(self) -> tuple[object, ...]:
        return tuple(tuple(x.items()) if isinstance(x, dict) else x for x in self.arguments.values())

    def __reduce__(self) -> tuple[object, ...]:
        return partial(Effect, **self.arguments), ()  # mapping proxies cannot be pickled

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.arguments.items() if value not in (None, (), {}))
        return f"Effect({given})"


def _immutable(value: object) -> object:
    """A number, or a list or array as nested tuples."""
    value = as_lists(value)
    return tuple(map(_immutable, value)) if isinstance(value, list | tuple) else value


def numbered(parameters: Mapping[str, object]) -> dict[str, sympy.Expr]:
    """The values of site parameters under the names m1, m2, …"""
    return {
        f"{name}{k}": entry
        for name, value in parameters.items()
        if isinstance(value, tuple)
        for k, entry in enumerate(value, 1)
    }


def check_effects(effects: Any) -> dict[str, Effect]:
    """The effects of a scene by name, checked."""
    known = isinstance(effects, Mapping) and all(isinstance(name, str) and name for name in effects)
    if not known or not all(isinstance(effect, Effect) for effect in effects.values()):
        raise IntegratorError(f"effects must map names to Effects, but was {shown(effects)}")
    return dict(effects)


def check_active(active: object, effects: Mapping[str, object]) -> tuple[str, ...]:
    """The names of the active effects, in the order of declaration."""
    names = [active] if isinstance(active, str) else items(active, "effects")
    for name in names:
        if not isinstance(name, str) or name not in effects:
            hint = "there are none; effects that change the variables are chosen by scene(name, effects=[…])"
            those = f"the effects are {shorten(', '.join(effects))}" if effects else hint
            raise IntegratorError(f"there is no effect {name!r:.60}; {those}")
    return tuple(name for name in effects if name in names)
