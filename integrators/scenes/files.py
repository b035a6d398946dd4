"""Scene files in TOML: what is written is read back as an equal scene, and a failed write leaves nothing.

    name = "pendulum"
    variables = {p = 1, q = 1}
    hamiltonian = "p^2/2 - cos(q)"
    start = {p = [0], q = ["-3/2"]}
    effects.damping = {field = {p = "-gamma*p"}, parameters = {gamma = 0.1}}

The keys are the arguments of `Scene`, `Effect` and `Term`. Numbers are the decimals they spell, or formulas as text.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten
from integrators.core.formats import check_keys, parse_toml
from integrators.core.text_files import atomic_write, read_text
from integrators.exact.expressions import MAX_LENGTH, decimal_text
from integrators.scenes.model.effects import Effect
from integrators.scenes.model.formulas import formula_text
from integrators.scenes.model.terms import Term
from integrators.scenes.scene import UNNAMED, Scene

if TYPE_CHECKING:
    from typing import IO

    import sympy

    from integrators.scenes.model.assembly import Contribution
    from integrators.scenes.model.terms import Key

LABELS = ("name", "summary", "reference")
FORMULAS = ("hamiltonian", "field", "terms")
VALUES = ("variables", "parameters", "start")
KEYS = (*LABELS, *VALUES, *FORMULAS, "poisson", "invariants", "positive", "effects", "active")
EFFECT_KEYS = ("summary", *VALUES, *FORMULAS, "breaks")
TERM_KEYS = ("over", "hamiltonian", "field", "part")
LARGEST_NUMBER = 2**53
"""Larger integers are written as text, since other readers may turn numbers into doubles."""


def load_scene(source: str | os.PathLike[str] | IO[Any]) -> Scene:
    """Read a scene from a TOML file.

    Args:
        source: A path, or an open file of text or bytes.

    Returns:
        The scene.

    Raises:
        IntegratorError: The file cannot be read, is no TOML, or holds no scene; or a declared first integral is none.

    Example:
        >>> import io
        >>> text = 'variables = {p = 1, q = 1}\\nhamiltonian = "p^2/2 - cos(q)"'
        >>> load_scene(io.StringIO(text)).field
        (-sin(q), p)
    """
    text, label = read_text(source)
    return loads_scene(text, source=label)


def loads_scene(text: str, *, source: str = "text") -> Scene:
    """Read a scene from TOML text.

    Args:
        text: The content of a scene file.
        source: What a message calls the text.

    Returns:
        The scene.

    Raises:
        IntegratorError: The text is no TOML, or holds no scene; or a declared first integral is none.

    Example:
        >>> loads_scene('variables = {y = 1}\\nfield = {y = "y^2"}').field
        (y**2,)
    """
    with _told(source):
        scene = _read_scene(parse_toml(text))
        check_invariants(scene)
    return scene


def scene_from_table(table: Mapping[str, Any], source: str) -> Scene:
    """The scene that `scene_table` describes; whether its first integrals are some is not checked.

    Args:
        table: What a scene file holds.
        source: What a message calls it.

    Raises:
        IntegratorError: It describes no scene.
    """
    with _told(source):
        return _read_scene(table)


@contextmanager
def _told(source: str) -> Iterator[None]:
    """Name the source in every error."""
    try:
        yield
    except RecursionError:
        raise IntegratorError(f"{shorten(source, 200)}: nesting must be flat, but was too deep") from None
    except IntegratorError as error:
        raise IntegratorError(f"{shorten(source, 200)}: {error}") from None


def save_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene to a TOML file, from which `load_scene` reads an equal one.

    Args:
        scene: The scene.
        path: The file; it is replaced at once when everything is written, or left as it was.

    Raises:
        IntegratorError: The file cannot be written.

    Example:
        >>> import pathlib, tempfile
        >>> from integrators import scene
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "pendulum.toml")
        ...     save_scene(scene("pendulum"), path)
        ...     load_scene(path) == scene("pendulum")
        True
    """
    if not isinstance(scene, Scene):
        raise IntegratorError(f"scene must be a Scene, but was {shorten(repr(scene))}")
    atomic_write(path, dumps_scene(scene))


def dumps_scene(scene: Scene) -> str:
    """A scene as the text of a scene file."""
    import tomli_w

    return tomli_w.dumps(scene_table(scene))


def check_invariants(scene: Scene) -> None:
    """Refuse first integrals that are none, in the base system or with an effect that does not say that it breaks them.

    Very large fields, and those with symbols for parameters, are not looked at.
    """
    from integrators.scenes.first_integrals import can_be_checked, defects

    for effect in ((), *((name,) for name in scene.effects)) if scene._declaration.invariants else ():
        present = scene.with_effects(*effect)
        if can_be_checked(present):
            for broken in defects(present):
                where = "".join(f" with the effect {name}, whose breaks should name it" for name in effect)
                raise IntegratorError(
                    f"invariants must be constant along the field, but {shorten(broken)} is not{where}"
                )


def _read_scene(data: Any) -> Scene:
    check_keys(data, KEYS, "content")
    if "variables" not in data:
        raise IntegratorError(f"content must have the key variables, but had {shorten(', '.join(data) or 'none')}")
    effects = data.get("effects", {})
    if not isinstance(effects, dict):
        raise IntegratorError(f"effects must map names to tables, but was {shorten(repr(effects))}")
    read = {name: _read_effect(effect, f"effects.{name}") for name, effect in effects.items()}
    return Scene(**{**data, "terms": _read_terms(data.get("terms", ()), "terms"), "effects": read})


def _read_effect(data: Any, argument: str) -> Effect:
    check_keys(data, EFFECT_KEYS, argument)
    terms = _read_terms(data.get("terms", ()), f"{argument}.terms")
    return _named(argument, Effect, {**data, "terms": terms})


def _read_terms(data: Any, argument: str) -> list[Term]:
    terms = []
    for k, term in enumerate(items(data, argument), 1):
        check_keys(term, TERM_KEYS, f"{argument}[{k}]")
        terms.append(_named(f"{argument}[{k}]", Term, term))
    return terms


def _named(argument: str, make: Any, keywords: Mapping[str, Any]) -> Any:
    try:
        return make(**keywords)
    except IntegratorError as error:
        raise IntegratorError(f"{argument}: {error}") from None


def scene_table(scene: Scene) -> dict[str, Any]:
    """A scene as nested dictionaries and lists of integers and text, without what is absent."""
    declaration = scene._declaration
    data: dict[str, Any] = {key: getattr(scene, key) for key in LABELS if getattr(scene, key) != UNNAMED}
    data["active"] = list(scene.active)
    data |= _contribution_table(declaration.base)
    if declaration.poisson is not None:
        data["poisson"] = [[_number(entry, "poisson") for entry in row] for row in declaration.poisson]
    data["positive"] = [_text(formula, "positive") for formula in declaration.positive]
    data["invariants"] = {name: _text(value, f"invariants.{name}") for name, value in declaration.invariants.items()}
    data["effects"] = {
        name: {"summary": scene.effects[name].summary} | _contribution_table(effect)
        for name, effect in declaration.effects.items()
    }
    return _without_nothing(data)


def _without_nothing(table: Mapping[str, Any]) -> dict[str, Any]:
    """The table without the keys whose value is None or empty, on all levels."""
    inner = {key: _without_nothing(value) if isinstance(value, dict) else value for key, value in table.items()}
    return {key: value for key, value in inner.items() if value not in (None, [], {})}


def _contribution_table(part: Contribution) -> dict[str, Any]:
    """What the base system or an effect brings."""
    at_site = {block.name: len(block.components) for block in part.blocks}
    return {
        "variables": {block.name: block.size for block in part.blocks},
        **_formulas_table(part.summands),
        "parameters": {name: _numbers(value) for name, value in part.parameters.items()},
        "start": {name: _rows(_numbers(values), at_site.get(name, 1)) for name, values in part.start.items()},
        "breaks": list(part.breaks),
    }


def _formulas_table(summands: Mapping[Key, sympy.Expr]) -> dict[str, Any]:
    """The keys hamiltonian, field and terms; a sum that is too long for one text goes on in further terms."""
    table: dict[str, Any] = {}
    terms: dict[Any, dict[str, Any]] = {}
    for (target, sites, part), formula in summands.items():
        for k, text in enumerate(_texts(formula)):
            place = table
            if k or part is not None or sites.kind != "single":
                over = [[site + 1 for site in row] for row in sites.table] or sites.kind
                labels = {"over": over} | ({} if part is None else {"part": part})
                place = terms.setdefault((target is None, sites, part, k), labels)
            if target is None:
                place["hamiltonian"] = text
            else:
                place.setdefault("field", {})[target] = text
    return {**table, "terms": list(terms.values())}


def _texts(formula: sympy.Expr) -> Iterator[str]:
    """A formula as one text, or as several to be added if the parser would refuse their sum as too long."""
    import sympy

    text = _written(formula)
    if len(text) <= MAX_LENGTH:
        yield text
        return
    summands = list(sympy.Add.make_args(formula))
    for half in (summands[::2], summands[1::2]):
        yield from _texts(sympy.Add(*half))


def _written(formula: sympy.Expr) -> str:
    return formula_text(formula).replace("**", "^")


def _text(formula: sympy.Expr, argument: str) -> str:
    text = _written(formula)
    if len(text) > MAX_LENGTH:
        raise IntegratorError(f"{argument} must have at most {MAX_LENGTH} characters in a file, but had {len(text)}")
    return text


def _numbers(value: Any) -> Any:
    """One number, or those of all sites."""
    return [_number(entry, "a number") for entry in value] if isinstance(value, tuple) else _number(value, "a number")


def _number(value: Any, argument: str) -> int | str:
    """An integer, or the text of a decimal or formula."""
    if not value.is_Rational:
        return _text(value, argument)
    exact = Fraction(int(value.p), int(value.q))
    return int(exact) if exact.denominator == 1 and abs(exact) < LARGEST_NUMBER else decimal_text(exact)


def _rows(values: list[Any], length: int) -> list[Any]:
    """A row for each site that holds more than one number."""
    return [values[k : k + length] for k in range(0, len(values), length)] if length > 1 else values
