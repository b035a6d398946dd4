"""Evaluation of modified Hamiltonians given as formulas."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from bseries.exceptions import SeriesError
from bseries.fields.compiled_formulas import CompiledFormulas

if TYPE_CHECKING:
    import numpy as np
    import sympy


class EnergyFormulas:
    """Sum Σ h^k · formula, evaluated by compiled functions or in any precision.

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
        """The object itself, which evaluates the sum."""
        return self

    def symbolic(self, k: int) -> sympy.Expr:
        """The coefficient of h^k."""
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
        """The sum as a numba function (y, h)."""
        return self.total.module.first

    def values(self, states: np.ndarray, step: float, workers: int = 1) -> np.ndarray:
        """The sums at the rows of `states`."""
        return self.total.values(states, step, workers)[:, 0]

    def terms(self, states: np.ndarray, workers: int = 1) -> np.ndarray:
        """The terms at the rows of `states`, one row for each power of h."""
        return self._terms.values(states, 0.0, workers).T

    def gradient(self, states: np.ndarray, step: float, workers: int = 1) -> np.ndarray:
        """The gradients at the rows of `states`."""
        return self._gradient.values(states, step, workers)

    def precise(self, y: Sequence[Any], h: Any, digits: int) -> Any:
        """The sum at one point, in the current precision of mpmath, which exceeds `digits`."""
        import mpmath
        import sympy

        # Dummy symbols, since a variable may have the name of a function of mpmath.
        terms = sympy.lambdify(self.symbols, list(self.formulas), "mpmath", cse=True, dummify=True)
        try:
            value = mpmath.polyval(terms(*y)[::-1], h)
        except ArithmeticError as error:
            raise SeriesError(f"y must lie in the domain of the energy, but there a formula {error}") from None
        if isinstance(value, mpmath.mpc):
            raise SeriesError("y must lie in the domain of the energy, but a formula was not real there")
        return value
