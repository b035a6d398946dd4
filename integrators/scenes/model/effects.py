"""Effects: what a scene can have besides its base system, each switched on by its name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

from integrators.core.arguments import check_label, items
from integrators.core.errors import IntegratorError, shorten
from integrators.core.immutable import ImmutableValue
from integrators.scenes.model.terms import Term


class Effect(ImmutableValue):
    """One effect of a scene: terms, with the variables and parameters that they bring along.

    What an effect brings exists only while it is on: an effect that is off leaves no trace in formulas or code.

    Args:
        hamiltonian: A formula to add to the Hamiltonian.
        field: Maps variables to formulas to add to their derivatives.
        terms: Terms over sites.
        variables: Blocks of variables of its own, as for `Scene`.
        parameters: Its parameters and their values. No other effect may have parameters or variables of these names.
        start: Start values of its own variables, or of the time.
        breaks: The names of the first integrals of the base system that it destroys.
        summary: What it is, in one line.

    Raises:
        IntegratorError: It adds nothing, or an argument is none of its kind.

    Example:
        >>> damping = Effect(field={"p": "-gamma*p"}, parameters={"gamma": "1/10"}, summary="linear friction")
    """

    def __init__(
        self,
        *,
        hamiltonian: Any = None,
        field: Mapping[str, Any] | None = None,
        terms: Iterable[Term] = (),
        variables: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
        start: Mapping[str, Any] | None = None,
        breaks: Iterable[str] = (),
        summary: str | None = None,
    ):
        mappings = {"field": field, "variables": variables, "parameters": parameters, "start": start}
        for name, value in mappings.items():
            if value is not None and not isinstance(value, Mapping):
                raise IntegratorError(f"{name} of an effect must be a mapping, but was {shorten(repr(value))}")
            self.__dict__[name] = MappingProxyType({key: _settled(entry) for key, entry in (value or {}).items()})
        check_label(summary, "summary of an effect")
        terms, breaks = tuple(items(terms, "terms of an effect")), tuple(items(breaks, "breaks"))
        self.__dict__.update(hamiltonian=hamiltonian, terms=terms, breaks=breaks, summary=summary)
        if hamiltonian is None and not field and not terms:
            raise IntegratorError("an effect must have a hamiltonian, a field or terms, but had none")

    hamiltonian: Any
    field: Mapping[str, Any]
    terms: tuple[Term, ...]
    variables: Mapping[str, Any]
    parameters: Mapping[str, Any]
    start: Mapping[str, Any]
    breaks: tuple[str, ...]
    summary: str | None

    @property
    def arguments(self) -> dict[str, Any]:
        """What `Effect` makes an equal one from."""
        mappings = {name: dict(self.__dict__[name]) for name in ("field", "variables", "parameters", "start")}
        return {**mappings, **{name: self.__dict__[name] for name in ("hamiltonian", "terms", "breaks", "summary")}}

    @property
    def _data(self) -> tuple[Any, ...]:
        return tuple(tuple(x.items()) if isinstance(x, dict) else x for x in self.arguments.values())

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuilt, (self.arguments,)  # what mappings are shown as cannot be pickled

    def __repr__(self) -> str:
        given = ", ".join(f"{name}={value!r}" for name, value in self.arguments.items() if value not in (None, (), {}))
        return f"Effect({given})"


def _rebuilt(arguments: dict[str, Any]) -> Effect:
    return Effect(**arguments)


def _settled(value: Any) -> Any:
    """Numbers as they are, lists and arrays as tuples that nobody can change."""
    value = value.tolist() if hasattr(value, "tolist") else value
    return tuple(map(_settled, value)) if isinstance(value, list | tuple) else value


def check_effects(effects: Any) -> dict[str, Effect]:
    """The effects of a scene by name."""
    known = isinstance(effects, Mapping) and all(isinstance(name, str) and name for name in effects)
    if not known or not all(isinstance(effect, Effect) for effect in effects.values()):
        raise IntegratorError(f"effects must map names to Effects, but was {shorten(repr(effects))}")
    return dict(effects)


def check_active(active: Any, effects: Mapping[str, Effect]) -> tuple[str, ...]:
    """Those of the effects that are to be on, in the order in which they are declared."""
    names = [active] if isinstance(active, str) else items(active, "effects")
    for name in names:
        if not isinstance(name, str) or name not in effects:
            known = shorten(", ".join(effects) or "none")
            hint = "" if effects else "; effects that change the variables are chosen by scene(name, effects=[…])"
            raise IntegratorError(f"effects must be of {known}, but one was {name!r:.60}{hint}")
    return tuple(name for name in effects if name in names)
