"""Reader of linear combinations of elementary differentials, such as ``h/2 f'f + theta*f''(f,f'f)``.

    differential = "f" | "f'" differential | "f'" {"'"} "(" differential {"," differential} ")"

A derivative of order k has k arguments. Coefficients are formulas, read by the parser of formulas; the sign * beside a
differential may be left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NoReturn

from bseries.exceptions import SeriesError
from integrators.core.errors import IntegratorError, shorten
from integrators.exact.expressions import ELEMENTARY, parse_expression
from trees import Tree

if TYPE_CHECKING:
    import sympy

START = re.compile(r"(?<![^\W\d])f(?!\w)")
"""An f that is no part of a name; a number may stand before it."""
PRIMES = str.maketrans("’′", "''", "")
MOST_NODES = 12
"""Of a differential."""


def differential_symbol(tree: Tree) -> sympy.Symbol:
    """The symbol that stands for the elementary differential of a tree in formulas."""
    import sympy

    return sympy.Symbol("F" + "_".join(map(str, tree.levels)))


def read_differentials(text: str, *, names: Iterable[str] = (), argument: str = "formula") -> sympy.Expr:
    """A combination of elementary differentials as a formula in their symbols (`differential_symbol`).

    Args:
        text: The combination.
        names: The symbols in coefficients.
        argument: The name of the text in messages.

    Raises:
        SeriesError: The text is no linear combination of elementary differentials.

    Example:
        >>> formula = read_differentials("h/2 f'f - (1/3)*f''(f, f'(f))", names=["h"])
        >>> formula
        F0_1*h/2 - F0_1_1_2/3
        >>> formula.coeff(differential_symbol(Tree("[τ,[τ]]")))
        -1/3
    """
    import sympy

    reader = _Reader(text.translate(PRIMES), argument)
    written = reader.written()
    try:
        formula = parse_expression(written, names=[*names, *reader.trees], functions=ELEMENTARY, argument=argument)
    except IntegratorError as error:
        raise SeriesError(reader.in_words(str(error))) from None
    symbols = tuple(map(sympy.Symbol, reader.trees))
    if formula.xreplace(dict.fromkeys(symbols, 0)) != 0 or any(formula.diff(f).has(*symbols) for f in symbols):
        raise SeriesError(
            f"{argument} must be a sum of numbers times elementary differentials such as f'f, but was {shorten(text)!r}"
        )
    return formula


def combination(coefficients: Mapping[Tree, Any]) -> sympy.Expr:
    """The formula of Σ c(τ) F(τ) in the symbols of elementary differentials."""
    import sympy

    return sympy.Add(*(sympy.sympify(c, strict=True) * differential_symbol(tree) for tree, c in coefficients.items()))


class _Reader:
    """The differentials of a text, each replaced by its symbol."""

    def __init__(self, text: str, argument: str):
        self.text, self.argument, self.place = text, argument, 0
        self.trees: dict[str, Tree] = {}

    def written(self) -> str:
        """The text with symbols for differentials, and with signs * beside them."""
        written, end = "", 0
        for match in START.finditer(self.text):
            if match.start() < end:  # inside the last one
                continue
            written += self.text[end : match.start()]
            self.place = match.start()
            tree = self.differential()
            end, name = self.place, differential_symbol(tree).name
            self.trees[name] = tree
            before = "*" if re.search(r"[\w).]\s*$", written) else ""
            after = "*" if re.match(r"\s*[\w(.]", self.text[end:]) else ""
            written += before + name + after
        return written + self.text[end:]

    def differential(self) -> Tree:
        """The tree of the differential that begins here."""
        self.skip("f")
        primes = 0
        while self.next() == "'":
            self.place += 1
            primes += 1
        if primes == 0:
            return Tree("τ")
        if primes == 1 and self.next() == "f":
            children = [self.differential()]
        else:
            self.skip("(")
            children = [self.differential()]
            while self.next() == ",":
                self.place += 1
                children.append(self.differential())
            self.skip(")")
        tree = Tree.join(children)
        if len(children) != primes:
            self.refuse(f"has a derivative of order {primes} with {len(children)} arguments")
        if tree.order > MOST_NODES:
            self.refuse(f"has a differential with more than {MOST_NODES} factors f")
        return tree

    def next(self) -> str:
        """The next character that is no space."""
        while self.text[self.place : self.place + 1].isspace():
            self.place += 1
        return self.text[self.place : self.place + 1]

    def skip(self, sign: str) -> None:
        """Go past a character, which must be the next one."""
        if self.next() != sign:
            self.refuse(f"has {self.next() or 'its end'!r} where {sign!r} is expected at position {self.place + 1}")
        self.place += 1

    def refuse(self, problem: str) -> NoReturn:
        """Raise an error that quotes the text."""
        raise SeriesError(
            f"{self.argument} must be a sum of elementary differentials, but {shorten(self.text)!r} {problem}"
        )

    def in_words(self, message: str) -> str:
        """A message of the parser with differentials in place of their symbols."""
        for name in sorted(self.trees, key=len, reverse=True):
            message = message.replace(name, self.trees[name].differential())
        return message
