"""Changes of coordinates y = ψ(z) as maps of arrays, and their inverses by Newton's method."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..exceptions import SeriesError
from ..states import read_states

if TYPE_CHECKING:
    import sympy

MOST_STEPS = 50
SETTLED = 1e-10
"""An iteration that moves by less has converged; it goes on until it comes no nearer."""


class CoordinateMaps:
    """ψ and its inverse for arrays (variables,) or (variables, n).

    Args:
        formulas: ψ.
        symbols: The variables z.
        brackets: Ω⁻¹ of the new variables, their brackets among themselves.
        inverse: Ω of the old variables, the inverse of their brackets.
    """

    def __init__(
        self,
        formulas: Iterable[sympy.Expr],
        symbols: Sequence[sympy.Symbol],
        brackets: Sequence[Sequence[int]],
        inverse: Sequence[Sequence[int]],
    ):
        import sympy

        self._size = len(symbols)
        self._brackets, self._inverse = np.array(brackets, float), np.array(inverse, float)
        rows = list(formulas)
        slopes = [row.diff(symbol) for row in rows for symbol in symbols]
        self._psi, self._slopes = (
            sympy.lambdify(symbols, entries, "numpy", cse=True, dummify=True) for entries in (rows, slopes)
        )

    def to_old(self, z: Any) -> np.ndarray:
        """ψ(z)."""
        states, shape = read_states(z, self._size)
        return self._value(self._psi, states.T).reshape(shape)

    def to_new(self, y: Any, near: Any) -> np.ndarray:
        """The z with ψ(z) = y, from guesses: one for all, or one for each."""
        states, shape = read_states(y, self._size)
        guesses, _ = read_states(near, self._size)
        if len(guesses) not in (1, len(states)):
            raise SeriesError(f"near must be one point or {len(states)}, but was {len(guesses)}")
        wanted = states.T
        z = np.broadcast_to(guesses.T, wanted.shape).copy()
        moved = np.inf
        for _ in range(MOST_STEPS):
            jacobian = self._value(self._slopes, z).reshape(self._size, *z.shape)
            residual = self._value(self._psi, z) - wanted
            # ψ' is symplectic: its inverse is Ω⁻¹ ψ'ᵀ Ω.
            step = np.einsum("ij,kjn,kl,ln->in", self._brackets, jacobian, self._inverse, residual)
            z -= step
            last, moved = moved, float(np.max(np.abs(step) / (1 + np.abs(z)), initial=0.0))
            if moved == 0 or moved >= last < SETTLED:
                return z.reshape(shape)
        raise SeriesError("near must be closer to the solution, but from there Newton's method did not converge")

    def _value(self, function: Any, z: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            return np.array([np.broadcast_to(entry, z.shape[1:]) for entry in function(*z)], float)
