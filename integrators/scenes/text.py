"""Scenes from text: equations of motion or a Hamiltonian in one line, and TOML files with exact round trip.

    name = "pendulum"
    variables = {p = 1, q = 1}
    hamiltonian = "p^2/2 - cos(q)"
    start = {p = [0], q = ["-3/2"]}
    effects.damping = {field = {p = "-gamma*p"}, parameters = {gamma = 0.1}}

The keys are the arguments of `Scene`, `Effect` and `Term`. Numbers are exact decimals, or formulas as text.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import IO, Any

from bseries_base.errors import shorten, shown
from bseries_base.table import Document
from integrators.core.arguments import MOMENTA, POSITIONS, canonical_names, items, split_row
from integrators.core.errors import IntegratorError
from integrators.core.text_files import atomic_write, check_keys, errors_from, parse_toml, read_text
from integrators.exact.expressions import MAX_LENGTH, NOT_FINITE
from integrators.scenes.checks import can_be_checked, defects
from integrators.scenes.model.blocks import TIME, read_blocks
from integrators.scenes.model.formulas import KNOWN, words
from integrators.scenes.model.terms import Effect, Term
from integrators.scenes.scene import Scene

MOST_EQUATIONS = 1000
_EQUATION = re.compile(r"\s*(?:(\w+)\s*(['’′]+)|d\s*(\w+)\s*/\s*d\s*t)\s*=(?!=)(.*)", re.DOTALL)
_CANONICAL = re.compile(
    rf"(?P<block>{'|'.join(sorted(MOMENTA | POSITIONS))})(?P<ending>(?P<axis>[xyz]?)(?P<number>[0-9]*)|_\w+)"
)
"""A momentum or position in a Hamiltonian: p, p1, px, px1, p_a, v, v1, …"""


def parse_scene(
    text: str, blocks: str | Mapping[str, object] | None = None, parameters: str | Mapping[str, object] | None = None,
    start: str | Mapping[str, object] | None = None, name: str | None = None,
) -> Scene:  # fmt: skip
    """A scene from the equations of its field.

    Args:
        text: Equations such as ``p' = -sin(q)`` or ``dp/dt = -sin(q)``, one per line or separated by ``;``.
        blocks: The blocks of variables, as ``"p=x,u; q=y"`` or as a mapping. By default, if all names begin with
            p or q, they form the blocks p and q; otherwise all variables form one block. The variables of a block have
            the order of their equations.
        parameters: Values of parameters, as ``"mu=1/2; m=2"`` or as a mapping.
        start: Start values of variables or of blocks, as ``"p=0; q=-3/2"`` or as a mapping.

    Raises:
        IntegratorError: The text is not a list of equations, or a name has neither an equation nor a value.

    Example:
        >>> import bseries as bs
        >>> pendulum = bs.parse_scene("p' = -sin(q); q' = p", start="p=0; q=-3/2")
        >>> pendulum == bs.Scene({"p": 1, "q": 1}, field={"p": "-sin(q)", "q": "p"}, start={"p": [0], "q": ["-3/2"]})
        True
        >>> bs.parse_scene("dx/dt = mu - x^2", parameters="mu=1/2").field
        (1/2 - x**2,)
    """
    field = _read_equations(text)
    values = read_values(parameters, "parameters")
    _check_known(" ".join(field.values()), [*field, *_value_names(values)], "an equation")
    variables = _find_blocks(list(field)) if blocks is None else _read_blocks(blocks)
    held = {variable for block in variables.values() for variable in block}
    for variable in field:
        if variable not in held:
            raise IntegratorError(f"blocks must hold every variable, but {shorten(variable)} was in none")
    return Scene(variables, field=field, parameters=values, start=_read_start(start, variables), name=name)


def parse_hamiltonian(
    text: str, blocks: str | Mapping[str, object] | None = None, parameters: str | Mapping[str, object] | None = None,
    start: str | Mapping[str, object] | None = None, name: str | None = None,
) -> Scene:  # fmt: skip
    """A scene from its Hamiltonian.

    Args:
        text: The formula, as ``p^2/2 - cos(q)``.
        blocks: The momenta and positions, as ``"p=x,u; q=y,v"`` or as a mapping. By default these are the names p, q
            with numbers or axes (``p1``, ``px``, ``px1``) or with ``_`` (``p_a``); the conjugate of each is added.
            Other usual pairs of names, such as v and x, or v1, v2, x1 and x2, must be complete.
        parameters, start, name: As for `parse_scene`.

    Raises:
        IntegratorError: The text is not a formula, or a name is neither a variable nor a parameter.

    Example:
        >>> import bseries as bs
        >>> bs.parse_hamiltonian("p^2/2 - cos(q)") == bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)")
        True
        >>> bs.parse_hamiltonian("(px^2 + py^2)/2 - k/sqrt(qx^2 + qy^2)", parameters="k=1").variables
        ('px', 'py', 'qx', 'qy')
    """
    if not isinstance(text, str):
        raise IntegratorError(f"hamiltonian must be text, but was {shown(text)}")
    if len(text) > MAX_LENGTH:
        raise IntegratorError(f"hamiltonian must have at most {MAX_LENGTH:,} characters, but has {len(text):,}")
    values = read_values(parameters, "parameters")
    given = set(_value_names(values))
    used = [word for word in _symbols(text) if word not in given]
    variables = _find_canonical(used) if blocks is None else _read_blocks(blocks)
    names = [variable for block in variables.values() for variable in block]
    _check_known(text, [*names, *_value_names(values)], "a place in blocks")
    return Scene(variables, hamiltonian=text, parameters=values, start=_read_start(start, variables), name=name)


def _read_equations(text: object) -> dict[str, str]:
    """The right-hand sides by variable, in the order of the equations."""
    if not isinstance(text, str):
        raise IntegratorError(f"equations must be text, but was {shown(text)}")
    lines = list(filter(str.strip, re.split(r"[;\n]", text)))
    if len(lines) > MOST_EQUATIONS:
        raise IntegratorError(
            f"equations must be at most {MOST_EQUATIONS:,}, but were {len(lines):,}: write a Scene with terms"
        )
    field: dict[str, str] = {}
    for line in lines:
        match = _EQUATION.fullmatch(line)
        if match is None:
            raise IntegratorError(
                f"equations must have the form x' = … or dx/dt = …, but one was {shorten(line.strip())!r}"
            )
        name, primes, other, formula = match.groups()
        name = name or other
        if len(primes or "") > 1:
            raise IntegratorError(
                f"equations must be of first order, but one was {shorten(line.strip())!r}: "
                f"write {name}' = v; v{shorten(primes[1:])} = {shorten(formula.strip())} with a name v of your own"
            )
        if name in field:
            raise IntegratorError(f"equations must be one for each variable, but {shorten(name)} had two")
        field[name] = formula.strip()
    if not field:
        raise IntegratorError("equations must be as in \"p' = -sin(q); q' = p\", but there were none")
    return field


def _symbols(text: str) -> list[str]:
    """The names in a formula, without constants and functions."""
    called = set(re.findall(r"\b(\w+)\s*\(", text))
    names = (word for word in words(text) if word not in KNOWN and word.lower() not in NOT_FINITE)
    return [name for name in names if name not in called]


def _value_names(values: Document) -> list[str]:
    """The names of parameters in formulas: m, or m1, m2, … for a list of values."""
    names = []
    for name, value in values.items():
        several = isinstance(value, list | tuple) or getattr(value, "ndim", 0)
        names += [f"{name}{k}" for k in range(1, len(value) + 1)] if several else [name]
    return names


def _check_known(text: str, known: Iterable[str], what: str) -> None:
    places = {*known, TIME}
    for name in _symbols(text):
        if name not in places:
            raise IntegratorError(f"{shorten(name)} is undefined: it has neither {what} nor a value in parameters")


def _find_blocks(names: Sequence[str]) -> dict[str, list[str]]:
    """Blocks inferred from the names of variables; the time is a separate block."""
    others = [name for name in names if name != TIME]
    canonical = all(name[0] in "pq" for name in others)
    alone = others[0] if len(others) == 1 else "y"
    blocks: dict[str, list[str]] = {}
    for name in names:
        blocks.setdefault(TIME if name == TIME else name[0] if canonical else alone, []).append(name)
    return blocks


def _find_canonical(names: Iterable[str]) -> dict[str, list[str]]:
    """Momenta and positions in pairs, sorted by number and axis."""
    endings: dict[str, set[tuple[int, str, str, str]]] = {}
    for match in filter(None, map(_CANONICAL.fullmatch, names)):
        number = (match["number"] or "").lstrip("0")  # which may have more digits than Python reads
        ending = len(number), number, match["axis"] or "", match["ending"]
        endings.setdefault(match["block"], set()).add(ending)
    pair = canonical_names(endings)
    if pair is None or endings[pair[0]] != endings[pair[1]]:  # only conjugates of p and q may be missing in the text
        pair = ("p", "q")
    found = sorted(set().union(*(endings.get(block, ()) for block in pair)))
    if not found:
        raise IntegratorError(
            "hamiltonian must have names such as p, q, p1, qx, or a pair such as v, x, or blocks must be given, "
            "but had none"
        )
    return {block: [block + ending for *_, ending in found] for block in pair}


def _read_blocks(blocks: object) -> dict[str, list[str]]:
    """The names of variables by block."""
    values = read_values(blocks, "blocks")
    if isinstance(blocks, str):
        values = {name: value if isinstance(value, list) else [value] for name, value in values.items()}
    return {block.name: list(block.variables) for block in read_blocks(values, "blocks")}


def read_values(values: object, argument: str) -> Document:
    """A mapping, or the mapping written as text ``name=value; name=value,value``."""
    if values is None or isinstance(values, Mapping):
        return dict(values or {})
    if not isinstance(values, str):
        raise IntegratorError(f"{argument} must be a mapping or text, but was {shown(values)}")
    read: Document = {}
    for item in filter(str.strip, re.split(r"[;\n]", values)):
        name, sign, value = (part.strip() for part in item.partition("="))
        if not (sign and name and value) or name in read:
            raise IntegratorError(f'{argument} must be as in "a=1; b=2", but had {shorten(item.strip())!r}')
        entries = [entry.strip() for entry in split_row(value)]
        read[name] = entries if len(entries) > 1 else value
    return read


def _read_start(start: object, blocks: Mapping[str, Sequence[str]]) -> Document:
    """Start values by block, collected from blocks and single variables."""
    values, found = read_values(start, "start"), {}
    for block, variables in blocks.items():
        if all(variable in values for variable in variables):
            found[block] = [values.pop(variable) for variable in variables]
        elif any(variable in values for variable in variables if variable != block):
            missing = next(variable for variable in variables if variable not in values)
            raise IntegratorError(
                f"start must have values for {shorten(', '.join(variables))}, but has none for {missing}"
            )
    known = dict.fromkeys((*blocks, *(variable for variables in blocks.values() for variable in variables)))
    for name in values:
        if name not in known and name != TIME:
            raise IntegratorError(
                f"start must have values for {shorten(', '.join(known))}, but has some for {name!r:.60}"
            )
    return {**found, **values}


EFFECT_KEYS = ("summary", "variables", "parameters", "start", "hamiltonian", "field", "terms", "breaks")
KEYS = ("name", "reference", *EFFECT_KEYS[:-1], "poisson", "invariants", "positive", "effects", "active")
TERM_KEYS = ("over", "hamiltonian", "field", "part")


def load_scene(source: str | os.PathLike[str] | IO[str] | IO[bytes]) -> Scene:
    """Read a scene from a TOML file.

    Args:
        source: A path, or an open file of text or bytes.

    Raises:
        IntegratorError: The file cannot be read, is not TOML, describes no scene, or declares a first integral that is
            not constant along the field.

    Example:
        >>> import bseries as bs
        >>> import io
        >>> text = 'variables = {p = 1, q = 1}\\nhamiltonian = "p^2/2 - cos(q)"'
        >>> bs.load_scene(io.StringIO(text)).field
        (-sin(q), p)
    """
    text, label = read_text(source)
    return loads_scene(text, source=label)


def loads_scene(text: str, *, source: str = "text") -> Scene:
    """Read a scene from TOML text, named `source` in error messages."""
    with errors_from(source):
        scene = _read_scene(parse_toml(text))
        check_invariants(scene)
    return scene


def scene_from_table(table: Mapping[str, object], source: str) -> Scene:
    """The scene in the table of a scene file, without the check of first integrals."""
    with errors_from(source):
        return _read_scene(table)


def save_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene to a TOML file, from which `load_scene` reads an equal one.

    Args:
        path: The file; it is replaced atomically, or left unchanged if writing fails.

    Raises:
        IntegratorError: The file cannot be written.

    Example:
        >>> import bseries as bs
        >>> import pathlib, tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "pendulum.toml")
        ...     bs.save_scene(bs.scene("pendulum"), path)
        ...     bs.load_scene(path) == bs.scene("pendulum")
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
    read: dict[str, Effect] = {}
    for name, effect in effects.items():
        check_keys(effect, EFFECT_KEYS, f"effects.{name}")
        terms = _read_terms(effect.get("terms", ()), f"effects.{name}.terms")
        with errors_from(f"effects.{name}"):
            read[name] = Effect(**{**effect, "terms": terms})
    return Scene(**{**data, "terms": _read_terms(data.get("terms", ()), "terms"), "effects": read})


def _read_terms(data: object, argument: str) -> list[Term]:
    terms = []
    for k, term in enumerate(items(data, argument), 1):
        check_keys(term, TERM_KEYS, f"{argument}[{k}]")
        with errors_from(f"{argument}[{k}]"):
            terms.append(Term(**term))
    return terms
