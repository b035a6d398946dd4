"""Methods by name, with aliases, numbers of stages and parameters. Files of this folder declare methods in METHODS."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from integrators.core.catalogues import declared_entries, index_by_name, spelling
from integrators.core.errors import IntegratorError
from integrators.methods.catalogue.entry import KINDS, MethodEntry

if TYPE_CHECKING:
    from integrators.methods.program.program import Method

ENTRIES: tuple[MethodEntry, ...] = tuple(
    sorted(declared_entries(__package__ or "", "METHODS"), key=lambda entry: KINDS.index(entry.kind))
)
MAX_STAGES = 50
"""The cost grows with the cube of the number of stages, and exact numbers have hundreds of digits."""
_DIGITS = "0123456789"


def catalogue() -> tuple[MethodEntry, ...]:
    """List the catalogue.

    Returns:
        One entry for each method and each family of methods, none of them built.

    Example:
        >>> [entry.name for entry in catalogue() if entry.kind == "diagonally implicit"][:3]
        ['implicit-euler', 'implicit-midpoint', 'trapezoidal']
    """
    return ENTRIES


def method(name: str, /, **parameters: Any) -> Method:
    """Build a method of the catalogue.

    Args:
        name: Its name or an alias; case, ``-`` and ``_`` do not matter. A family's name is followed by the number of
            stages, as in ``gauss3``. An ambiguous name, such as ``midpoint``, is refused with a list of candidates.
        parameters: Values of its free parameters, each an int, a Fraction, a text such as ``"1/2 - sqrt(3)/6"`` or a
            SymPy expression. A parameter that is not given stays a symbol, or has its customary value.

    Returns:
        The method, with its source in ``reference``.

    Raises:
        IntegratorError: The method, the number of stages or a parameter is unknown.

    Example:
        >>> method("rk4").b
        (Fraction(1, 6), Fraction(1, 3), Fraction(1, 3), Fraction(1, 6))
        >>> method("sdirk2", gamma="1/4").A == method("Qin_Zhang").A
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


@cache
def _build(entry: MethodEntry, stages: int | None) -> Method:
    if stages is None:
        return entry.build(name=entry.name, reference=entry.reference)
    return entry.build(name=f"{entry.name}{stages}", reference=entry.reference, stages=stages)


@cache
def _index() -> dict[str, tuple[MethodEntry, str]]:
    return index_by_name(ENTRIES)


def _find(name: str) -> tuple[MethodEntry, int | None]:
    """The entry of a name, and the number of stages after a family's name."""
    if not isinstance(name, str):
        raise IntegratorError(f"name must be the name of a method, but was {name!r:.60}")
    key = spelling(name)
    entry, _ = _index().get(key, (None, ""))
    if entry is not None:
        if entry.is_family:
            raise IntegratorError(f"{entry.name} needs a number of stages, for example {entry.name}3")
        return entry, None
    stem = key.rstrip(_DIGITS)
    family, _ = _index().get(stem, (None, ""))
    if family is None or not family.is_family:
        raise IntegratorError(_miss(name, key))
    digits = key[len(stem) :].lstrip("0") or "0"
    # The length is checked first, because int() raises a ValueError for thousands of digits.
    if len(digits) > len(str(MAX_STAGES)) or not family.least_stages <= int(digits) <= MAX_STAGES:
        raise IntegratorError(
            f"number of stages of {family.name} must be from {family.least_stages} to {MAX_STAGES}, "
            f"but was {digits:.60}"
        )
    return family, int(digits)


def _miss(name: str, key: str) -> str:
    """The error message for an unknown name; it suggests names that contain it, then names with similar spelling."""
    from difflib import get_close_matches

    near: dict[str, str] = {}
    if 1 < len(key) <= 60:
        found = [filed for filed in _index() if key in filed]
        found += get_close_matches(key, _index(), n=3, cutoff=0.6)
        found += get_close_matches(key.rstrip(_DIGITS), _index(), n=2, cutoff=0.75)
        for entry, alias in map(_index().__getitem__, found):
            near.setdefault(entry.name, alias + "{s}" * entry.is_family)
    hint = f"; the nearest are {', '.join(list(near.values())[:4])}" if near else ""
    return f"name must be a method of the catalogue, but was {name!r:.60}{hint}"
