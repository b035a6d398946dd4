"""`BSeries`: truncated B-series and P-series, on rooted trees."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, Any, cast

from bseries.algebra import presentation
from bseries.algebra.presentation import SeriesTerm
from bseries.algebra.series import Series
from bseries.exact.domains import exact_number
from bseries.exceptions import SeriesError
from bseries_base.table import Column
from trees import folds
from trees.basis import Basis
from trees.drawing import svg
from trees.table import TreeTable, tree_table
from trees.tree import Tree

if TYPE_CHECKING:
    from bseries.algebra.stages import ExactStages
    from bseries.exact.domains import Values


class BSeries(Series):
    """A B-series (or P-series, on coloured trees) up to some number of nodes.

    B(a, y) = a(∅) y + Σ_τ h^|τ| / σ(τ) · a(τ) F(τ)(y): a coefficient contains neither 1/σ nor a power of h. A *flow*
    has a(∅) = 1, a *field* has b(∅) = 0 and represents h · f_h. An exact series of a method has its stages as `source`,
    from which its logarithm, powers, inverse and compositions are computed without cuts.

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

    source: ExactStages | None = None

    def __getstate__(self) -> dict[str, Any]:
        """All but a source in a ring of SymPy, which cannot be pickled."""
        state = super().__getstate__()
        return state if self.source is None or self.source.kind == "rational" else {**state, "source": None}

    def with_source(self, source: ExactStages | None) -> BSeries:
        """The same series, known to be that of these stages."""
        return self._replace(source=source)

    @property
    def table(self) -> TreeTable:
        """The trees."""
        return cast("TreeTable", self.basis)

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
        return cls.of(tree_table(order, colors, max_children), rule, empty=empty, names=names)

    def to_float(self) -> BSeries:
        """The series with every coefficient rounded to the nearest float."""
        return super().to_float().with_source(None)

    def scale_step(self, factor: object) -> BSeries:
        """The series with h replaced by factor · h: a(τ) becomes factor^|τ| a(τ)."""
        scaled, number = super().scale_step(factor), exact_number(factor)
        if self.source is None or not isinstance(number, Fraction):
            return scaled
        is_exact = self.source.kind == "rational" or number.denominator == 1
        return scaled.with_source(self.source.scaled(number)) if is_exact else scaled

    def _logarithm(self) -> Values:
        return super()._logarithm() if self.source is None else self.source.logarithm(self.table)

    def _power(self, s: Fraction) -> Values:
        return super()._power(s) if self.source is None else self.source.power(self.table, s)

    def inverse(self) -> BSeries:
        """The series of the inverse map."""
        if self.source is None:
            return super().inverse()
        inverse = self.source.inverse()
        return self._made(inverse.series(self.table), 1).with_source(inverse)

    def term_fields(self) -> dict[str, Callable[[SeriesTerm], Any]]:
        """What JSON and CSV hold of a term, by key."""
        table, names, densities = self.table, self.shown_names, self.table.symmetry_and_density[1]
        tree, levels, colors = folds.tree_texts(table, names), folds.levels(table), folds.colors(table)
        differential = folds.differentials(table, names)
        return {
            "tree": lambda term: tree(term.at),
            "levels": lambda term: levels(term.at),
            "colors": lambda term: colors(term.at),
            "order": lambda term: table.order_of(term.at),
            "symmetry": lambda term: term.symmetry,
            "density": lambda term: int(densities[term.at]),
            "coefficient": lambda term: term.coefficient_text,
            "weight": lambda term: term.weight_text,
            "differential": lambda term: differential(term.at),
        }

    def term_columns(self) -> list[Column]:
        """The columns of the table of the terms."""
        names, fields = self.shown_names, self.term_fields()

        def picture(term: SeriesTerm) -> str:
            return f"{svg(term.element, names=names)} {term.element.text(names)}"

        return [
            Column("|τ|", True, fields["order"]),
            Column("tree τ", get=fields["tree"], html=picture),
            Column("coefficient", get=fields["coefficient"]),
            Column("weight", get=fields["weight"]),
            Column("F(τ)", get=fields["differential"]),
        ]

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


def class_on(basis: Basis[Any]) -> type[Series]:
    """The class of series on a basis."""
    return BSeries if isinstance(basis, TreeTable) else Series


def check_trees(s: object, name: str) -> None:
    """Raise a SeriesError unless the argument is a series on rooted trees."""
    if not isinstance(s, BSeries):
        raise SeriesError(f"{name} must be a BSeries, on rooted trees, but was {s!r:.60}")
