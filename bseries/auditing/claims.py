"""What a source says of a method: its order, and that of its other rows of weights."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

WORDS = (
    *("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth", "eleventh"),
    *("twelfth", "thirteenth", "fourteenth"),
)
ORDINALS = {word: k for k, word in enumerate(WORDS, 1)}
MOST = 20
"""Larger numbers are no orders."""

ORDER_FIELDS = ("order", "q", "o")
EMBEDDED_FIELDS = ("embedded_order", "adaptiveorder", "p")
TEXTS = ("comment", "description", "name", "shortname")

NUMBER = rf"(?P<number>\d{{1,2}})(?:st|nd|rd|th)?|(?P<word>{'|'.join(ORDINALS)})"
ORDINAL = re.compile(rf"\b(?:{NUMBER})[ -]order\b(?! (?:condition|derivative|system|ODE|equation|differential))", re.I)
ORDER_OF = re.compile(r"\border(?: of| is|:| =|=)? ?(\d{1,2})\b(?! ?[(/.]| conditions)", re.I)
PAIR = re.compile(r"\b(\d{1,2}) ?\( ?(\d{1,2}) ?\)")
EMBEDDED = re.compile(r"embedded|error estimat|lower[- ]order|companion", re.I)
NAMED_PAIR = re.compile(
    r"^(?:RK|RKF|ERK|DP|DOPRI|BS|CK|DormandPrince|CashKarp|BogackiShampine|Fehlberg)_?(\d)_?(\d)$", re.I
)


class Claims(NamedTuple):
    """The orders that a source claims.

    Attributes:
        order: The order of the method; None if nothing is said.
        embedded: The order of its second row of weights; None if nothing is said.
        either: Whether the two may be exchanged, as in names such as RKF45.
    """

    order: int | None = None
    embedded: int | None = None
    either: bool = False

    def to_dict(self) -> dict[str, int]:
        """What is claimed, by name."""
        return {
            key: value for key, value in (("order", self.order), ("embedded_order", self.embedded)) if value is not None
        }


def claims_of(said: Mapping[str, str], name: str = "") -> Claims:
    """The claims in what a source says of a method: fields, comments and its name; none where that is in doubt.

    Args:
        said: Text by kind: ``order``, ``q``, ``o``, ``embedded_order``, ``adaptiveorder``, ``p``, ``comment``, ….
        name: The name of the method.

    Example:
        >>> from bseries.auditing.claims import claims_of
        >>> claims_of({"comment": "A fifth-order method with an embedded one of order 4"})
        Claims(order=5, embedded=4, either=False)
        >>> claims_of({}, "RKF45"), claims_of({"q": "3", "p": "2"}).to_dict()
        (Claims(order=5, embedded=4, either=True), {'order': 3, 'embedded_order': 2})
    """
    said = {**_of_call(said.get("call", "")), **said}
    order = _field(said, ORDER_FIELDS)
    embedded = _field(said, EMBEDDED_FIELDS if order is not None else EMBEDDED_FIELDS[:2])
    if order is None and "p" in said:
        order = _field(said, ("p",))
    if order is not None:
        return Claims(order, embedded)
    for text in (said[key] for key in TEXTS if key in said):
        found = _in_text(text)
        if found.order is not None:
            return found
    if match := NAMED_PAIR.match(name):
        low, high = sorted(map(int, match.groups()))
        if high == low + 1:
            return Claims(high, low, either=True)
    return Claims()


CALL = re.compile(r"(?:RKTableau|Register)\w*\((.*)\)\s*;?\s*$", re.S)
"""Constructors whose first argument that is a whole number is the order."""


def _of_call(call: str) -> dict[str, str]:
    """The orders among the arguments of a constructor."""
    match = CALL.search(call)
    arguments = [part.strip() for part in match[1].split(",")] if match else []
    whole = [part for part in arguments if part.isdecimal()]
    found = {"order": whole[0]} if whole else {}
    named = dict(re.findall(r"\b(order|adaptiveorder)\s*=\s*(\d+)", call))
    return found | named


def _field(said: Mapping[str, str], keys: tuple[str, ...]) -> int | None:
    """The whole number in the first field that has one."""
    for key in keys:
        text = said.get(key, "").strip()
        if text.isdecimal() and 0 < int(text) <= MOST:
            return int(text)
    return None


def _in_text(text: str) -> Claims:
    """The claims of a sentence: a pair 5(4), or one order, and another one behind a word for embedded methods."""
    text = re.split(r"\breferences?\b", text, maxsplit=1, flags=re.I)[0]
    pairs = {(int(a), int(b)) for a, b in PAIR.findall(text) if 0 < int(b) <= MOST and abs(int(a) - int(b)) <= 3}
    if len(pairs) == 1:
        first, second = pairs.pop()
        return Claims(max(first, second), min(first, second), either=first < second)
    found: dict[bool, set[int]] = {False: set(), True: set()}
    behind = EMBEDDED.search(text)
    for match in [*ORDINAL.finditer(text), *ORDER_OF.finditer(text)]:
        number = match[1] if match.re is ORDER_OF else match["number"]
        order = int(number) if number else ORDINALS[match["word"].lower()]
        found[behind is not None and match.start() > behind.start()].add(order)
    own, other = found[False], found[True]
    if len(own) != 1 or len(other) > 1 or not 0 < max(own) <= MOST:
        return Claims()
    return Claims(own.pop(), other.pop() if other else None)
