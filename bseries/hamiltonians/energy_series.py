"""Modified Hamiltonians that are series over trees, evaluated by derivative towers or, where short, as formulas.

A series on a scene with its energies as variables (see `energy_scene`) has its value in these variables.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

from integrators import IntegratorError
from integrators.scenes.expansion import as_float

from ..differentials import SymbolicSeries
from ..evaluation import SceneSeries
from ..exceptions import SeriesError
from ..sparse_polynomials import TooLarge
from .energy_formulas import EnergyFormulas

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import numpy as np
    import sympy

    from integrators import Scene

    from ..scene_trees import SceneTrees
    from ..truncated import BSeries
    from .energy_scene import EnergyScene

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
        from ..compiled_series import MOST_MONOMIALS, MOST_VARIABLES, contractions

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
