"""What a source says of a method: its order, that of its other weights, its stage order and its structure."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

WORDS = (
    *("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth", "eleventh"),
    *("twelfth", "thirteenth", "fourteenth"),
)
ORDINALS = {word: k for k, word in enumerate(WORDS, 1)}
MOST = 20
"""Larger numbers are no orders."""
MOST_BEFORE = 60
"""Characters before an order that may put it in doubt."""

ORDER_FIELDS = ("order", "q", "o")
EMBEDDED_FIELDS = ("embedded_order", "adaptiveorder", "p")
TEXTS = ("comment", "description", "name", "shortname")

NUMBER = rf"(?P<number>\d{{1,2}})(?:st|nd|rd|th)?|(?P<word>{'|'.join(ORDINALS)})"
ANY = rf"(?:\d{{1,2}}(?:st|nd|rd|th)?|{'|'.join(ORDINALS)})"
OTHER_THINGS = "".join(
    rf"(?<!{word}[ -])" for word in ("stage", "linear", "dispersion", "dissipation", "interpolant", "output", "in")
)
ORDINAL = re.compile(rf"\b(?:{NUMBER})[ -]order\b(?! (?:condition|derivative|system|ODE|equation|differential))", re.I)
ORDER_OF = re.compile(rf"{OTHER_THINGS}\border(?: of| is|:| =|=)? ?(\d{{1,2}})\b(?! ?[(/.]\d| conditions)", re.I)
AND = r"(?: ?/ ?| and | or )"
SEVERAL = re.compile(rf"\b{ANY}{AND}{ANY}[ -]order|\border (?:of )?{ANY}{AND}{ANY}\b", re.I)
"""Of `8th and 6th order` nobody knows which is whose."""
PAIR = re.compile(r"(?:\b|(?<=RK)|(?<=DP))(\d{1,2})\( ?(\d{1,2}) ?\)")
EMBEDDED = re.compile(r"embedded|error estimat|lower[- ]order|companion", re.I)
NAMED_PAIR = re.compile(
    r"^(?:RK|RKF|ERK|DP|DOPRI|BS|CK|DormandPrince|CashKarp|BogackiShampine|Fehlberg)_?(\d)_?(\d)$", re.I
)

STAGE_ORDER = re.compile(r"(?<!weak[ -])\bstage[ -]order(?: of| is|:| =|=)? ?(\d)\b", re.I)
KINDS = r"(?: and| or|(?i: symplectic| symmetric| implicit| explicit| diagonally| singly| partitioned)| [A-Z][\w–-]*)"
ONE_METHOD = r"[ -](?:method|integrator|scheme|tableau|rule|formula)\b"
STRUCTURES = {
    "symplectic": re.compile(rf"\b[Ss]ymplectic(?={KINDS}{{0,5}}{ONE_METHOD})"),
    "symmetric": re.compile(rf"\b[Ss]ymmetric(?={KINDS}{{0,5}}{ONE_METHOD})"),
    "SSP": re.compile(r"\b(?:SSP|TVD|[Ss]trong[ -][Ss]tability[ -][Pp]reserving)\b(?!(?: \S+)? (?:method|scheme)s)"),
    "FSAL": re.compile(r"\bFSAL\b"),
}
NEGATED = re.compile(r"\b(?:not|non|no|nor|neither|without|pseudo|conjugate|nearly|almost)(?: an?)?[ -]$", re.I)

DOUBT = r"not?|nor|neither|never|without|at most|below|than|predictor|linear (?:problem|system)s?|start\w*(?: \w+)?"
DOUBTED = re.compile(rf"\b(?:{DOUBT})\b[^.;,\n]{{0,20}}$", re.I)
LOST = re.compile(r" ?(?:is|are|gets) (?:lost|reduced)| only (?:if|for)", re.I)
"""Behind an order, and before it, what says that the method has it in some cases, or not."""


class Claims(NamedTuple):
    """The orders that a source claims.

    Attributes:
        order: The order of the method; None if nothing is said.
        embedded: The order of its second row of weights; None if nothing is said.
        either: Whether the two rows of weights may be exchanged, as in names such as RKF45 and 3(2).
        lower: Whether a method without other weights may have the lower order: the 5 of RK54 may be its stages.
        stage_order: The stage order; None if nothing is said.
        structure: Which of ``symplectic``, ``symmetric``, ``SSP`` and ``FSAL`` are said.
    """

    order: int | None = None
    embedded: int | None = None
    either: bool = False
    lower: bool = False
    stage_order: int | None = None
    structure: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, int]:
        """What is claimed, by name; a structure is True."""
        orders = {"order": self.order, "embedded_order": self.embedded, "stage_order": self.stage_order}
        return {key: x for key, x in orders.items() if x is not None} | dict.fromkeys(self.structure, True)


def claims_of(said: Mapping[str, str], name: str = "") -> Claims:
    """The claims in what a source says of a method: fields, comments and its name; none where that is in doubt.

    Args:
        said: Text by kind: ``order``, ``q``, ``o``, ``embedded_order``, ``adaptiveorder``, ``p``, ``comment``, ….
        name: The name of the method.

    Example:
        >>> from bseries.auditing.claims import claims_of
        >>> claims_of({"comment": "A fifth-order FSAL method with an embedded one of order 4"}).to_dict()
        {'order': 5, 'embedded_order': 4, 'FSAL': True}
        >>> claims_of({}, "RKF45").either, claims_of({"q": "3", "p": "2"}).to_dict()
        (True, {'order': 3, 'embedded_order': 2})
    """
    said = {**_of_call(said.get("call", "")), **said}
    return _orders(said, name)._replace(stage_order=_stage_order(said), structure=tuple(_structures(said)))


def _orders(said: Mapping[str, str], name: str) -> Claims:
    """The orders of the method and of its other weights."""
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
            return Claims(high, low, either=True, lower=True)
    return Claims()


CALL = re.compile(r"(?:RKTableau|Register|SplittingCoefficients)\w*\((.*)\)\s*;?\s*$", re.S)
"""Constructors whose first argument that is a whole number is the order."""


def _of_call(call: str) -> dict[str, str]:
    """The orders among the arguments of a constructor."""
    match = CALL.search(call)
    arguments = [part.strip() for part in match[1].split(",")] if match else []
    whole = [part for part in arguments if part.isdecimal()]
    found = {"order": whole[0]} if whole else {}
    named = dict(re.findall(r"\b(order|adaptiveorder|fsal)\s*=\s*(\d+|true)", call))
    return found | named


def _field(said: Mapping[str, str], keys: tuple[str, ...]) -> int | None:
    """The whole number in the first field that has one."""
    for key in keys:
        text = said.get(key, "").strip()
        if text.isdecimal() and 0 < int(text) <= MOST:
            return int(text)
    return None


def _before_references(text: str) -> str:
    """A text without its list of references, which tells of other methods."""
    return re.split(r"\breferences?\b", text, maxsplit=1, flags=re.I)[0]


def _stage_order(said: Mapping[str, str]) -> int | None:
    """The stage order in a field, or the only one in a text."""
    texts = (_before_references(said.get(key, "")) for key in TEXTS[:2])
    found = {int(match[1]) for text in texts for match in STAGE_ORDER.finditer(text)}
    return _field(said, ("stage_order",)) or (found.pop() if len(found) == 1 else None)


def _structures(said: Mapping[str, str]) -> Iterator[str]:
    """The structures that a field or a text gives the method; SSP by downwind operators is of other methods."""
    text = " ".join(_before_references(said.get(key, "")) for key in TEXTS[:2])
    for name, words in STRUCTURES.items():
        matches = list(words.finditer(text))
        denied = any(NEGATED.search(text[: match.start()]) for match in matches)
        if said.get(name.lower()) == "true" or (matches and not denied and (name != "SSP" or "downwind" not in text)):
            yield name


def _in_text(text: str) -> Claims:
    """The claims of a sentence: a pair 5(4), or one order, and another one behind a word for embedded methods."""
    text = _before_references(text)
    pairs = {(int(a), int(b)) for a, b in PAIR.findall(text) if 0 < int(b) <= MOST and abs(int(a) - int(b)) <= 3}
    if len(pairs) == 1:
        first, second = pairs.pop()
        return Claims(max(first, second), min(first, second), either=True, lower=first < second)
    if SEVERAL.search(text):
        return Claims()
    found: dict[bool, set[int]] = {False: set(), True: set()}
    behind = EMBEDDED.search(text)
    for match in [*ORDINAL.finditer(text), *ORDER_OF.finditer(text)]:
        if DOUBTED.search(text[max(0, match.start() - MOST_BEFORE) : match.start()]) or LOST.match(text, match.end()):
            continue
        number = match[1] if match.re is ORDER_OF else match["number"]
        order = int(number) if number else ORDINALS[match["word"].lower()]
        found[behind is not None and match.start() > behind.start()].add(order)
    own, other = found[False], found[True]
    if len(own) != 1 or len(other) > 1 or not 0 < max(own) <= MOST:
        return Claims()
    return Claims(own.pop(), other.pop() if other else None)
