"""Methods by name, with aliases, numbers of stages and parameters.

Files of this folder declare methods in METHODS; other distributions add theirs as entry points of `GROUP`.
"""

from __future__ import annotations

from functools import cache
from operator import attrgetter
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from bseries_base.errors import similar
from bseries_base.table import Column, Table, Tabular, listed
from integrators.core.catalogues import Register, spelling
from integrators.core.errors import IntegratorError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from integrators.methods.programs.program import Method

T = TypeVar("T")


TABLEAU_KINDS = ("explicit", "embedded pair", "diagonally implicit", "implicit", "partitioned", "implicit-explicit")
PROGRAM_KINDS = (
    *("continuous stage", "nystrom", "force gradient", "nystrom splitting", "splitting"),
    *("two-derivative", "additive", "exponential", "rosenbrock", "w-method"),
    "multistep",
)
KINDS = (*TABLEAU_KINDS, *PROGRAM_KINDS)
"""All kinds, in the order of the catalogue."""
GROUP = "bseries.methods"
"""The group of entry points by which other distributions add methods."""
METHOD_FIELDS = ("name", "kind", "stages", "order", "description", "aliases", "parameters", "reference")
"""The fields of an entry in JSON and CSV."""


class MethodEntry(NamedTuple):
    """A method or a family of methods before it is built.

    A sequence of entries is what another distribution names as an entry point ``bseries.methods``.

    Attributes:
        name: The name; a family's name is followed by its number of stages, or of steps.
        kind: One of `KINDS`.
        stages: The number of stages; None for a family, whose name is followed by this number.
        order: The order claimed by the source; for a family its formula, such as ``"2s-1"``.
        description, reference: One line about the method, and its source.
        build: Builds the method from ``name`` and ``reference``, and from ``stages`` (families) and the parameters.
        aliases: Other names of the method.
        parameters, options: The names of its free parameters, and of those with a customary value.
        least_stages: The smallest number of stages of a family.
        title: The name in titles, legends and captions, where it is another; a family's number of stages follows it.

    Example:
        >>> import bseries as bs
        >>> from functools import partial
        >>> build = partial(bs.RungeKutta, [[0, 0], ["2/3", 0]], ["1/4", "3/4"])
        >>> entry = bs.integrators.MethodEntry("mine", "explicit", 2, 2, "two stages, order 2", "K. Heun, 1900", build)
        >>> entry.is_tableau, entry.is_family, entry.build(name=entry.name, reference=entry.reference).c
        (True, False, (Fraction(0, 1), Fraction(2, 3)))
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
    title: str = ""

    @property
    def is_tableau(self) -> bool:
        """Whether the method is a `RungeKutta` or `PartitionedRungeKutta`."""
        return self.kind in TABLEAU_KINDS

    @property
    def counts(self) -> str:
        """What the number in the names of a family counts."""
        return "steps" if self.kind == "multistep" else "stages"

    @property
    def is_family(self) -> bool:
        """Whether the number of stages follows the name, as in ``gauss3``."""
        return self.stages is None

    def __repr__(self) -> str:
        return f"<MethodEntry: {self.name}, {self.kind}, {self.description}>"


def lower_rows(rows: Sequence[str], columns: int) -> list[list[str]]:
    """The rows of a lower triangular matrix, padded with zeros; entries are separated by spaces."""
    return [[*row.split(), *["0"] * (columns - len(row.split()))] for row in rows]


MAX_STAGES = 50
"""The cost grows with the cube of the number of stages, and exact numbers have hundreds of digits."""
_DIGITS = "0123456789"


class MethodCatalogue(Tabular, tuple["MethodEntry", ...]):
    """The entries of the catalogue, shown as a table."""

    __slots__ = ()

    def __repr__(self) -> str:
        return f"<MethodCatalogue: {len(self)} entries>"

    def to_table(self) -> Table:
        """Names, stages, orders and descriptions; records have sources too."""
        fields: dict[str, Callable[[MethodEntry], object]] = {field: attrgetter(field) for field in METHOD_FIELDS}
        fields |= {"name": _shown_name, "stages": lambda entry: entry.stages or "s"}
        methods = [{field: get(entry) for field, get in fields.items()} for entry in self]
        columns = (
            Column("name", get=_shown_name),
            Column("stages", True, _shown_stages),
            Column("order", True, lambda entry: entry.order),
            Column("description", get=_shown_description),
        )
        return Table(
            "Methods",
            columns,
            self,
            data=lambda: {"schema": 1, "kind": "methods", "methods": methods},
            items="methods",
            section=lambda entry: entry.kind.upper(),
            records=listed(fields.items(), self),
            titled=False,
        )


def _shown_name(entry: MethodEntry) -> str:
    return entry.name + "{s}" * entry.is_family


def _shown_stages(entry: MethodEntry) -> object:
    return entry.stages or (f"s ≥ {entry.least_stages}" if entry.least_stages > 1 else "s")


def _shown_description(entry: MethodEntry) -> str:
    lists = (("also", entry.aliases), ("parameters", entry.parameters))
    return "\n".join([entry.description, *(f"{what}: {', '.join(names)}" for what, names in lists if names)])


def catalogue() -> MethodCatalogue:
    """The catalogue: a tuple with an entry for each method and each family of methods, none of them built.

    Example:
        >>> import bseries as bs
        >>> [entry.name for entry in bs.catalogue() if entry.kind == "diagonally implicit"][:3]
        ['implicit-euler', 'implicit-midpoint', 'trapezoidal']
    """
    return MethodCatalogue(sorted(REGISTER.entries, key=lambda entry: KINDS.index(entry.kind)))


def _check_entry(entry: MethodEntry) -> None:
    if entry.kind not in KINDS:
        raise IntegratorError(f"kind of {entry.name} must be one of {', '.join(KINDS)}, but was {entry.kind!r:.60}")
    if not callable(entry.build):
        raise IntegratorError(f"build of {entry.name} must be a function, but was {entry.build!r:.60}")


REGISTER = Register(__package__ or "", "METHODS", GROUP, MethodEntry, _check_entry)


def method(name: str, /, **parameters: object) -> Method:
    """Build a method of the catalogue.

    Args:
        name: Its name or an alias; case, ``-`` and ``_`` do not matter. A family's name is followed by the number of
            stages, as in ``gauss3``. An ambiguous name, such as ``midpoint``, is refused with a list of candidates.
        parameters: Values of its free parameters, each an int, a Fraction, a text such as ``"1/2 - sqrt(3)/6"`` or a
            SymPy expression. A parameter that is not given stays a symbol, or has its customary value.

    Raises:
        IntegratorError: The method, the number of stages or a parameter is unknown.

    Example:
        >>> import bseries as bs
        >>> bs.method("rk4").b
        (Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6))
        >>> bs.method("sdirk2", gamma="1/4").A == bs.method("Qin_Zhang").A
        True
    """
    entry, stages = _find(name)
    names = entry.parameters + entry.options
    unknown = [key for key in parameters if key not in names]
    if unknown:
        known = f"must be one of {', '.join(names)}" if names else "cannot be given, it has none"
        raise IntegratorError(f"parameters of {entry.name} {known}, but {unknown[0]!r:.60} was given")
    if entry.parameters or parameters:
        from integrators.exact.entries import read_entry

        # A free parameter that is not given is the symbol of its own name.
        given = dict(zip(entry.parameters, entry.parameters, strict=True)) | parameters
        values = {key: read_entry(value, key, names) for key, value in given.items()}
        return entry.build(name=entry.name, reference=entry.reference, **values)
    return _build(entry, stages)


def as_method(value: str | T) -> Method | T:
    """The method of a name, or the value itself: arguments are methods, series, or names of methods."""
    return method(value) if isinstance(value, str) else value


@cache
def _build(entry: MethodEntry, stages: int | None) -> Method:
    if stages is None:
        return entry.build(name=entry.name, reference=entry.reference)
    return entry.build(name=f"{entry.name}{stages}", reference=entry.reference, stages=stages)


def _find(name: str) -> tuple[MethodEntry, int | None]:
    """The entry of a name, and the number of stages after a family's name."""
    if not isinstance(name, str):
        raise IntegratorError(f"name must be the name of a method, but was {name!r:.60}")
    key = spelling(name)
    stem = key.rstrip(_DIGITS)
    index = REGISTER.index_with(key, stem)
    entry, _ = index.get(key, (None, ""))
    if entry is not None:
        if entry.is_family:
            raise IntegratorError(f"{entry.name} needs a number of {entry.counts}, for example {entry.name}3")
        return entry, None
    family, _ = index.get(stem, (None, ""))
    if family is None or not family.is_family:
        raise IntegratorError(_miss(name, key))
    digits = key[len(stem) :].lstrip("0") or "0"
    # The length is checked first, because int() raises a ValueError for thousands of digits.
    if len(digits) > len(str(MAX_STAGES)) or not family.least_stages <= int(digits) <= MAX_STAGES:
        raise IntegratorError(
            f"number of {family.counts} of {family.name} must be from {family.least_stages} to {MAX_STAGES}, "
            f"but was {digits:.60}"
        )
    return family, int(digits)


MULTISTEP = ("lsoda", "lsode", "vode", "cvode", "qndf", "ode113", "ode15s")
"""What other packages have and this catalogue has not: multistep methods that vary step and order."""


def _miss(name: str, key: str) -> str:
    """The error message for an unknown name; it suggests names that contain it, then names with similar spelling."""
    if key in MULTISTEP:
        return (
            "name must be a one-step method, radau-iia3 for stiff scenes, or have fixed steps as bdf3, but "
            f"{name} is a multistep method of variable order"
        )
    near: dict[str, str] = {}
    if 1 < len(key) <= 60:
        index = REGISTER.index
        found = [filed for filed in index if key in filed]
        found += similar(key, index)
        found += similar(key.rstrip(_DIGITS), index, 2, 0.75)
        for entry, alias in map(index.__getitem__, found):
            near.setdefault(entry.name, alias + "{s}" * entry.is_family)
    hint = f"; the nearest are {', '.join(list(near.values())[:4])}" if near else ""
    return f"name must be a method of the catalogue, but was {name!r:.60}{hint}"


RECOMMENDED = {
    "splitting": {4: "blanes-moan4", 6: "blanes-moan6", 8: "sofroniou-spaletta8", 10: "sofroniou-spaletta10"},
    "nystrom splitting": {4: "blanes-moan-rkn4", 6: "blanes-moan-rkn6", 8: "blanes-casas-rkn8"},
    "composition": {4: "suzuki4", 6: "sofroniou-spaletta6", 8: "sofroniou-spaletta8", 10: "sofroniou-spaletta10"},
}


def recommended(order: int, kind: str = "splitting") -> str:
    """The name of the method of the catalogue with the smallest effective error.

    The effective error is s ‖e‖^(1/p) for a method of order p with s stages (flows of the part with fewer flows). The
    leading errors e are the coefficients minus those of the exact flow, at all words in two letters or at all trees of
    a second-order equation. Methods of equal order and effective error are equally accurate for equal work. The errors
    for a given problem also depend on which part begins.

    Args:
        order: The order: 4, 6, 8, or 10.
        kind: ``"splitting"`` for two arbitrary parts, ``"nystrom splitting"`` for q'' = g(q), ``"composition"`` for the
            schemes of `symmetric_composition`.

    Raises:
        IntegratorError: The kind is unknown, or the catalogue has no such method of that order.

    Example:
        >>> import bseries as bs
        >>> bs.methods.recommended(6), bs.methods.recommended(6, "nystrom splitting")
        ('blanes-moan6', 'blanes-moan-rkn6')

    References:
        S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313–330, doi:10.1016/S0377-0427(01)00492-7.
    """
    if not isinstance(kind, str) or kind not in RECOMMENDED:
        raise IntegratorError(f"kind must be one of {', '.join(RECOMMENDED)}, but was {kind!r:.60}")
    names = RECOMMENDED[kind]
    if isinstance(order, bool) or not isinstance(order, int) or order not in names:
        raise IntegratorError(f"order must be one of {', '.join(map(str, names))}, but was {order!r:.60}")
    return names[order]
