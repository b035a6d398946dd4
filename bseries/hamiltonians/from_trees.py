"""Modified Hamiltonians from trees: H̃ = Σ h^(|τ|−1) b(τ)/σ(τ) H(τ), one summand for each free tree.

With b the modified equation of a symplectic method, b(τ) H(τ) is the same for all rooted trees τ of a free tree, and
the number of the free tree's automorphisms is |τ| / Σ 1/σ(τ) over these. A rooted tree whose root is the centroid has
σ(τ) automorphisms, those of its free tree; its largest branch has less than half of the nodes. Where two centroids are
joined by an edge, all automorphisms keep the edge if the tree is not superfluous (for superfluous trees b = 0), and
each of the two rootings counts by one half. So no tree needs a differential of more than half of its nodes.

H(τ) is an elementary differential with a root of one more colour (see `EnergyScene`), and b(τ) is the coefficient of
its *twin*: the same tree with its root in the colour of the piece that comes from this energy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from bseries.algebra.bseries import BSeries
from bseries.algebra.modified import modified_equation
from bseries.algebra.stages import own_trees
from bseries.analysis.order import trusted
from bseries.analysis.structure import hamiltonian_field
from bseries.exact.domains import make_values
from bseries.exceptions import SeriesError
from bseries.fields.elementary_differentials import SymbolicSeries
from bseries.fields.modified_fields import SceneSeries
from bseries.fields.scene_trees import SceneTrees, flat_fields, trees_of_method, trees_of_series
from bseries.fields.symbolic.sparse_polynomials import TooLarge
from bseries.hamiltonians.energy_formulas import EnergyFormulas
from integrators import IntegratorError
from integrators.methods.program.child_bounds import common_bounds
from integrators.scenes.model.blocks import Block
from integrators.scenes.model.local_terms import VALUE, Output, Place
from integrators.scenes.model.system import System
from integrators.scenes.particles.degrees import Piece, degrees
from integrators.scenes.particles.expansion import as_float
from integrators.scenes.particles.local_form import constant_terms
from trees.counting import count_trees
from trees.free_trees import grafting
from trees.kernels import OUTSIDE
from trees.table import TreeTable, tree_table

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from bseries.algebra.bseries import BSeries
    from bseries.analysis.verdicts import Verdict
    from bseries.fields.scene_trees import SceneTrees
    from integrators import Scene
    from integrators.methods.program.program import Method
    from integrators.scenes.model.local_terms import LocalTerm

    Bounds = list[list[int | None]]


class EnergyScene(System):
    """A canonical scene with a variable for each energy that the pieces of its field come from.

    Where each term of H belongs to one piece, as in a splitting, or in H = T(p) + U(q) with the blocks p and q as
    pieces, there is an energy for each piece; otherwise there is one, H.

    Args:
        scene: The scene.
        pieces: The pieces of its field that colours of trees stand for.

    Attributes:
        scene: The scene.
        field_pieces: The pieces of its field.
        separated: Whether each term of H belongs to one piece.
        twins: For each energy, the colour of the piece that comes from it (of one of them, if there are several).
        pieces: The pieces of the field, and after them those of the energies.

    Example:
        >>> import bseries as bs
        >>> pendulum = bs.scene("pendulum")
        >>> separable = EnergyScene(pendulum, [Piece(frozenset("p")), Piece(frozenset("q"))])
        >>> separable.variables, separable.twins, separable.energies
        (('p', 'q', 'energy1', 'energy2'), (0, 1), (-cos(q), p**2/2))
        >>> EnergyScene(pendulum, [Piece()]).energies
        (p**2/2 - cos(q),)
    """

    scene: Scene
    field_pieces: tuple[Piece, ...]
    separated: bool
    twins: tuple[int, ...]
    pieces: tuple[Piece, ...]
    _places: list[Place]

    def __init__(self, scene: Scene, pieces: Sequence[Piece]):
        owners = [[k for k, piece in enumerate(pieces) if piece.outputs(term, scene)] for term in scene.local_terms]
        separated = all(len(found) == 1 for found in owners)
        owner = [found[0] for found in owners] if separated else [0] * len(owners)
        twins = tuple(sorted(set(owner)))
        name = "energy"
        taken = {*scene.variables, *scene.parameter_values, *(block.name for block in scene.blocks)}
        while any(used.startswith(name) for used in taken):
            name += "_"
        start = scene.dimension
        added = [Block(f"{name}{k}", (f"{name}{k}",), start + k - 1, 0, ()) for k in range(1, len(twins) + 1)]
        self.__dict__.update(
            name=scene.name,
            parameters=scene.parameters,
            scene=scene,
            blocks=(*scene.blocks, *added),
            field_pieces=tuple(pieces),
            separated=separated,
            twins=twins,
            pieces=(*pieces, *(Piece(frozenset([block.name])) for block in added)),
            _places=[Place(0, start + twins.index(color), 0) for color in owner],
        )

    @property
    def _data(self) -> tuple[Any, ...]:
        return self.scene, self.field_pieces

    def __reduce__(self) -> tuple[Any, ...]:
        return EnergyScene, self._data

    @cached_property
    def local_terms(self) -> tuple[LocalTerm, ...]:
        """The terms of the scene, which also add their values to energies; constants are left out."""
        return tuple(
            term._replace(outputs=(*term.outputs, Output(VALUE, place, 1)))
            for term, place in zip(self.scene.local_terms, self._places, strict=True)
        )

    @cached_property
    def constant(self) -> sympy.Expr:
        """The constant of H, which is in none of the energies."""
        import sympy

        return sympy.Add(*(_written_out(term, self.scene) for term in constant_terms(self.scene)))

    @cached_property
    def energies(self) -> tuple[sympy.Expr, ...]:
        """The energies written out flat."""
        import sympy

        terms = [
            (place.offset, _written_out(term, self.scene))
            for term, place in zip(self.scene.local_terms, self._places, strict=True)
        ]
        places = range(self.scene.dimension, self.dimension)
        return tuple(sympy.Add(*(formula for at, formula in terms if at == place)) for place in places)

    @cached_property
    def field(self) -> tuple[sympy.Expr, ...]:
        """The field of the scene, and e' = H."""
        return *self.scene.field, *self.energies

    @cached_property
    def fields(self) -> list[tuple[sympy.Expr, ...]]:
        """The field of each piece, one formula for each variable; an energy's is the energy, in its own place."""
        import sympy

        zero, size = sympy.Integer(0), len(self.energies)
        fields = [(*field, *[zero] * size) for field in flat_fields(self.scene, self.field_pieces)]
        for k, energy in enumerate(self.energies):
            fields.append((*[zero] * (self.scene.dimension + k), energy, *[zero] * (size - k - 1)))
        return fields


def _written_out(term: LocalTerm, scene: Scene) -> sympy.Expr:
    """The sum of a term's formula over its sites, in the variables of the scene."""
    import sympy

    symbols, formulas = scene.symbols, []
    for row in term.sites.rows():
        here: dict[Any, Any] = {sympy.Symbol(f"d{k}"): data.values[row[data.role]] for k, data in enumerate(term.data)}
        for k, (plus, minus) in enumerate(term.arguments):
            value = symbols[plus.at(row)]
            here[sympy.Symbol(f"x{k}")] = value if minus is None else value - symbols[minus.at(row)]
        formulas.append(term.formula.xreplace(here))
    return sympy.Add(*formulas)


MOST_SIMPLIFIED = 300
"""Sums of more terms, as of the pairs of some atoms, rarely become shorter over a common denominator, but take long."""


class EnergySeries:
    """The sum of the energies of a series.

    Args:
        scene: The scene with its energies.
        trees: The trees in the colours of its pieces.
        series: The coefficients: trees with energies at their roots have some, others none.
        route: ``"towers"``, ``"symbolic"`` or ``"auto"``.
    """

    def __init__(self, scene: EnergyScene, trees: SceneTrees, series: BSeries, route: str = "auto"):
        self.scene, self._wanted = scene, route
        self.series = SceneSeries(cast("Scene", scene), trees, series, route="towers")

    def __reduce__(self) -> tuple[Any, ...]:
        return EnergySeries, (self.scene, self.series.trees, self.series.series, self._wanted)

    def by_route(self, route: str) -> EnergySeries:
        """The same energy, evaluated in another way."""
        return EnergySeries(self.scene, self.series.trees, self.series.series, route)

    @property
    def order(self) -> int:
        """The number of terms."""
        return self.series.order

    @cached_property
    def evaluator(self) -> EnergySeries | EnergyFormulas:
        """What evaluates it."""
        if self._wanted == "towers":
            return self
        if self._wanted == "symbolic":
            return self._formulas()
        from bseries.fields.evaluation import MOST_MONOMIALS, MOST_VARIABLES, contractions

        if self._size > MOST_VARIABLES:
            return self
        try:
            formulas = self._formulas(limit=MOST_MONOMIALS)
            faster = formulas.total.is_faster(contractions(self.series.evaluator.tables[0]))
        except (SeriesError, IntegratorError):
            return self
        return formulas if faster else self

    @property
    def _size(self) -> int:
        """The number of variables without energies."""
        return self.scene.scene.dimension

    def _written(self, **limits: int) -> SymbolicSeries:
        return SymbolicSeries(self.series.series, self.scene.fields, self.scene.symbols, **limits)

    def _formulas(self, **limits: int) -> EnergyFormulas:
        written = self._written(**limits)
        terms = [self._term(written, k, simplify=False) for k in range(self.order)]
        self.__dict__.setdefault("_symbolic", written)  # all terms are there: nobody need compute them again
        return EnergyFormulas(self.scene.scene.symbols, terms)

    @cached_property
    def _symbolic(self) -> SymbolicSeries:
        return self._written()

    def symbolic(self, k: int) -> sympy.Expr:
        """What h^k multiplies."""
        return self._term(self._symbolic, k, simplify=True)

    def _term(self, written: SymbolicSeries, k: int, *, simplify: bool) -> sympy.Expr:
        ring = written.ring
        total = ring.sum((1, energy) for energy in written.elements(k + 1)[self._size :])
        try:
            formula = ring.to_expression(total, simplify=simplify and total.size <= MOST_SIMPLIFIED)
        except TooLarge:
            formula = ring.to_expression(total, simplify=False)
        return formula if k else formula + self.scene.constant

    @cached_property
    def _constant(self) -> float:
        """The constant of H as a double."""
        if self.scene.constant.free_symbols:
            names = ", ".join(sorted(map(str, self.scene.constant.free_symbols)))
            raise SeriesError(f"parameters of the scene must be numbers in compiled code, but {names} are symbols")
        return as_float(self.scene.constant)

    @cached_property
    def compiled(self) -> Callable[[Any, float], float]:
        """The sum as a function (y, h) compiled by numba."""
        return _scalar(self.series.compiled, self._size, self.scene.dimension, self._constant)

    def values(self, states: np.ndarray, step: float, workers: int = 1) -> np.ndarray:
        """The sums at the rows of `states`."""
        *lower, total = self.terms(states, workers)
        for term in reversed(lower):
            total *= step
            total += term
        return total

    def terms(self, states: np.ndarray, workers: int = 1) -> np.ndarray:
        """The terms at the rows of `states`: a row for each power of h."""
        import numpy as np

        extended = np.zeros((len(states), self.scene.dimension))
        extended[:, : self._size] = states
        found = self.series.evaluator.terms_at(extended, workers)[:, :, self._size :].sum(axis=2)
        found[0] += self._constant
        return found

    def precise(self, y: Sequence[Any], h: Any, digits: int) -> Any:
        """The sum at one point, in numbers of mpmath."""
        import mpmath
        import sympy

        extended = self.series.precise([*y, *[0] * (self.scene.dimension - self._size)], h, digits)
        constant = sympy.lambdify([], self.scene.constant, "mpmath")()
        return mpmath.fsum([*extended[self._size :], constant])


def _scalar(field: Any, size: int, dimension: int, constant: float) -> Any:
    """The sum of the last entries of a compiled field and a constant, as a function of the first."""
    import numpy as np
    from numba import njit

    @njit(nogil=True, error_model="numpy")
    def compiled(y: Any, h: float) -> float:
        """The energy at y."""
        if y.size != size:
            raise ValueError("y must have another number of entries")
        state, out = np.zeros(dimension), np.empty(dimension)
        state[:size] = y
        field(state, h, out)
        return out[size:].sum() + constant

    return compiled


class EnergyTrees(NamedTuple):
    """What a modified Hamiltonian is made from.

    Attributes:
        scene: The scene with its energies.
        table: The trees in the colours of its pieces.
        field: The modified equation, on trees that hold the twins of those with an energy at the root.
        colors: For each colour of `table` that of `field`.
        blocks: Whether the colours of `field` are blocks of variables.
    """

    scene: EnergyScene
    table: TreeTable
    field: BSeries
    colors: tuple[int, ...]
    blocks: bool

    @property
    def verdict(self) -> Verdict:
        """How far the modified equation is Hamiltonian, on the trees that the scene calls for."""
        return hamiltonian_field(self.field, colors_are="blocks" if self.blocks else "parts")


def energy_trees(method: Method | BSeries, scene: Scene, order: int, parts: Any) -> EnergyTrees:
    """The trees and coefficients for a method, or a field series, on a canonical scene."""
    if isinstance(method, BSeries):
        method = method.truncate(order)
        trees = trees_of_series(method, scene, parts)
    else:
        trees = trees_of_method(method, order, scene, parts)
    augmented = EnergyScene(scene, trees.pieces)
    bounds = degrees(augmented, augmented.pieces)
    colors = (*range(len(trees.pieces)), *augmented.twins)
    blocks = trees.pieces[0].blocks is not None
    if trees.table != trees.shapes:  # the method sees one field, whose trees tell its coefficients
        blocks, colors = False, (0,) * len(colors)
    field = method
    if not isinstance(field, BSeries):
        field = modified_equation(trusted(field), _table_of_twins(field, augmented, bounds, order, colors, blocks))
    return EnergyTrees(augmented, tree_table(order, len(bounds), bounds), field, colors, blocks)


def _table_of_twins(
    method: Any, scene: EnergyScene, bounds: Bounds, order: int, colors: Sequence[int], blocks: bool
) -> TreeTable:
    """The trees that a method's coefficients are needed for: a twin's root has as many children as an energy."""
    if max(colors) == 0:
        return tree_table(order, 1, degrees(scene, [Piece()]))
    count = len(scene.field_pieces)
    if blocks and not scene.separated:
        return tree_table(order, count)
    rows = [[*row[:count], row[-1]] for row in bounds]
    for twin, energy in zip(scene.twins, rows[count:], strict=True):
        rows[twin] = [None if a is None or b is None else max(a, b) for a, b in zip(rows[twin], energy, strict=True)]
    return tree_table(order, count, common_bounds(tuple(map(tuple, rows[:count])), own_trees(method)))


def energy_series(trees: EnergyTrees) -> EnergySeries:
    """The modified Hamiltonian as a series on the scene with its energies.

    Raises:
        SeriesError: The series is on trees that do not tell the coefficients.
    """
    table, field = trees.table, trees.field
    count, total = len(trees.scene.field_pieces), sum(count_trees(table.max_order, table.colors))
    values, sources, coefficients = field.coefficients(), [0] * len(table), [Fraction(0)] * len(table)
    for tree, (source, factor) in enumerate(_twins(trees, count)):
        if factor and source < 0:
            raise SeriesError(
                f"series must be on a table that holds each tree with its root moved, but {field.table!r} does not"
            )
        if factor:
            sources[tree], coefficients[tree] = source, factor * values[source]
    uncertainty = field.uncertainty and partial(_uncertainty_of_twin, field.uncertainty, sources)
    label = field.label or "a series"
    series = BSeries(
        table, make_values(table, coefficients), 0, label=label, digits=field.digits, uncertainty=uncertainty
    )
    return EnergySeries(trees.scene, SceneTrees(trees.scene.pieces, table, table, total), series)


def _twins(trees: EnergyTrees, count: int) -> list[tuple[int, Fraction]]:
    """For each tree one of the field with the same coefficient up to a factor, 0 for those that have no part in H̃.

    On trees of Nyström systems a twin may have one branch too many, when the root moved to its largest branch has not:
    b(u ∘ v) = −b(v ∘ u).
    """
    order, color, left, right = trees.table.lists
    graft = grafting(trees.field.table)
    images: list[int] = []
    found: list[tuple[int, Fraction]] = []
    for tree, (u, v) in enumerate(zip(left, right, strict=True)):
        is_energy = color[tree] >= count
        if u < 0:
            source, factor = trees.colors[color[tree]], Fraction(int(is_energy))
        else:
            source, rest = _product(graft, images[u], images[v]), order[tree] - 2 * order[v]
            factor = Fraction(1, 1 if rest else 2) if is_energy and rest >= 0 else Fraction(0)
        images.append(source)
        if factor and source < 0:
            source, factor = _product(graft, images[v], images[u]), -factor
        found.append((source, factor))
    return found


def _product(graft: Callable[[int, int], int], u: int, v: int) -> int:
    return graft(u, v) if u >= 0 and v >= 0 else OUTSIDE


def _uncertainty_of_twin(uncertainty: Any, sources: list[int], at: int) -> float:
    return uncertainty(sources[at])
