"""What classes of Python say of tableaus that they name: the order that a method `order` returns."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

from integrators.methods.exchange.records import Record

CLASS = re.compile(r"^class (\w+)", re.M)
TABLEAU = re.compile(r"^ +tableau\b[^=\n]{0,200}=\s*(\w+(?:\(\s*[\w\s,]{1,200}\))?)", re.M)
ORDER = re.compile(r"^ +def order\([^)\n]{0,100}\)[^:\n]{0,50}:\s*(?:del [\w, ]+\s+)?return (\d{1,2})\s*$", re.M)
MOST_CLASSES = 1000


def with_orders_of_classes(records: list[Record], text: str) -> list[Record]:
    """The records of a text of Python, with the orders of classes whose attribute `tableau` is the tableau's name."""
    orders = dict(_orders(text))
    return [
        replace(record, claims={"order": orders[record.name], **record.claims}) if record.name in orders else record
        for record in records
    ]


def _orders(text: str) -> Iterator[tuple[str, str]]:
    """Names of tableaus, and the orders of the classes that have them."""
    starts = [match.start() for match in CLASS.finditer(text)][:MOST_CLASSES]
    for start, end in pairwise([*starts, len(text)]):
        tableau, order = TABLEAU.search(text, start, end), ORDER.search(text, start, end)
        if tableau and order:
            yield from ((name, order[1]) for name in re.findall(r"\w+", tableau[1]))
