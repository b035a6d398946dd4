"""JSON and TOML with numbers kept exact: decimals become `Decimal`s, never floats."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from decimal import Decimal, InvalidOperation
from typing import Any, NoReturn

from integrators.core.errors import IntegratorError, shorten

FORMATS = ("json", "toml")
MOST_DIGITS = 4300
"""Of an integer; Python takes a time that grows with their square."""
MOST_PARTS = 100
"""Of a dotted key; the parser takes memory that grows with their square."""
PART = r"""(?:[\w-]++|"(?:[^"\\\n]++|\\[^\n])*+"?|'[^'\n]*+'?)"""
TOKEN = (
    r'''"""(?:[^"\\]++|\\.|"{1,2}+(?!"))*+(?:"{3,5}|\Z)|[']{3}.*?(?:[']{3,5}|\Z)|#[^\n]*+'''
    rf"|(?P<key>{PART}(?:[ \t]*+\.[ \t]*+{PART})*+)"
)
"""Strings of several lines, comments, and keys or whatever looks like one."""


def parse_json(text: str) -> Any:
    """The content of JSON text; repeated keys, NaN and infinity are refused."""
    import json

    try:
        return json.loads(
            text, parse_int=_integer, parse_float=Decimal, parse_constant=_refuse, object_pairs_hook=_unique
        )
    except IntegratorError:
        raise
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise IntegratorError(f"content must be JSON, but was not at {where}: {error.msg}") from None
    except ValueError as error:
        raise IntegratorError(f"content must be JSON of reasonable size, but was not: {error}") from None
    except InvalidOperation:
        raise IntegratorError("numbers must have exponents of reasonable size, but one had not") from None


def _integer(text: str) -> int:
    if len(text) > MOST_DIGITS:
        raise ValueError(f"an integer has {len(text)} digits")
    return int(text)


def _refuse(name: str) -> NoReturn:
    raise IntegratorError(f"numbers must be finite, but one was {name}")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise IntegratorError(f"keys must be unique, but {shorten(key)!r} was repeated")
        found[key] = value
    return found


def parse_toml(text: str) -> Any:
    """The content of TOML text. Its parser names line and column itself."""
    import tomllib

    if re.search(rf"(?<!\w)[\d_]{{{MOST_DIGITS + 1}}}", text):
        raise IntegratorError(f"numbers must have at most {MOST_DIGITS} digits in a row, but one has more")
    tokens = re.finditer(TOKEN, text, re.DOTALL)
    if any(token["key"] and len(re.findall(PART, token["key"])) > MOST_PARTS for token in tokens):
        raise IntegratorError(f"content must have keys of at most {MOST_PARTS} parts, but one has more")
    try:
        return tomllib.loads(text, parse_float=Decimal)
    except ValueError as error:
        raise IntegratorError(f"content must be TOML, but was not: {error}") from None
    except InvalidOperation:
        raise IntegratorError("numbers must have exponents of reasonable size, but one had not") from None


def check_keys(data: Any, known: Iterable[str], argument: str) -> None:
    """Refuse what is no table, and keys that nobody reads.

    Args:
        data: what a file holds.
        known: the keys that it may have.
        argument: what a message calls it.

    Raises:
        IntegratorError: it has another key; the message says which known one is like it.
    """
    if not isinstance(data, dict):
        raise IntegratorError(f"{argument} must be a table of keys and values, but was {shorten(repr(data))}")
    for key in data:
        if key not in known:
            from difflib import get_close_matches

            near = get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f" (did you mean {near[0]}?)" if near else ""
            raise IntegratorError(
                f"{argument} must have the keys {', '.join(known)} only, but had {shorten(key)!r}{hint}"
            )


def json_text(value: Any, indent: str = "") -> str:
    """JSON with one key, or one row of a matrix, to a line."""
    import json

    deeper = indent + "  "
    if isinstance(value, Mapping):
        lines = [f"{deeper}{json.dumps(k, ensure_ascii=False)}: {json_text(v, deeper)}" for k, v in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and value and isinstance(value[0], list):
        return "[\n" + ",\n".join(deeper + json_text(row) for row in value) + f"\n{indent}]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
