"""Scene files in TOML: exact round trip, atomic writes.

    name = "pendulum"
    variables = {p = 1, q = 1}
    hamiltonian = "p^2/2 - cos(q)"
    start = {p = [0], q = ["-3/2"]}
    effects.damping = {field = {p = "-gamma*p"}, parameters = {gamma = 0.1}}

The keys are the arguments of `Scene`, `Effect` and `Term`. Numbers are exact decimals, or formulas as text.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import IO, Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shorten, shown
from integrators.core.text_files import atomic_write, check_keys, errors_from, parse_toml, read_text
from integrators.scenes.checks import can_be_checked, defects
from integrators.scenes.model.terms import Effect, Term
from integrators.scenes.scene import Scene

LABELS = ("name", "summary", "reference")
FORMULAS = ("hamiltonian", "field", "terms")
VALUES = ("variables", "parameters", "start")
KEYS = (*LABELS, *VALUES, *FORMULAS, "poisson", "invariants", "positive", "effects", "active")
EFFECT_KEYS = ("summary", *VALUES, *FORMULAS, "breaks")
TERM_KEYS = ("over", "hamiltonian", "field", "part")


def load_scene(source: str | os.PathLike[str] | IO[Any]) -> Scene:
    """Read a scene from a TOML file.

    Args:
        source: A path, or an open file of text or bytes.

    Returns:
        The scene.

    Raises:
        IntegratorError: The file cannot be read, is not TOML, describes no scene, or declares a first integral that is
            not constant along the field.

    Example:
        >>> import io
        >>> text = 'variables = {p = 1, q = 1}\\nhamiltonian = "p^2/2 - cos(q)"'
        >>> load_scene(io.StringIO(text)).field
        (-sin(q), p)
    """
    text, label = read_text(source)
    return loads_scene(text, source=label)


def loads_scene(text: str, *, source: str = "text") -> Scene:
    """Read a scene from TOML text, named `source` in error messages.

    Example:
        >>> loads_scene('variables = {y = 1}\\nfield = {y = "y^2"}').field
        (y**2,)
    """
    with errors_from(source):
        scene = _read_scene(parse_toml(text))
        check_invariants(scene)
    return scene


def scene_from_table(table: Mapping[str, Any], source: str) -> Scene:
    """The scene in the table of a scene file, without the check of first integrals."""
    with errors_from(source):
        return _read_scene(table)


def save_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene to a TOML file, from which `load_scene` reads an equal one.

    Args:
        scene: The scene.
        path: The file; it is replaced atomically, or left unchanged if writing fails.

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
        raise IntegratorError(f"scene must be a Scene, but was {shown(scene)}")
    atomic_write(path, scene.to_toml())


def check_invariants(scene: Scene) -> None:
    """Refuse invariants that are not constant, in the base system or with an effect whose `breaks` omits them.

    Very large fields and fields with symbolic parameters are not checked.
    """
    for effect in ((), *((name,) for name in scene.effects)) if scene.declaration.invariants else ():
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
        raise IntegratorError(f"effects must map names to tables, but was {shown(effects)}")
    read = {name: _read_effect(effect, f"effects.{name}") for name, effect in effects.items()}
    return Scene(**{**data, "terms": _read_terms(data.get("terms", ()), "terms"), "effects": read})


def _read_effect(data: Any, argument: str) -> Effect:
    check_keys(data, EFFECT_KEYS, argument)
    terms = _read_terms(data.get("terms", ()), f"{argument}.terms")
    with errors_from(argument):
        return Effect(**{**data, "terms": terms})


def _read_terms(data: Any, argument: str) -> list[Term]:
    terms = []
    for k, term in enumerate(items(data, argument), 1):
        check_keys(term, TERM_KEYS, f"{argument}[{k}]")
        with errors_from(f"{argument}[{k}]"):
            terms.append(Term(**term))
    return terms
