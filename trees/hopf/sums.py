"""Formal sums of forests or of tensor products of forests, and their exact coefficients.

Operations work on their terms: dictionaries from tuples of factors to coefficients, which may be zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from functools import reduce
from itertools import chain
from math import prod
from numbers import Rational
from operator import itemgetter, mul
from types import MappingProxyType, NoneType
from typing import Any, ClassVar, Self, TypeAlias, TypeVar

from bseries_base.numbers import latex_number
from bseries_base.table import MOST_ROWS, short_latex
from trees.errors import TreeError
from trees.hopf.forests import Forest, common_names
from trees.tree import Tree

Terms: TypeAlias = Mapping[Any, Any]

MOST_PRODUCTS = 2**20
"""Limit of the pairs of terms multiplied in one operation: about ten seconds and half a gigabyte."""

KEPT = 1024
"""Cached results of each operation, more than there are uncoloured trees with up to nine nodes."""


def add_terms(total: dict[Any, Any], terms: Terms, scale: Any = 1) -> dict[Any, Any]:
    """Add scale · terms to `total`, in place."""
    for factors, coefficient in terms.items():
        total[factors] = total.get(factors, 0) + scale * coefficient
    return total


def multiply_terms(left: Terms, right: Terms) -> dict[Any, Any]:
    """The product of two sums, factor by factor."""
    check_work(len(left) * len(right))
    total: dict[Any, Any] = {}
    for f, a in left.items():
        for g, b in right.items():
            factors = tuple(map(mul, f, g))
            total[factors] = total.get(factors, 0) + a * b
    return total


def check_work(products: int) -> None:
    """Refuse operations that would take too long."""
    if products > MOST_PRODUCTS:
        raise TreeError(f"order must be smaller: this takes more than {MOST_PRODUCTS} products of terms")


class Times:
    """The multiplication of sums of forests of some size, refused once all of it would take too long."""

    def __init__(self, nodes: int, multiply: Callable[[Terms, Terms], Terms] = multiply_terms):
        self._weight, self._multiply, self._work = 1 + nodes // 50, multiply, 0

    def __call__(self, left: Terms, right: Terms) -> Terms:
        """The product."""
        self._work += len(left) * len(right) * self._weight
        check_work(self._work)
        return self._multiply(left, right)


def fold(
    tree: Tree,
    unit: Terms,
    lift: Callable[[Tree, Terms], Terms],
    multiply: Callable[[Terms, Terms], Terms] = multiply_terms,
) -> Terms:
    """The value of a tree: lift(tree, unit · the product of its children's values).

    It is computed from the leaves up, without recursion, and once for equal subtrees.
    """
    values: dict[Tree, Terms] = {}
    times = Times(tree.order, multiply)
    for _, subtree in reversed(list(tree.preorder())):
        if subtree not in values:
            values[subtree] = lift(subtree, reduce(times, (values[child] for child in subtree.children), unit))
    return values[tree]


Factors = tuple[Forest, ...]
Element = Tree | Forest | str | tuple[Tree | Forest | str, ...]
Summand: TypeAlias = "FormalSum | Tree | Forest | str"

Sum = TypeVar("Sum", bound="FormalSum")

MOST_CHARACTERS = 300
"""The most characters of the `repr` of a sum."""


class FormalSum:
    """A linear combination of forests, or of tensor products of equally many forests, with exact coefficients.

    A tree is identified with the forest of one tree. Sums are immutable values. They can be added, multiplied by
    numbers, and multiplied by each other: forests as commutative monomials, tensor products factor by factor. Terms are
    sorted by their factors.

    Args:
        terms: The coefficient of each basis element; or one element, with coefficient 1. An element is a tree, a
            forest, a text for one, or a tuple of two or more of these for their tensor product. A coefficient is an
            int, a Fraction or a SymPy expression without floats.

    Raises:
        TreeError: If an element or a coefficient is none of these, or elements have different numbers of factors.

    Example:
        >>> import bseries as bs
        >>> from fractions import Fraction
        >>> x = bs.hopf.FormalSum({"[τ]": 2, "τ^2": Fraction(-1, 2)})
        >>> x, x["τ·τ"], x["τ"], len(x)
        (-1/2 τ·τ + 2 [τ], Fraction(-1, 2), 0, 2)
        >>> x * x - 4 * bs.hopf.FormalSum("[τ]^2")
        1/4 τ·τ·τ·τ - 2 τ·τ·[τ]
        >>> x.tensor(bs.Tree("τ"))
        -1/2 τ·τ⊗τ + 2 [τ]⊗τ
    """

    __slots__ = ("_terms",)
    __array_ufunc__ = None  # so that NumPy integers do not treat a sum as a sequence

    forest: ClassVar[Any] = Forest  # the kind of forests, and of their trees: those of a subclass may be others
    tree: ClassVar[Any] = Tree

    _terms: dict[Factors, Any]

    def __new__(cls, terms: Mapping[Any, object] | FormalSum | Element | None = None) -> Self:
        """Check the terms and add those of equal elements."""
        if type(terms) is cls:
            return terms
        if isinstance(terms, (cls.tree, cls.forest, str, tuple)):
            return cls.from_terms({cls._factors(terms): 1})
        if not isinstance(terms, Mapping | NoneType):
            raise TreeError(f"terms must be a mapping from forests to coefficients, but was {terms!r:.60}")
        added: dict[Factors, Any] = {}
        for element, coefficient in (terms or {}).items():
            add_terms(added, {cls._factors(element): exact_coefficient(coefficient)})
        _check_alike("terms", added)
        return cls.from_terms(added)

    @classmethod
    def from_terms(cls, terms: Mapping[Factors, Any]) -> Self:
        """The sum of terms whose keys are tuples of equally many forests, without zero coefficients."""
        total = object.__new__(cls)
        exact = ((factors, exact_coefficient(coefficient)) for factors, coefficient in terms.items())
        total._terms = {factors: coefficient for factors, coefficient in exact if coefficient != 0}
        return total

    @property
    def terms(self) -> Mapping[Factors, Any]:
        """The coefficient of each tuple of tensor factors, unsorted."""
        return MappingProxyType(self._terms)

    @property
    def factors(self) -> int:
        """The number of tensor factors of each term; 0 for the empty sum."""
        return len(next(iter(self._terms), ()))

    def items(self) -> Iterator[tuple[Any, Any]]:
        """Each basis element, a `Forest` or a tuple of them, with its coefficient, in ascending order.

        Example:
            >>> import bseries as bs
            >>> list(bs.hopf.FormalSum({("τ", "∅"): 3}).items())
            [((Forest('τ'), Forest('∅')), 3)]
        """
        for factors, coefficient in self._sorted():
            yield _element(factors), coefficient

    def _sorted(self) -> list[tuple[Factors, Any]]:
        return sorted(self._terms.items(), key=itemgetter(0))

    def __iter__(self) -> Iterator[Any]:
        return (element for element, _ in self.items())

    def __len__(self) -> int:
        return len(self._terms)

    def __contains__(self, element: Element) -> bool:
        return self._factors(element) in self._terms

    def __getitem__(self, element: Element) -> Any:
        return self._terms.get(self._factors(element), 0)

    def __add__(self, other: FormalSum | Tree | Forest) -> Self:
        if type(other) is int and other == 0:  # the start of sum()
            return self
        if not self.takes(other):
            return NotImplemented
        added = type(self)(other)
        self._check_factors(added)
        return self.from_terms(add_terms(dict(self._terms), added._terms))

    __radd__ = __add__

    def __neg__(self) -> Self:
        return self * -1

    def __sub__(self, other: FormalSum | Tree | Forest) -> Self:
        if not self.takes(other):
            return NotImplemented
        return self + -type(self)(other)

    def __rsub__(self, other: Tree | Forest) -> Self:
        return -self + other

    def __mul__(self, other: Any) -> Self:
        if self.takes(other):
            factor = type(self)(other)
            self._check_factors(factor)
            return self.from_terms(multiply_terms(self._terms, factor._terms))
        scale = exact_coefficient(other)
        return self.from_terms({factors: coefficient * scale for factors, coefficient in self._terms.items()})

    __rmul__ = __mul__

    def __truediv__(self, divisor: Any) -> Self:
        scale = exact_coefficient(divisor)
        if scale == 0:
            raise TreeError("divisor must not be zero, but was 0")
        return self * (Fraction(1) / scale)

    @classmethod
    def takes(cls, x: object) -> bool:
        """Whether an operand is a tree, a forest or a sum of the same kind."""
        return type(x) is cls or isinstance(x, (cls.tree, cls.forest))

    @classmethod
    def _factors(cls, element: Any) -> Factors:
        """A basis element as the tuple of its tensor factors."""
        if not isinstance(element, tuple):
            parts = (element,)
        elif len(element) > 1:
            parts = element
        else:
            raise TreeError(f"element must have two or more tensor factors to be a tuple, but was {element!r:.60}")
        for part in parts:
            if not isinstance(part, (cls.tree, cls.forest, str)):
                raise TreeError(f"element must be a tree, a forest, or a tuple of these, but was {element!r:.60}")
        return tuple([cls.forest(part) for part in parts])

    def _check_factors(self, other: FormalSum) -> None:
        if self and other and self.factors != other.factors:
            raise TreeError(
                f"other must have terms of {self.factors} tensor factors, as the first sum has, but has {other.factors}"
            )

    def tensor(self, other: Summand) -> Self:
        """The tensor product with another sum.

        Args:
            other: The right factor: a sum, forest, tree or tuple of forests.

        Raises:
            TreeError: If `other` is none of these, or there are too many terms.

        Example:
            >>> import bseries as bs
            >>> bs.hopf.FormalSum("τ").tensor("[τ]").tensor("∅")
            τ⊗[τ]⊗∅
        """
        right = as_sum(other, "other", type(self), tensors=True)._terms
        check_work(len(self._terms) * len(right))
        return self.from_terms({f + g: a * b for f, a in self._terms.items() for g, b in right.items()})

    def map(self, rule: Callable[[Any], Any]) -> Self:
        """The linear extension of a map of basis elements.

        Args:
            rule: Returns a sum, forest, tree, or tuple of forests for each element, a `Forest`, or a tuple of forests
                in a sum of tensor products.

        Raises:
            TreeError: If the rule returns anything else, or elements with different numbers of factors.

        Example:
            >>> import bseries as bs
            >>> bs.hopf.FormalSum({("τ", "[τ]"): 2}).map(lambda pair: pair[0] * pair[1])
            2 τ·[τ]
        """
        total: dict[Factors, Any] = {}
        for factors, coefficient in self._terms.items():
            image = as_sum(rule(_element(factors)), "rule(element)", type(self), tensors=True)
            add_terms(total, image._terms, coefficient)
        _check_alike("rule(element)", total)
        return self.from_terms(total)

    def evaluate(self, *rules: Callable[[Tree], Any]) -> Any:
        """The value Σ coefficient · Π rule(tree) of a linear multiplicative functional.

        Args:
            rules: One rule, tree → number, for each tensor factor; that of a series is `series.__getitem__`.

        Returns:
            The value: 0 for the empty sum, 1 for the empty forest.

        Raises:
            TreeError: If there are not as many rules as factors.

        Example:
            >>> import bseries as bs
            >>> bs.hopf.FormalSum({("τ^2", "[τ]"): 3}).evaluate(lambda tree: 10, lambda tree: tree.order)
            600
        """
        if self and len(rules) != self.factors:
            raise TreeError(f"rules must be as many as tensor factors, {self.factors}, but were {len(rules)}")
        return sum(
            coefficient * prod(rule(tree) for rule, forest in zip(rules, factors, strict=True) for tree in forest)
            for factors, coefficient in self._terms.items()
        )

    def text(self, names: Iterable[str] | None = None) -> str:
        """The sum as text, unique for each sum with rational coefficients.

        Terms ascend, with ``·`` between trees and ``⊗`` between tensor factors. The argument and the errors are those
        of `Tree.text`.

        Example:
            >>> import bseries as bs
            >>> bs.hopf.FormalSum({("q", "p[q]"): -2}).text(["fast", "slow"])
            '-2 slow⊗fast[slow]'
        """
        common = self._names(names)
        return write_sum((c, "⊗".join([forest.text(common) for forest in factors])) for factors, c in self._sorted())

    def to_latex(self, names: Iterable[str] | None = None) -> str:
        r"""The sum in LaTeX; the argument is that of `text`.

        Example:
            >>> import bseries as bs
            >>> print((bs.hopf.FormalSum({("τ", "[τ]"): 1}) / 2).to_latex())
            \frac{1}{2} \tau \otimes [\tau]
        """
        common = self._names(names)
        terms = (
            (c, " \\otimes ".join([forest.to_latex(common) for forest in factors])) for factors, c in self._sorted()
        )
        return write_sum(terms, latex_number)

    def _names(self, names: Iterable[str] | None) -> tuple[str, ...]:
        return common_names((tree for factors in self._terms for tree in chain(*factors)), names)

    def _repr_latex_(self) -> str | None:
        return short_latex(self.to_latex()) if len(self) <= MOST_ROWS else None

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        text = self.text() if len(self) <= MOST_ROWS else ""
        return text if 0 < len(text) <= MOST_CHARACTERS else f"<{type(self).__name__} of {len(self):,} terms>"

    def __hash__(self) -> int:
        return hash(frozenset(self._terms))  # without coefficients: equal SymPy expressions can have different forms

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, FormalSum) or type(other) is not type(self):
            return NotImplemented
        return self._terms.keys() == other._terms.keys() and (self._terms == other._terms or not self - other)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self.items()),)


def as_sum(x: Any, name: str, kind: type[Sum] = FormalSum, *, tensors: bool = False) -> Sum:
    """An argument as a formal sum of forests of a kind, or of tensor products if allowed."""
    if kind.takes(x) or isinstance(x, str) or (tensors and isinstance(x, tuple)):
        total = kind(x)
        if tensors or total.factors <= 1:
            return total
    raise TreeError(f"{name} must be a tree, a forest or a sum of forests, but was {x!r:.60}")


def _element(factors: Factors) -> Any:
    """A basis element, a `Forest` if there is one factor."""
    (forest, *others) = factors
    return factors if others else forest


def _check_alike(argument: str, terms: Iterable[Factors]) -> None:
    shapes = sorted({len(factors) for factors in terms})
    if len(shapes) > 1:
        raise TreeError(f"{argument} must have equally many tensor factors, but had {shapes[0]} and {shapes[1]}")


def exact_coefficient(value: Any) -> Any:
    """A coefficient in its narrowest exact type: int, Fraction, or an expanded SymPy expression."""
    if type(value) is int:
        return value
    if isinstance(value, Rational) and not isinstance(value, bool):
        numerator, denominator = int(value.numerator), int(value.denominator)
        return numerator if denominator == 1 else Fraction(numerator, denominator)
    if type(value).__module__.startswith("sympy."):
        import sympy

        usable = isinstance(value, sympy.Expr) and value.is_finite is not False and value.is_commutative is not False
        if usable and not value.has(sympy.Float, sympy.nan):
            expanded = sympy.expand(value)
            if isinstance(expanded, sympy.Rational):
                return exact_coefficient(Fraction(int(expanded.p), int(expanded.q)))
            return 0 if expanded.equals(0) else expanded
    raise TreeError(f"coefficient must be an int, a Fraction or an exact SymPy expression, but was {value!r:.60}")


def write_sum(terms: Iterable[tuple[Any, str]], number: Callable[[Any], str] = str) -> str:
    """The text of a sum of terms, given by coefficients and texts."""
    parts = []
    for coefficient, text in terms:
        scale = number(coefficient)
        if getattr(coefficient, "is_Add", False):
            scale = f"({scale})"
        parts.append("-" if scale.startswith("-") else "+")
        scale = scale.removeprefix("-").lstrip()
        parts.append(text if scale == "1" else f"{scale} {text}")
    if not parts:
        return "0"
    return ("-" if parts[0] == "-" else "") + " ".join(parts[1:])
