"""Text from forms as methods, scenes and starts: bounded in length, and never evaluated."""

from __future__ import annotations

import re
import warnings
from typing import NamedTuple

from bseries.exceptions import SeriesError
from integrators import RungeKutta, TableauWarning, method, parse_hamiltonian, parse_scene, scene
from integrators.core.arguments import split_row
from integrators.core.errors import IntegratorError
from integrators.exact.arguments import read_number
from integrators.methods.kinds.files import loads_method
from integrators.methods.programs.program import Method
from integrators.scenes.scene import Scene
from integrators.scenes.text import read_values

MOST_CHARACTERS = 4_000
"""Of a text in a form."""
MOST_STAGES = 24
MOST_VARIABLES = 24
NAME = re.compile(r"[\w. ()+-]+")


class Request(NamedTuple):
    """What a page is asked for, as text; empty for the default."""

    method: str = "rk4"  # a name of the catalogue, JSON or TOML of a tableau file, or the rows of a tableau
    scene: str = "pendulum"  # a name of the catalogue, equations such as ``p' = -sin(q); q' = p``, or a Hamiltonian
    start: str = ""  # start values by block, such as ``p=0; q=-3/2``
    order: str = ""  # the largest number of nodes of trees
    span: str = ""  # the length of time

    def checked(self) -> Request:
        """The request without spaces around, unless a text is too long."""
        for argument, text in self._asdict().items():
            if len(text) > MOST_CHARACTERS:
                raise SeriesError(f"{argument} must have at most {MOST_CHARACTERS:,} characters, but had {len(text):,}")
        return Request(*(text.strip() for text in self))


def read_method(text: str) -> Method:
    """A method: a name of the catalogue, a tableau file's text, or rows of a tableau with the weights last.

    Args:
        text: A name; JSON, which starts with a brace; TOML, which has an equals sign; or one row on each line, entries
            separated by spaces or commas. The last row are the weights; a further entry at the beginning of all other
            rows is the node. A last line such as ``digits = 15`` is the number of correct digits of decimals.

    Raises:
        IntegratorError: The text is no method.
        SeriesError: The text is empty, or the method is too large to explore.

    Example:
        >>> read_method("rk4").name
        'rk4'
        >>> read_method("0 | 0 0\\n1/2 | 1/2 0\\n  | 0 1").A
        ((Fraction(0, 1), Fraction(0, 1)), (Fraction(1, 2), Fraction(0, 1)))
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TableauWarning)  # the page lists `issues`
        if not text:
            raise SeriesError("method must be a name such as rk4 or a tableau, but was empty")
        text, digits = _without_digits(text)
        if text.startswith("{") or "=" in text:
            found = loads_method(text, "json" if text.startswith("{") else "toml", source="method")
        elif "\n" in text or ";" in text:
            lines = [line for line in re.split(r"[\n;]", text) if line.strip(" |\t\r")]
            found = _method_of_rows(list(map(_entries, lines)), digits)
        else:
            found = method(text)
    return checked_method(found)


def checked_method(method: Method) -> Method:
    """The method, unless it has too many stages to explore."""
    if method.stages > MOST_STAGES:
        raise SeriesError(f"method must have at most {MOST_STAGES} stages to explore, but had {method.stages}")
    return method


def _without_digits(text: str) -> tuple[str, int | None]:
    """Rows of a tableau, and the number of digits on a last line of its own."""
    rows, _, last = text.rstrip("; \t\r\n").replace("\n", ";").rpartition(";")
    found = re.fullmatch(r"\s*digits\s*=\s*([0-9]{1,9})", last)
    return (rows, int(found[1])) if found and ";" in rows and not {"=", "{"} & set(rows) else (text, None)


def _method_of_rows(rows: list[list[str]], digits: int | None) -> Method:
    *matrix, weights = rows or [[]]
    lengths, stages = {len(row) for row in matrix}, len(weights)
    if not stages or len(matrix) != stages or lengths not in ({stages}, {stages + 1}):
        shape = ", ".join(str(len(row)) for row in rows)
        raise SeriesError(
            "method must be a tableau with a row for each stage and then the weights, as in 0 0; 1/2 0; 0 1, but "
            f"had rows of {shape or 0}"
        )
    nodes = [row.pop(0) for row in matrix] if lengths == {stages + 1} else None
    return RungeKutta(matrix, weights, nodes, digits=digits)


def _entries(line: str) -> list[str]:
    """The entries of a row; a bar may stand after the node."""
    pieces = line.replace("|", "," if "," in line else " ").strip()
    return [entry.strip() for entry in split_row(pieces.strip(","))] if "," in pieces else pieces.split()


def read_scene(text: str, start: str = "") -> Scene:
    """A scene: a name of the catalogue, equations, or a Hamiltonian, with its start.

    Args:
        text: A name; equations, which have primes; or the formula of a Hamiltonian.
        start: Start values by block, such as ``p=0; q=-3/2``; empty for the scene's own.

    Raises:
        IntegratorError: A text cannot be read.
        SeriesError: There is no start, or there are too many variables.

    Example:
        >>> read_scene("p^2/2 + q^4/4", "p=0; q=1").y0
        array([0., 1.])
    """
    if "'" in text:
        found = parse_scene(text)
    elif NAME.fullmatch(text) and not re.search(r"[+(]", text):
        found = scene(text)
    else:
        found = parse_hamiltonian(text)
    if start:
        try:
            values = read_values(start, "start")
        except IntegratorError:
            raise SeriesError(f'start must be values by block, as in "p=0; q=-3/2", but was {start!r:.60}') from None
        found = found.with_start(**values)
    return checked_scene(found)


def checked_scene(scene: Scene) -> Scene:
    """The scene, unless it has too many variables or no start at which the field is finite."""
    import numpy as np

    if scene.dimension > MOST_VARIABLES:
        raise SeriesError(f"scene must have at most {MOST_VARIABLES} variables to explore, but had {scene.dimension}")
    if scene.start is None:
        names = "; ".join(f"{block.name}=…" for block in scene.blocks)
        raise SeriesError(f'start must be given for this scene, as in "{names}", but was empty')
    with np.errstate(all="ignore"):
        if not np.isfinite(scene.y0).all():
            raise SeriesError("start must be finite, but was not")
    return scene


def read_integer(text: str, argument: str, default: int, most: int) -> int:
    """A whole number from 1 on; the default for an empty text."""
    if not text:
        return default
    if not re.fullmatch(r"[0-9]{1,4}", text) or not 1 <= int(text) <= most:
        raise SeriesError(f"{argument} must be a whole number from 1 to {most}, but was {text!r:.60}")
    return int(text)


def read_positive(text: str, argument: str, default: float, most: float) -> float:
    """A positive number; the default for an empty text."""
    if not text:
        return default
    value = read_number(text, argument)
    if not 0 < value <= most:
        raise SeriesError(f"{argument} must be more than 0 and at most {most:g}, but was {text!r:.60}")
    return value
