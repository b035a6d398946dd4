"""Checks of arguments: numbers, arrays, sequences, labels, names, and names that tell momenta from positions."""

from __future__ import annotations

import math
import operator
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, TypeGuard
from unicodedata import normalize

from bseries_base.errors import shown
from bseries_base.extras import loaded_module
from integrators.core.errors import IntegratorError

if TYPE_CHECKING:
    from inspect import Parameter

    import numpy as np

MOST_STEPS = 2**53
"""The largest number of steps; a double does not represent every larger integer."""
MOST_DIGITS = 1000
_NOT_SHOWN = re.compile("[\0-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")
"""Control characters, which a terminal obeys, ends of lines, and surrogates, which no encoding has."""


def read_whole(value: object, argument: str, what: str, least: int, most: int) -> int:
    """A whole number within limits, which messages describe as `what`."""
    try:
        number = least - 1 if isinstance(value, bool) else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        raise IntegratorError(f"{argument} must be {what}, but was {shown(value)}")
    return number


def read_steps(value: object, argument: str, least: int) -> int:
    """A number of steps; 1e6 is one."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return read_whole(value, argument, f"a whole number from {least} to 2^53", least, MOST_STEPS)


def check_end(t0: float, h: float, steps: int) -> None:
    """Refuse steps whose end time is beyond the range of doubles."""
    if not math.isfinite(t0 + steps * h):
        raise IntegratorError(
            f"h must be small enough for a finite time after {steps} steps from t = {t0:g}, but was {h:g}"
        )


def check_digits(digits: object) -> None:
    """Refuse a number of significant digits that is neither None nor an integer within limits."""
    if digits is not None and (type(digits) is not int or not 1 <= digits <= MOST_DIGITS):
        raise IntegratorError(f"digits must be an integer from 1 to {MOST_DIGITS}, but was {shown(digits)}")


def read_array(values: Any) -> np.ndarray:
    """Real numbers as an array of doubles; a single nan if `values` are not real numbers."""
    import numpy as np

    masked = loaded_module("numpy.ma")  # without it there are no masked arrays, and it loads slowly
    try:
        if np.iscomplexobj(values) or (masked and masked.is_masked(values)):
            raise TypeError
        return np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return np.array(np.nan)


def as_lists(value: Any) -> Any:
    """An array as nested lists, a NumPy number as a Python number; other values unchanged."""
    return value.tolist() if hasattr(value, "tolist") else value


def without_axes(value: Any) -> Any:
    """What is in an array without axes, a NumPy number as one of Python; other values unchanged."""
    return value.item() if hasattr(value, "item") and getattr(value, "shape", None) == () else value


def is_listed(value: object) -> TypeGuard[Sequence[Any]]:
    """Whether a value is a list, a tuple or another sequence, but not text."""
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def items(value: object, argument: str) -> list[Any]:
    """The entries of a sequence or array."""
    value = as_lists(value)
    if isinstance(value, str | bytes | Mapping | set | frozenset) or not isinstance(value, Iterable):
        raise IntegratorError(f"{argument} must be a sequence, but was {shown(value)}")
    return list(value)


def check_label(value: object, argument: str, *, lines: bool = False) -> None:
    """Refuse a name or reference that is neither None nor text that can be shown, in one line or perhaps in several."""
    if value is not None and not isinstance(value, str):
        raise IntegratorError(f"{argument} must be text, but was {shown(value)}")
    if value and (found := _NOT_SHOWN.search(value.translate(dict.fromkeys(b"\t\r\n")) if lines else value)):
        raise IntegratorError(f"{argument} must be text that can be shown, but has {found[0]!a} in {shown(value)}")


def read_labels(name: str | None, reference: str | None) -> dict[str, str | None]:
    """The name of a method, ``custom`` by default, and its reference."""
    check_label(name, "name")
    check_label(reference, "reference", lines=True)
    return {"name": "custom" if name is None else name, "reference": reference}


def check_distinct(names: Iterable[str], argument: str) -> None:
    """Refuse names that are spelled differently, but equal as identifiers: Python and many fonts take ﬁ for fi."""
    known: dict[str, str] = {}
    for name in names:
        if known.setdefault(identifier(name), name) != name:
            first = known[identifier(name)]
            raise IntegratorError(
                f"{argument} must differ as identifiers, but {first} ({first!a}) and {name} ({name!a}) do not"
            )


def identifier(name: str) -> str:
    """A name as Python reads it as an identifier, in the normal form NFKC."""
    return name if name.isascii() else normalize("NFKC", name)


def check_partition_names(names: Iterable[str]) -> None:
    """Refuse names of parts that are equal, or would be ambiguous in formulas or trees."""
    given = list(names)
    for name in given:
        if not isinstance(name, str) or not name.isidentifier() or name[0] == "_" or name == "t" or "τ" in name:
            raise IntegratorError(
                "names of partitions must start with a letter, hold letters, digits and _ only, and not be t or hold "
                f"τ, but one was {shown(name)}"
            )
    if len(set(given)) < len(given):
        raise IntegratorError(f"parts must have different names, but were {', '.join(given)}")
    check_distinct(given, "names of partitions")


FAILURES = (TypeError, AttributeError, NameError, ValueError, LookupError, ArithmeticError, RecursionError)
"""What functions of the user may raise when they are run on symbols."""


def parameters_of(function: Callable[..., object]) -> list[Parameter] | None:
    """The parameters of a function; None if it does not tell, as some that are not written in Python."""
    from inspect import signature

    try:
        return list(signature(function).parameters.values())
    except (TypeError, ValueError):
        return None


def required(parameters: Iterable[Parameter]) -> int:
    """The number of positional parameters without defaults."""
    return sum(p.default is p.empty and p.kind <= p.POSITIONAL_OR_KEYWORD for p in parameters)


def split_row(text: str) -> list[str]:
    """The entries of a row, split at the commas outside parentheses."""
    ends, depth = [-1], 0
    for at, character in enumerate(text):
        depth += {"(": 1, ")": -1}.get(character, 0)
        if character == "," and depth == 0:
            ends.append(at)
    return [text[start + 1 : end] for start, end in pairwise([*ends, len(text)])] if text.strip() else []


def check_progress(progress: object) -> Callable[[int, int], object] | None:
    """The function that is told the progress; True stands for `write_progress`, False for none."""
    if isinstance(progress, bool):
        return write_progress if progress else None
    if progress is not None and not callable(progress):
        raise IntegratorError(f"progress must be a function of two numbers, True or None, but was {shown(progress)}")
    return progress


def write_progress(done: int, total: int) -> None:
    """Write the part of the work that is done to stderr, over the line before."""
    print(f"\r{done / total:4.0%}", end="\n" if done == total else "", file=sys.stderr, flush=True)


MOMENTA = frozenset({"p", "P", "v", "omega", "a", "I", "J", "L"})
POSITIONS = frozenset({"q", "Q", "x", "r", "theta", "phi"})
"""Names of momenta (velocities, actions) and of positions (angles)."""


def canonical_names(names: Iterable[str]) -> tuple[str, str] | None:
    """The names of momenta and of positions: p and q, or the only pair of other such names; None if names do not tell.

    Example:
        >>> canonical_names(["x", "v"]), canonical_names(["v", "q", "p"]), canonical_names(["x", "y"])
        (('v', 'x'), ('p', 'q'), None)
    """
    given = tuple(names)
    for groups in (({"p"}, {"q"}), (MOMENTA, POSITIONS)):
        momenta, positions = ([name for name in given if name in group] for group in groups)
        if len(momenta) == len(positions) == 1:
            return momenta[0], positions[0]
    return None
