"""`Series`: truncated series on a basis, as mappings from its elements to coefficients."""

from __future__ import annotations

import math
from collections.abc import Callable, ItemsView, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache
from itertools import chain, islice
from typing import TYPE_CHECKING, Any, Self

from bseries.algebra import presentation
from bseries.algebra.presentation import SeriesTerm
from bseries.exact import lie
from bseries.exact.domains import RingValues, Values, alike, as_floats, exact_number, make_values
from bseries.exceptions import SeriesError
from bseries_base.table import MOST_ROWS, Column, LazyRows, Table, Tabular, listed, short_latex
from integrators.core.immutable import ImmutableValue
from trees.basis import Basis
from trees.counting import check_order
from trees.errors import TreeError
from trees.notation import check_names

if TYPE_CHECKING:
    from bseries.algebra.uncertainty import Uncertainty
    from bseries.exact.domains import Coefficient

EMPTY = "∅"


class Series(ImmutableValue, Tabular, Mapping[Any, Any]):
    """A series on a basis of graded objects, up to some number of nodes: rooted trees (`BSeries`), words, …

    A *flow* has the coefficient 1 of the empty object, a *field* 0. With the Lie derivative along a field, a sum over
    the cuts of each object (`trees.basis`), flows have logarithms, powers, inverses and compositions, and fields have
    exponentials and brackets. The mapping iterates over the objects in the order of the basis; ``s["∅"]`` is the
    coefficient of the empty one, excluded from iteration and `len`.

    A series of a method published as decimals has `digits` and an `uncertainty`, and so has its logarithm. Results of
    other arithmetic on it have digits only: it treats the printed decimals as exact, and the results are shown rounded.

    Series are immutable. `stored` holds the coefficients in the form of `bseries.exact.domains`. `kind` is what tables
    and documents call the series: ``series``, ``field``, ``modified`` or ``modifying``.

    Example:
        >>> import bseries as bs
        >>> from fractions import Fraction
        >>> words = bs.trees.Words(3, colors=2)
        >>> first = bs.algebra.Series.of(words, lambda word: Fraction(len(word) == 1, 2), empty=0).exp()
        >>> first["p q"], first.log()["p q"], (first**2)["p q"]
        (Fraction(1, 8), Fraction(0, 1), Fraction(1, 2))
    """

    basis: Basis[Any]
    stored: Values
    empty: Any
    names: tuple[str, ...]
    label: str
    kind: str
    digits: int | None
    uncertainty: Uncertainty | None

    def __init__(
        self,
        basis: Basis[Any],
        values: Values,
        empty: Coefficient,
        *,
        names: Sequence[str] = (),
        label: str = "",
        kind: str | None = None,
        digits: int | None = None,
        uncertainty: Uncertainty | None = None,
    ):
        empty = exact_number(empty)
        names = check_names(names) if names and any(basis.names) else basis.names
        if len(names) != basis.colors:
            raise SeriesError(f"names must be {basis.colors} names, one for each colour, but were {len(names)}")
        kind = kind or ("field" if empty == 0 else "series")
        self.__dict__.update(basis=basis, stored=values, empty=empty, names=names, label=label, kind=kind)
        self.__dict__.update(digits=digits, uncertainty=uncertainty)

    def __copy__(self) -> Self:
        return self

    def __deepcopy__(self, memo: object) -> Self:
        return self

    @classmethod
    def of(
        cls, basis: Basis[Any], rule: Callable[[Any], object], *, empty: object = 1, names: Sequence[str] = ()
    ) -> Self:
        """The series on a basis with the coefficients rule(element).

        Args:
            basis: The basis.
            rule: A function from elements to numbers (int, Fraction, float) or SymPy expressions.
            empty: Coefficient of the empty element: 1 for a flow, 0 for a field.
            names: Names of the letters, or colours.

        Raises:
            SeriesError: `basis` is none, or a value is not a finite number or expression.
        """
        if not isinstance(basis, Basis):
            raise SeriesError(f"basis must be a basis, such as trees.Words(3), but was {basis!r:.60}")
        return cls(basis, make_values(basis, map(rule, basis)), exact_number(empty), names=names)

    @property
    def order(self) -> int:
        """Largest number of nodes."""
        return self.basis.max_order

    @property
    def domain(self) -> str:
        """The smallest domain that holds all coefficients: ``QQ``, ``RR``, ``QQ<sqrt(3)>``, ``QQ[gamma]``, …"""
        return self.stored.name

    @property
    def is_exact(self) -> bool:
        """Whether the coefficients are exact, not floats."""
        return self.stored.kind != "float"

    def __getitem__(self, tree: Any) -> Any:
        if isinstance(tree, str) and tree.strip() == EMPTY:
            return self.empty
        return self.stored[self.id_of(tree)]

    def id_of(self, tree: Any) -> int:
        """The id of an element, or of one given as text in the names of this series.

        Raises:
            TreeError: The text is no element, or the element is not in the basis.
        """
        return self.basis.index(self.basis.read(tree, self.shown_names) if isinstance(tree, str) else tree)

    @property
    def shown_names(self) -> tuple[str, ...] | None:
        """The names of the colours in texts; None where they have none: trees of one colour."""
        return self.names if any(self.names) else None

    def __contains__(self, tree: object) -> bool:
        try:
            return tree != EMPTY and self.id_of(tree) >= 0
        except TreeError:  # no text of an element, or not in the basis
            return False

    def get(self, tree: Any, default: Any = None) -> Any:
        """The coefficient of a tree, or `default` for trees beyond the series."""
        return self[tree] if tree in self or str(tree).strip() == EMPTY else default

    def __iter__(self) -> Iterator[Any]:
        return iter(self.basis)

    def __len__(self) -> int:
        return len(self.basis)

    def items(self) -> ItemsView[Any, Any]:
        """Pairs (element, coefficient) in the order of the basis."""
        return _Items(self)

    def coefficients(self) -> list[Any]:
        """All coefficients in the order of the basis."""
        return self.stored.coefficients()

    values = coefficients  # pyright: ignore[reportAssignmentType]

    def is_zero(self, tree: Any) -> bool:
        """Whether a coefficient is zero, for decimals within their uncertainty."""
        return self.is_zero_at(self.id_of(tree))

    def is_zero_at(self, at: int) -> bool:
        """`is_zero` for the tree with this id."""
        return self.stored.is_zero(at) or self.may_be(at, 0)

    def may_be(self, at: int, value: Any) -> bool:
        """Whether a coefficient of a method in decimals is a number, within its uncertainty."""
        return self.uncertainty is not None and abs(self.stored[at] - value) <= self.uncertainty(at)

    def nonzero(self) -> list[tuple[Any, Any]]:
        """Pairs (tree, coefficient) with nonzero coefficients (see `is_zero`)."""
        return [(self.basis[at], value) for at, value in enumerate(self.coefficients()) if not self.is_zero_at(at)]

    def weights(self) -> list[Any]:
        """Coefficient/σ of every tree, the factor of its elementary differential; 0 where `is_zero`."""
        pairs = enumerate(zip(self.coefficients(), self.basis.symmetries, strict=True))
        return [0 if self.is_zero_at(at) else value / sigma for at, (value, sigma) in pairs]

    def truncate(self, order: int) -> Self:
        """The series restricted to trees with at most `order` nodes.

        Raises:
            SeriesError: `order` is larger than this series' order.
        """
        if check_order(order) > self.order:
            raise SeriesError(f"order must be at most {self.order}, the order of the series, but was {order}")
        basis = self.basis.truncated(order)
        errors = self.uncertainty and self.uncertainty.mapped(range(len(basis)))
        return self._replace(basis=basis, stored=self.stored.truncated(basis), uncertainty=errors)

    def _replace(self, **changes: Any) -> Self:
        """The series with other values of some attributes."""
        series = object.__new__(type(self))
        series.__dict__.update(self.__dict__, **changes)
        return series

    def with_empty(self, empty: object) -> Self:
        """The same series with another coefficient of the empty tree."""
        return type(self)(self.basis, self.stored, exact_number(empty), names=self.names, digits=self.digits)

    def with_label(self, label: str, kind: str | None = None) -> Self:
        """The same series under another name, and as another kind of those in `presentation.KINDS` if one is given."""
        if kind is not None and kind not in presentation.KINDS:
            raise SeriesError(f"kind must be one of {', '.join(presentation.KINDS)}, but was {kind!r:.60}")
        return self._replace(label=label, kind=kind or self.kind)

    def to_float(self) -> Self:
        """The series with every coefficient rounded to the nearest float.

        Raises:
            SeriesError: A coefficient holds symbols.
        """
        return self._replace(stored=as_floats(self.stored))

    def check_same_basis(self, other: Series) -> None:
        """Raise a SeriesError unless the other series has the same basis."""
        if self.basis != other.basis:
            raise SeriesError(
                f"both series must have the same {self.basis.what}, but were on {self.basis!r} and {other.basis!r}; "
                "use truncate(order) for a common order"
            )
        if self.names != other.names:
            raise SeriesError(f"both series must name their colours alike, but have {self.names} and {other.names}")

    def _combine(self, other: object, function: Callable[[Any, Any], Any]) -> Any:
        if not isinstance(other, Series):
            return NotImplemented
        self.check_same_basis(other)
        return self._with_numbers(map(function, self._numbers(), other._numbers()), fewest_digits(self, other))

    def _map(self, function: Callable[[Any], Any]) -> Self:
        return self._with_numbers(map(function, self._numbers()), self.digits)

    def _numbers(self) -> list[Any]:
        """All coefficients, that of the empty tree first."""
        return [self.empty, *self.coefficients()]

    def _with_numbers(self, numbers: Iterable[Any], digits: int | None) -> Self:
        try:
            empty, *values = numbers
            stored = make_values(self.basis, values)
        except OverflowError:
            raise SeriesError("coefficients must stay within the range of floats, but some overflowed") from None
        return type(self)(self.basis, stored, empty, names=self.names, digits=digits)

    __array_ufunc__ = None  # a NumPy number times a series is a series

    def __add__(self, other: Self) -> Self:
        return self._combine(other, lambda x, y: x + y)

    def __radd__(self, other: object) -> Any:
        return self if other == 0 else NotImplemented  # the start value of `sum`

    def __sub__(self, other: Self) -> Self:
        return self._combine(other, lambda x, y: x - y)

    def __neg__(self) -> Self:
        return self._map(lambda x: -x)

    def __mul__(self, number: object) -> Self:
        if isinstance(number, Series):
            raise SeriesError("number must be a number, but was a series; compose(a, b) applies a and then b")
        factor: Any = exact_number(number, "number")
        return self._map(lambda x: x * factor)

    __rmul__ = __mul__

    def __truediv__(self, number: object) -> Self:
        divisor: Any = exact_number(number, "number")
        if divisor == 0:
            raise SeriesError("number must not be zero to divide by")
        return self._map(lambda x: x / divisor)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            return NotImplemented
        if self.basis != other.basis or self.names != other.names or self.empty != other.empty:
            return False
        if "ring" in (self.stored.kind, other.stored.kind):
            mine, others = alike([self.stored, other.stored])
            return all(mine.equals_at(others, at) for at in range(len(self)))
        return self.coefficients() == other.coefficients()

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        of = f" of {self.label}" if self.label else ""
        return f"<{type(self).__name__}{of}: {len(self)} {self.basis.what} to order {self.order}, {self.domain}>"

    def scale_step(self, factor: object) -> Self:
        """The series with h replaced by factor · h: a(τ) becomes factor^|τ| a(τ).

        Example:
            >>> import bseries as bs
            >>> from fractions import Fraction
            >>> bs.exact_flow(3).scale_step(Fraction(1, 2)) == bs.exact_flow(3) ** Fraction(1, 2)
            True
        """
        number: Any = exact_number(factor, "factor")
        if isinstance(self.stored, RingValues) and not isinstance(number, float):
            return type(self)(
                self.basis, self.stored.scaled_step(number), self.empty, names=self.names, digits=self.digits
            )
        power = cache(lambda n: number**n)
        pairs = zip(self.coefficients(), self.basis.orders, strict=True)
        return self._with_numbers(chain([self.empty], (x * power(n) for x, n in pairs)), self.digits)

    def log(self) -> Self:
        """The modified equation: the field whose exact flow is this series.

        Returns:
            b with b(∅) = 0 and exp b = a.

        Raises:
            SeriesError: a(∅) is not 1.

        Example:
            >>> import bseries as bs
            >>> bs.exact_flow(4).log() == bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 4, empty=0)
            True

        References:
            HLW, theorem IX.9.2.
        """
        check_flow(self)
        errors = self.uncertainty and self.uncertainty.of_logarithm(self.basis, self.coefficients)
        return self._made(self._logarithm(), 0)._replace(uncertainty=errors)

    def _made(self, stored: Values, empty: int) -> Self:
        """A series that is made of this one alone."""
        return type(self)(self.basis, stored, empty, names=self.names, digits=self.digits)

    def _logarithm(self) -> Values:
        """The coefficients of the logarithm."""
        return lie.logarithm(self.stored)

    def _power(self, s: Fraction) -> Values:
        """The coefficients of a power."""
        return lie.power(self.stored, s)

    def exp(self) -> Self:
        """The exact flow of this field over one step.

        Returns:
            a with a(∅) = 1 and log a = b.

        Raises:
            SeriesError: b(∅) is not 0.

        Example:
            >>> import bseries as bs
            >>> bs.BSeries.from_rule(lambda tree: int(tree.order == 1), 4, empty=0).exp() == bs.exact_flow(4)
            True

        References:
            HLW, lemma IX.9.1 and equation (IX.9.7).
        """
        check_field(self)
        return self._made(lie.exponential(self.stored), 1)

    def inverse(self) -> Self:
        """The series of the inverse map.

        Raises:
            SeriesError: a(∅) is not 1.

        Example:
            >>> import bseries as bs
            >>> a = bs.series(bs.method("rk4"), 5)
            >>> bs.compose(a, a.inverse()) == bs.BSeries.from_rule(lambda tree: 0, 5)
            True
        """
        check_flow(self)
        return self._made(self._power(Fraction(-1)), 1)

    def adjoint(self) -> Self:
        """The series of the adjoint method Φ*_h = (Φ_{−h})^{−1}.

        Raises:
            SeriesError: a(∅) is not 1.

        Example:
            >>> import bseries as bs
            >>> bs.series(bs.method("explicit-euler"), 4).adjoint() == bs.series(bs.method("implicit-euler"), 4)
            True

        References:
            HLW, definition II.3.1.
        """
        return self.scale_step(-1).inverse()

    def __pow__(self, exponent: object) -> Self:
        """a^s = exp(s log a): s steps of a method, for any real number (or symbol) s.

        Args:
            exponent: An integer, a Fraction, a SymPy expression, or a float.

        Returns:
            The flow a^s; two steps of a^(1/2) are one step of a.

        Raises:
            SeriesError: a(∅) is not 1, or the exponent is no number.

        Example:
            >>> import bseries as bs
            >>> from fractions import Fraction
            >>> a = bs.series(bs.method("rk4"), 5)
            >>> a**2 == bs.compose(a, a), (a ** Fraction(1, 2)) ** 2 == a
            (True, True)
        """
        check_flow(self)
        s: Any = exact_number(exponent, "exponent")
        if not isinstance(s, Fraction):
            return (self.log() * s).exp()
        if s == -1:
            return self.inverse()
        return self._made(self._power(s), 1)

    def terms(self, *, nonzero: bool = False) -> Iterator[SeriesTerm]:
        """The terms in the order of the basis; `weight` is coefficient/σ."""
        for at, (coefficient, symmetry) in enumerate(zip(self.coefficients(), self.basis.symmetries, strict=True)):
            zero = self.is_zero_at(at)
            if not (nonzero and zero):
                digits, error = self.digits, 0.0 if not (self.uncertainty and coefficient) else self.uncertainty(at)
                if digits is not None and error:
                    digits = max(1, min(digits, 1 + math.floor(math.log10(abs(coefficient) / error))))
                yield SeriesTerm(self.basis, coefficient, coefficient / symmetry, zero, digits, symmetry, at)

    def term_fields(self) -> dict[str, Callable[[SeriesTerm], Any]]:
        """What JSON and CSV hold of a term, by key."""
        basis, names = self.basis, self.shown_names
        return {
            basis.what[:-1]: lambda term: basis.text(term.element, names),
            "order": lambda term: basis.order_of(term.at),
            "symmetry": lambda term: term.symmetry,
            "coefficient": lambda term: term.coefficient_text,
            "weight": lambda term: term.weight_text,
        }

    def term_columns(self) -> list[Column]:
        """The columns of the table of the terms."""
        what, fields = self.basis.what[:-1], self.term_fields()
        return [Column(key, key == "order", fields[key]) for key in ("order", what, "coefficient", "weight")]

    def to_dict(self, *, nonzero: bool = False) -> dict[str, Any]:
        """The series as JSON-ready data, which `load_series` reads.

        Args:
            nonzero: Leave out terms with coefficient zero.

        Returns:
            The keys schema, kind, basis (for other series than those on trees), method, order, domain, colors,
            max_children (on trees), empty, nonzero, digits (for decimal methods) and terms, each term with its element
            as text and in other forms, order, symmetry, coefficient and weight. For decimal methods a term also has
            the value before rounding, ``exact``, and its uncertainty, ``error``.

        Example:
            >>> import bseries as bs
            >>> data = bs.modified_equation(bs.method("explicit-euler"), 2).to_dict()
            >>> data["terms"][1]["tree"], data["terms"][1]["coefficient"]
            ('[τ]', '-1/2')
        """
        data: dict[str, Any] = {
            "schema": 1,
            "kind": self.kind,
            "method": self.label,
            "order": self.order,
            "domain": self.domain,
            "colors": list(self.names),
            **self.basis.restriction,
            "empty": str(self.empty),
            "nonzero": nonzero,
        }
        fields = self.term_fields()
        if self.digits is not None:
            data["digits"] = self.digits
            fields["exact"] = lambda term: str(term.coefficient)
        if (error := self.uncertainty) is not None:
            fields["error"] = lambda term: error(term.at)
        data["terms"] = [{key: get(term) for key, get in fields.items()} for term in self.terms(nonzero=nonzero)]
        return data

    def to_latex(self) -> str:
        """The series as a sum of weights times powers of h times elementary differentials, without terms that are zero.

        A field is written as the modified equation f_h, without the factor h. The sum is one line; that of
        ``to_table().to_latex()`` breaks where it is long.

        Example:
            >>> import bseries as bs
            >>> print(bs.modified_equation(bs.method("explicit-euler"), 2).to_latex())
            f - \\frac{1}{2} h\\, f'(f)
        """
        return presentation.to_latex(self.terms(nonzero=True), self.empty, self._differential)

    def _display(self) -> str:
        return presentation.display(self.terms(nonzero=True), self.empty, self._differential)

    def _differential(self, term: SeriesTerm) -> tuple[int, str]:
        """The number of nodes of a term and its elementary differential in LaTeX."""
        return self.basis.order_of(term.at), self.basis.latex(term.element, self.shown_names)

    def _repr_latex_(self) -> str | None:
        terms = (term for term in islice(self.terms(), MOST_ROWS) if not term.is_zero)
        dots = r" + \cdots" if len(self) > MOST_ROWS else ""
        return short_latex(presentation.to_latex(terms, self.empty, self._differential) + dots)

    def to_table(self, *, nonzero: bool = False, as_float: bool = False) -> Table:
        """The terms as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            nonzero: Leave out terms whose coefficient is zero.
            as_float: Round exact coefficients to floats.

        Example:
            >>> import bseries as bs
            >>> print(bs.modified_equation("explicit-euler", 2).to_table().to_text())
            Modified equation of explicit-euler: trees with 1 to 2 nodes, powers h^0 to h^1
            <BLANKLINE>
            |τ|  tree τ  coefficient  weight  F(τ)
            ───  ──────  ───────────  ──────  ─────
              1  τ       1            1       f
            <BLANKLINE>
              2  [τ]     -1/2         -1/2    f'(f)
            <BLANKLINE>
            y' = f_h(y) with f_h = Σ h^(|τ|-1) · weight(τ) · F(τ); weight = coefficient/σ
            Exact coefficients, in QQ.
        """
        shown = self.to_float() if as_float else self
        fields, rows = shown.term_fields(), LazyRows(lambda: shown.terms(nonzero=nonzero), len(self))
        notes = presentation.number_notes(
            shown.domain, shown.digits, self.basis.what, nonzero=nonzero, as_float=as_float
        )
        return Table(
            presentation.title(self.kind, self.label, self.order, self.basis.what, self.basis.unit),
            shown.term_columns(),
            rows,
            [presentation.meaning(self.kind, self.basis.what), *notes],
            data=lambda: shown.to_dict(nonzero=nonzero),
            items="terms",
            section=fields["order"],
            records=listed(fields.items(), rows),
            own={"latex": lambda width: shown._display()},
        )


class _Items(ItemsView[Any, Any]):
    """Items without a look-up for each tree."""

    _mapping: Series

    def __iter__(self) -> Iterator[tuple[Any, Any]]:
        return zip(self._mapping.basis, self._mapping.coefficients(), strict=True)


def check_flow(a: Series, name: str = "series") -> None:
    """Raise a SeriesError unless the argument is a flow."""
    check_series(a, name, "flow", 1)


def check_field(b: Series, name: str = "series") -> None:
    """Raise a SeriesError unless the argument is a field."""
    check_series(b, name, "field", 0)


def check_series(s: object, name: str, kind: str = "", empty: int | None = None) -> None:
    """Raise a SeriesError unless the argument is a series, of a kind with this coefficient of the empty tree."""
    if not isinstance(s, Series):
        raise SeriesError(f"{name} must be a series, such as series('rk4', 3), but was {s!r:.60}")
    if empty is not None and s.empty != empty:
        raise SeriesError(
            f"{name} must be a {kind}, with the coefficient {empty} of the empty tree, but has {s.empty} there"
        )


def fewest_digits(*operands: Series) -> int | None:
    """Digits of a result of these series; None if all are exact."""
    return min((operand.digits for operand in operands if operand.digits is not None), default=None)
