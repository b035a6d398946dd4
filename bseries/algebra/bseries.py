"""`BSeries`: truncated B-series and P-series as mappings from trees to coefficients."""

from __future__ import annotations

import math
from collections.abc import Callable, ItemsView, Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cache
from itertools import chain, islice
from typing import TYPE_CHECKING, Any

from bseries.algebra import presentation
from bseries.algebra.presentation import SeriesTerm
from bseries.algebra.stages import ExactStages
from bseries.exact import lie
from bseries.exact.domains import Values, alike, as_floats, exact_number, make_values
from bseries.exceptions import SeriesError
from foundation.table import MOST_ROWS, LazyRows, Table, Tabular, short_latex
from integrators.core.immutable import ImmutableValue
from trees.counting import check_order
from trees.errors import TreeError
from trees.notation import check_names, default_names
from trees.table import TreeTable, tree_table
from trees.tree import Tree

if TYPE_CHECKING:
    from bseries.algebra.uncertainty import Uncertainty
    from bseries.exact.domains import Coefficient

EMPTY = "∅"


class BSeries(ImmutableValue, Tabular, Mapping[Tree, Any]):
    """A B-series (or P-series, on coloured trees) up to some number of nodes.

    B(a, y) = a(∅) y + Σ_τ h^|τ| / σ(τ) · a(τ) F(τ)(y): a coefficient contains neither 1/σ nor a power of h. A *flow*
    has a(∅) = 1, a *field* has b(∅) = 0 and represents h · f_h. The mapping iterates over the trees in the order of its
    table; ``s["∅"]`` is the coefficient of the empty tree, excluded from iteration and `len`.

    A series of a method published as decimals has `digits` and an `uncertainty`, and so has its logarithm. Results of
    other arithmetic on it have digits only: it treats the printed decimals as exact, and the results are shown rounded.

    Series are immutable. `stored` holds the coefficients in the form of `bseries.exact.domains`. `kind` is what tables
    and documents call the series: ``series``, ``field``, ``modified`` or ``modifying``. An exact series of a method has
    its stages as `source`, from which its logarithm, powers, inverse and compositions are computed without cuts.

    Example:
        >>> import bseries as bs
        >>> s = bs.series(bs.method("explicit-midpoint"), 3)
        >>> s["[τ]"], s["[τ,τ]"], s["∅"], len(s)
        (Fraction(1, 2), Fraction(1, 4), Fraction(1, 1), 4)
        >>> (s - bs.exact_flow(3))["[τ,τ]"]
        Fraction(-1, 12)

    References:
        E. Hairer, C. Lubich, G. Wanner, *Geometric Numerical Integration*, 2nd ed., definition III.1.8.
    """

    table: TreeTable
    stored: Values
    empty: Any
    names: tuple[str, ...]
    label: str
    kind: str
    digits: int | None
    uncertainty: Uncertainty | None
    source: ExactStages | None

    def __init__(
        self,
        table: TreeTable,
        values: Values,
        empty: Coefficient,
        *,
        names: Sequence[str] = (),
        label: str = "",
        kind: str | None = None,
        digits: int | None = None,
        uncertainty: Uncertainty | None = None,
        source: ExactStages | None = None,
    ):
        empty = exact_number(empty)
        names = check_names(names) if names and table.colors > 1 else default_names(table.colors)
        if len(names) != table.colors:
            raise SeriesError(f"names must be {table.colors} names, one for each colour, but were {len(names)}")
        kind = kind or ("field" if empty == 0 else "series")
        self.__dict__.update(table=table, stored=values, empty=empty, names=names, label=label, kind=kind)
        self.__dict__.update(digits=digits, uncertainty=uncertainty, source=source)

    def __copy__(self) -> BSeries:
        return self

    def __deepcopy__(self, memo: object) -> BSeries:
        return self

    @classmethod
    def from_rule(
        cls,
        rule: Callable[[Tree], object],
        order: int,
        *,
        empty: object = 1,
        colors: int = 1,
        max_children: Any = None,
        names: Sequence[str] = (),
    ) -> BSeries:
        """The series with the coefficients rule(tree).

        Args:
            rule: A function from trees to numbers (int, Fraction, float) or SymPy expressions.
            order: Largest number of nodes.
            empty: Coefficient of the empty tree: 1 for a flow, 0 for a field.
            colors: Number of colours of the trees.
            max_children: Which trees to include, as for `trees.TreeTable`.
            names: Names of the colours.

        Raises:
            SeriesError: A value is not a finite number or expression.
            TreeError: `order`, `colors` or `max_children` is out of its range.

        Example:
            >>> import bseries as bs
            >>> from fractions import Fraction
            >>> exact = bs.BSeries.from_rule(lambda tree: Fraction(1, tree.density), 4)
            >>> exact["[τ,[τ]]"]
            Fraction(1, 8)
        """
        table = tree_table(order, colors, max_children)
        values = make_values(table, (rule(tree) for tree in table))
        return cls(table, values, exact_number(empty), names=names)

    @property
    def order(self) -> int:
        """Largest number of nodes."""
        return self.table.max_order

    @property
    def domain(self) -> str:
        """The smallest domain that holds all coefficients: ``QQ``, ``RR``, ``QQ<sqrt(3)>``, ``QQ[gamma]``, …"""
        return self.stored.name

    @property
    def is_exact(self) -> bool:
        """Whether the coefficients are exact, not floats."""
        return self.stored.kind != "float"

    def __getitem__(self, tree: Tree | str) -> Any:
        if isinstance(tree, str) and tree.strip() == EMPTY:
            return self.empty
        return self.stored[self.table.index(self._tree(tree))]

    def _tree(self, tree: Tree | str) -> Tree:
        """Read a tree in the names of this series."""
        return Tree(tree, names=self._shown_names)

    @property
    def _shown_names(self) -> tuple[str, ...] | None:
        """The names of the colours in texts; None where there is only one colour."""
        return self.names if self.table.colors > 1 else None

    def __contains__(self, tree: object) -> bool:
        try:
            return isinstance(tree, Tree | str) and tree != EMPTY and self._tree(tree) in self.table
        except TreeError:  # no text of a tree, or the empty one
            return False

    def get(self, tree: Any, default: Any = None) -> Any:
        """The coefficient of a tree, or `default` for trees beyond the series."""
        return self[tree] if tree in self or str(tree).strip() == EMPTY else default

    def __iter__(self) -> Iterator[Tree]:
        return iter(self.table)

    def __len__(self) -> int:
        return len(self.table)

    def items(self) -> ItemsView[Tree, Any]:
        """Pairs (tree, coefficient) in the order of the table."""
        return _Items(self)

    def coefficients(self) -> list[Any]:
        """All coefficients in the order of the table."""
        return self.stored.coefficients()

    values = coefficients  # pyright: ignore[reportAssignmentType]

    def is_zero(self, tree: Tree | str) -> bool:
        """Whether a coefficient is zero, for decimals within their uncertainty."""
        return self.is_zero_at(self.table.index(self._tree(tree)))

    def is_zero_at(self, at: int) -> bool:
        """`is_zero` for the tree with this id."""
        return self.stored.is_zero(at) or self.may_be(at, 0)

    def may_be(self, at: int, value: Any) -> bool:
        """Whether a coefficient of a method in decimals is a number, within its uncertainty."""
        return self.uncertainty is not None and abs(self.stored[at] - value) <= self.uncertainty(at)

    def nonzero(self) -> list[tuple[Tree, Any]]:
        """Pairs (tree, coefficient) with nonzero coefficients (see `is_zero`)."""
        return [(self.table[at], value) for at, value in enumerate(self.coefficients()) if not self.is_zero_at(at)]

    def weights(self) -> list[Any]:
        """Coefficient/σ of every tree, the factor of its elementary differential; 0 where `is_zero`."""
        pairs = enumerate(zip(self.coefficients(), self.table.symmetry.tolist(), strict=True))
        return [0 if self.is_zero_at(at) else value / sigma for at, (value, sigma) in pairs]

    def truncate(self, order: int) -> BSeries:
        """The series restricted to trees with at most `order` nodes.

        Raises:
            SeriesError: `order` is larger than this series' order.
        """
        if check_order(order) > self.order:
            raise SeriesError(f"order must be at most {self.order}, the order of the series, but was {order}")
        table = tree_table(order, self.table.colors, self.table.limits)
        return self._replace(table=table, stored=self.stored.truncated(table))

    def _replace(self, **changes: Any) -> BSeries:
        """The series with other values of some attributes."""
        series = object.__new__(BSeries)
        series.__dict__.update(self.__dict__, **changes)
        return series

    def with_empty(self, empty: object) -> BSeries:
        """The same series with another coefficient of the empty tree."""
        return BSeries(self.table, self.stored, exact_number(empty), names=self.names, digits=self.digits)

    def with_label(self, label: str, kind: str | None = None) -> BSeries:
        """The same series under another name, and as another kind of those in `presentation.KINDS` if one is given."""
        if kind is not None and kind not in presentation.KINDS:
            raise SeriesError(f"kind must be one of {', '.join(presentation.KINDS)}, but was {kind!r:.60}")
        return self._replace(label=label, kind=kind or self.kind)

    def to_float(self) -> BSeries:
        """The series with every coefficient rounded to the nearest float.

        Raises:
            SeriesError: A coefficient holds symbols.
        """
        return self._replace(stored=as_floats(self.stored), source=None)

    def check_same_trees(self, other: BSeries) -> None:
        """Raise a SeriesError unless the other series has the same trees."""
        if self.table != other.table:
            raise SeriesError(
                f"both series must have the same trees, but were on {self.table!r} and {other.table!r}; "
                "use truncate(order) for a common order"
            )
        if self.names != other.names:
            raise SeriesError(f"both series must name their colours alike, but have {self.names} and {other.names}")

    def _combine(self, other: object, function: Callable[[Any, Any], Any]) -> BSeries:
        if not isinstance(other, BSeries):
            return NotImplemented
        self.check_same_trees(other)
        return self._with_numbers(map(function, self._numbers(), other._numbers()), fewest_digits(self, other))

    def _map(self, function: Callable[[Any], Any]) -> BSeries:
        return self._with_numbers(map(function, self._numbers()), self.digits)

    def _numbers(self) -> list[Any]:
        """All coefficients, that of the empty tree first."""
        return [self.empty, *self.coefficients()]

    def _with_numbers(self, numbers: Iterable[Any], digits: int | None) -> BSeries:
        try:
            empty, *values = numbers
            stored = make_values(self.table, values)
        except OverflowError:
            raise SeriesError("coefficients must stay within the range of floats, but some overflowed") from None
        return BSeries(self.table, stored, empty, names=self.names, digits=digits)

    __array_ufunc__ = None  # a NumPy number times a series is a series

    def __add__(self, other: BSeries) -> BSeries:
        return self._combine(other, lambda x, y: x + y)

    def __radd__(self, other: object) -> BSeries:
        return self if other == 0 else NotImplemented  # the start value of `sum`

    def __sub__(self, other: BSeries) -> BSeries:
        return self._combine(other, lambda x, y: x - y)

    def __neg__(self) -> BSeries:
        return self._map(lambda x: -x)

    def __mul__(self, number: object) -> BSeries:
        if isinstance(number, BSeries):
            raise SeriesError("number must be a number, but was a series; compose(a, b) applies a and then b")
        factor: Any = exact_number(number, "number")
        return self._map(lambda x: x * factor)

    __rmul__ = __mul__

    def __truediv__(self, number: object) -> BSeries:
        divisor: Any = exact_number(number, "number")
        if divisor == 0:
            raise SeriesError("number must not be zero to divide by")
        return self._map(lambda x: x / divisor)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, BSeries):
            return NotImplemented
        if self.table != other.table or self.names != other.names or self.empty != other.empty:
            return False
        if "ring" in (self.stored.kind, other.stored.kind):
            mine, others = alike([self.stored, other.stored])
            return all(mine.equals_at(others, at) for at in range(len(self)))
        return self.coefficients() == other.coefficients()

    __hash__ = None  # pyright: ignore[reportAssignmentType]

    def __repr__(self) -> str:
        of = f" of {self.label}" if self.label else ""
        return f"<BSeries{of}: {len(self)} trees to order {self.order}, {self.domain}>"

    def scale_step(self, factor: object) -> BSeries:
        """The series with h replaced by factor · h: a(τ) becomes factor^|τ| a(τ).

        Example:
            >>> import bseries as bs
            >>> from fractions import Fraction
            >>> bs.exact_flow(3).scale_step(Fraction(1, 2)) == bs.exact_flow(3) ** Fraction(1, 2)
            True
        """
        number: Any = exact_number(factor, "factor")
        power = cache(lambda n: number**n)
        pairs = zip(self.coefficients(), self.table.columns.order, strict=True)
        scaled = self._with_numbers(chain([self.empty], (x * power(int(n)) for x, n in pairs)), self.digits)
        if self.source is None or not isinstance(number, Fraction):
            return scaled
        is_exact = self.source.kind == "rational" or number.denominator == 1
        return scaled._replace(source=self.source.scaled(number)) if is_exact else scaled

    def log(self) -> BSeries:
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
        stored = lie.logarithm(self.stored) if self.source is None else self.source.logarithm(self.table)
        errors = self.uncertainty and self.uncertainty.of_logarithm(self.table, self.coefficients)
        return self._made(stored, 0)._replace(uncertainty=errors)

    def _made(self, stored: Values, empty: int, source: ExactStages | None = None) -> BSeries:
        """A series that is made of this one alone."""
        return BSeries(self.table, stored, empty, names=self.names, digits=self.digits, source=source)

    def exp(self) -> BSeries:
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

    def inverse(self) -> BSeries:
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
        if self.source is None:
            return self._made(lie.power(self.stored, Fraction(-1)), 1)
        inverse = self.source.inverse()
        return self._made(inverse.series(self.table), 1, inverse)

    def adjoint(self) -> BSeries:
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

    def __pow__(self, exponent: object) -> BSeries:
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
        return self._made(lie.power(self.stored, s) if self.source is None else self.source.power(self.table, s), 1)

    def terms(self, *, nonzero: bool = False) -> Iterator[SeriesTerm]:
        """The terms in the order of the table; `weight` is coefficient/σ."""
        columns = (x if isinstance(x, list) else x.tolist() for x in self.table.symmetry_and_density)
        for at, ((tree, coefficient), symmetry, density) in enumerate(zip(self.items(), *columns, strict=True)):
            zero = self.is_zero_at(at)
            if not (nonzero and zero):
                digits, error = self.digits, 0.0 if not (self.uncertainty and coefficient) else self.uncertainty(at)
                if digits is not None and error:
                    digits = max(1, min(digits, 1 + math.floor(math.log10(abs(coefficient) / error))))
                yield SeriesTerm(tree, coefficient, coefficient / symmetry, zero, digits, symmetry, density)

    def to_dict(self, *, nonzero: bool = False) -> dict[str, Any]:
        """The series as JSON-ready data, which `load_series` reads.

        Args:
            nonzero: Leave out terms with coefficient zero.

        Returns:
            The keys schema, kind, method, order, domain, colors, max_children, empty, nonzero, digits (for decimal
            methods) and terms, each term with tree, levels, colors, order, symmetry, density, coefficient, weight and
            differential. For decimal methods a term also has the value before rounding, ``exact``, and its
            uncertainty, ``error``.

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
            "max_children": self.table.max_children,
            "empty": str(self.empty),
            "nonzero": nonzero,
        }
        fields: dict[str, Callable[[SeriesTerm], Any]] = presentation.term_fields(self._shown_names)
        if self.digits is not None:
            data["digits"] = self.digits
            fields["exact"] = lambda term: str(term.coefficient)
        if (error := self.uncertainty) is not None:
            fields["error"] = lambda term: error(self.table.index(term.tree))
        data["terms"] = [{key: get(term) for key, get in fields.items()} for term in self.terms(nonzero=nonzero)]
        return data

    def to_julia(self) -> str:
        """The series as source text for BSeries.jl, which has the same normalisation.

        Returns:
            Text that makes a `TruncatedBSeries` with the name ``series``; two colours are ``false`` and ``true``.

        Raises:
            SeriesError: The coefficients have roots or symbols, some trees are left out, or there are more than two
                colours.

        Example:
            >>> import bseries as bs
            >>> print(bs.modified_equation("explicit-euler", 3).to_julia().splitlines()[-1])
            series = bseries((t, _) -> coefficients[t], 3)
        """
        if self.stored.kind == "ring":
            raise SeriesError(f"coefficients must be rational or floats for BSeries.jl, but were in {self.domain}")
        inexact = self.digits is not None or self.stored.kind == "float"
        return presentation.to_julia(self.terms(), self.empty, self.table, inexact=inexact)

    def to_latex(self) -> str:
        """The series as a sum of weights times powers of h times elementary differentials, without terms that are zero.

        A field is written as the modified equation f_h, without the factor h.

        Example:
            >>> import bseries as bs
            >>> print(bs.modified_equation(bs.method("explicit-euler"), 2).to_latex())
            f - \\frac{1}{2} h\\, f'(f)
        """
        return presentation.to_latex(self.terms(nonzero=True), self.empty, self._shown_names)

    def _repr_latex_(self) -> str | None:
        terms = (term for term in islice(self.terms(), MOST_ROWS) if not term.is_zero)
        dots = " + \\cdots" if len(self) > MOST_ROWS else ""
        return short_latex(presentation.to_latex(terms, self.empty, self._shown_names) + dots)

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
        rows = LazyRows(lambda: shown.terms(nonzero=nonzero), len(self))
        notes = presentation.number_notes(shown.domain, shown.digits, nonzero=nonzero, as_float=as_float)
        return presentation.term_table(rows, self._shown_names, self.kind, self.label, self.order)._replace(
            notes=[presentation.MEANINGS[self.kind], *notes],
            data=lambda: shown.to_dict(nonzero=nonzero),
            own={"latex": lambda width: shown.to_latex() + "\n"},
        )


class _Items(ItemsView[Tree, Any]):
    """Items without a look-up for each tree."""

    _mapping: BSeries

    def __iter__(self) -> Iterator[tuple[Tree, Any]]:
        return zip(self._mapping.table, self._mapping.coefficients(), strict=True)


def check_flow(a: BSeries, name: str = "series") -> None:
    """Raise a SeriesError unless the argument is a flow."""
    check_series(a, name, "flow", 1)


def check_field(b: BSeries, name: str = "series") -> None:
    """Raise a SeriesError unless the argument is a field."""
    check_series(b, name, "field", 0)


def check_series(s: object, name: str, kind: str = "", empty: int | None = None) -> None:
    """Raise a SeriesError unless the argument is a series, of a kind with this coefficient of the empty tree."""
    if not isinstance(s, BSeries):
        raise SeriesError(f"{name} must be a BSeries, but was {s!r:.60}")
    if empty is not None and s.empty != empty:
        raise SeriesError(
            f"{name} must be a {kind}, with the coefficient {empty} of the empty tree, but has {s.empty} there"
        )


def fewest_digits(*operands: BSeries) -> int | None:
    """Digits of a result of these series; None if all are exact."""
    return min((operand.digits for operand in operands if operand.digits is not None), default=None)
