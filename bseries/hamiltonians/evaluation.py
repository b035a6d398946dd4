"""Modified Hamiltonians that are known as formulas, evaluated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

from bseries.exceptions import SeriesError
from bseries.fields.compiled_formulas import CompiledFormulas
from bseries.fields.differentials import SymbolicSeries
from bseries.fields.scene_series import SceneSeries
from bseries.fields.symbolic.sparse_polynomials import TooLarge
from integrators import IntegratorError
from integrators.scenes.model.formulas import as_float

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from bseries.algebra.bseries import BSeries
    from bseries.fields.scene_trees import SceneTrees
    from bseries.hamiltonians.energy_scene import EnergyScene
    from integrators import Scene


class EnergyFormulas:
    """A sum Σ h^k · formula, as compiled functions of a state and a step size, and in any precision.

    Args:
        symbols: The variables.
        formulas: The formulas by power of h.

    Example:
        >>> import numpy as np, sympy
        >>> p, q = sympy.symbols("p q")
        >>> energy = EnergyFormulas([p, q], [p**2 / 2 - sympy.cos(q), -p * sympy.sin(q) / 2])
        >>> energy.gradient(np.array([[1.0, 0.0]]), 0.5)
        array([[ 1.  , -0.25]])
    """

    def __init__(self, symbols: Sequence[sympy.Symbol], formulas: Sequence[sympy.Expr]):
        self.symbols, self.formulas = tuple(symbols), tuple(formulas)

    def __reduce__(self) -> tuple[Any, ...]:
        return EnergyFormulas, (self.symbols, self.formulas)

    @property
    def order(self) -> int:
        """The number of formulas."""
        return len(self.formulas)

    @property
    def evaluator(self) -> EnergyFormulas:
        """What evaluates it."""
        return self

    def symbolic(self, k: int) -> sympy.Expr:
        """What h^k multiplies."""
        return self.formulas[k]

    def _compiled(self, columns: Sequence[Sequence[sympy.Expr]]) -> CompiledFormulas:
        symbols = {symbol for formula in self.formulas for symbol in formula.free_symbols} - set(self.symbols)
        if symbols:
            names = ", ".join(sorted(map(str, symbols)))
            raise SeriesError(
                f"parameters of scene and method must be numbers in compiled code, but {names} are symbols"
            )
        return CompiledFormulas(self.symbols, columns)

    @cached_property
    def total(self) -> CompiledFormulas:
        """The sum, compiled."""
        return self._compiled([self.formulas])

    @cached_property
    def _terms(self) -> CompiledFormulas:
        return self._compiled([(formula,) for formula in self.formulas])

    @cached_property
    def _gradient(self) -> CompiledFormulas:
        return self._compiled([[formula.diff(x) for formula in self.formulas] for x in self.symbols])

    @property
    def compiled(self) -> Callable[[Any, float], float]:
        """The sum as a function (y, h) compiled by numba."""
        return self.total.module.first

    def values(self, states: np.ndarray, step: float, workers: int = 1) -> np.ndarray:
        """The sums at the rows of `states`."""
        return self.total.values(states, step, workers)[:, 0]

    def terms(self, states: np.ndarray, workers: int = 1) -> np.ndarray:
        """The terms at the rows of `states`: a row for each power of h."""
        return self._terms.values(states, 0.0, workers).T

    def gradient(self, states: np.ndarray, step: float, workers: int = 1) -> np.ndarray:
        """The gradients at the rows of `states`."""
        return self._gradient.values(states, step, workers)

    def precise(self, y: Sequence[Any], h: Any, digits: int) -> Any:
        """The sum at one point, in numbers of mpmath with the precision that is set; they have more than `digits`."""
        import mpmath
        import sympy

        # A variable may have the name of a function of mpmath, so symbols are replaced.
        terms = sympy.lambdify(self.symbols, list(self.formulas), "mpmath", cse=True, dummify=True)
        try:
            value = mpmath.polyval(terms(*y)[::-1], h)
        except ArithmeticError as error:
            raise SeriesError(f"y must lie in the domain of the energy, but there a formula {error}") from None
        if isinstance(value, mpmath.mpc):
            raise SeriesError("y must lie in the domain of the energy, but a formula was not real there")
        return value


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
        from bseries.fields.compiled_series import MOST_MONOMIALS, MOST_VARIABLES, contractions

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
