"""Change of variables b = a − ∇_θ S(b, θ), φ = θ + ∇_b S(b, θ) at many points, in both directions.

S and its derivatives in the actions are Fourier sums. Their coefficients are sums of monomials: numbers times powers of
ε and of the generators of the coefficients, which are the only formulas to be evaluated.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bseries.exceptions import SeriesError
from bseries.hamiltonians.action_angle.newton import continued
from trees.compiled import float_kernel

if TYPE_CHECKING:
    from bseries.hamiltonians.action_angle.elimination import Elimination

LARGEST_ARRAY = 2**18
"""The number of coefficients that are computed at a time."""


@float_kernel
def sum_monomials(powers, numbers, first_factor, factors, first_monomial, out):
    """Compute each column of `out` as a sum of monomials: numbers times columns of `powers`, point by point."""
    for point in range(len(out)):
        for column in range(len(first_monomial) - 1):
            total = 0.0
            for monomial in range(first_monomial[column], first_monomial[column + 1]):
                x = numbers[monomial]
                for k in range(first_factor[monomial], first_factor[monomial + 1]):
                    x *= powers[point, factors[k]]
                total += x
            out[point, column] = total


class NormalFormMaps:
    """The maps for the generating function of an elimination.

    Coefficients are columns: first those of S, then those of ∂S/∂b_1, ∂S/∂b_2, …

    Args:
        elimination: The series S.
    """

    def __init__(self, elimination: Elimination):
        import sympy

        fourier, size = elimination.fourier, len(elimination.fourier.actions)
        columns: dict[tuple[int, ...], list[tuple[int, Any, Any]]] = {}
        for kind in range(size + 1):
            for order, term in enumerate(elimination.generating):
                for mode, x in (fourier.along_action(term, kind - 1) if kind else term).items():
                    found = columns.setdefault((kind, mode.is_sine, *mode.k), [])
                    found += [(order, number, powers) for powers, number in x.terms.items()]
        monomials = [monomial for column in columns.values() for monomial in column]
        powers = sorted({power for *_, factors in monomials for power in factors})
        formulas = [fourier.coefficients.generators[k] ** n for k, n in powers]
        unknown = sorted({str(x) for formula in formulas for x in formula.free_symbols.difference(fourier.actions)})
        if unknown:
            raise SeriesError(f"scene must have numbers for its parameters to map points, but not for {unknown[0]}")
        self._powers = sympy.lambdify(fourier.actions, formulas, "numpy", cse=True, dummify=True)
        self._orders = np.array([order for order, *_ in monomials])
        self._numbers = np.array([float(number) for _, number, _ in monomials])
        index = {power: at for at, power in enumerate(powers)}
        first_factor = np.cumsum([0, *(len(factors) for *_, factors in monomials)])
        factors = np.array([index[power] for *_, factors in monomials for power in factors], int)
        self._tables = first_factor, factors, np.cumsum([0, *map(len, columns.values())])
        table = np.array(list(columns), int).reshape(-1, size + 2)
        self._is_sine, self._k = table[:, 1] == 1, table[:, 2:].astype(float)
        self._modes, mode = np.unique(self._k, axis=0, return_inverse=True)
        self._mode = mode.ravel()  # NumPy 2.0 gives it a second axis
        self._kinds = [slice(*np.searchsorted(table[:, 0], [kind, kind + 1])) for kind in range(size + 1)]

    def images(
        self, is_back: bool, actions: np.ndarray, angles: np.ndarray, eps: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Map rows (a, θ) to (b, φ), or back; nan where the equations cannot be solved."""
        height = max(1, LARGEST_ARRAY // max(1, len(self._k)))
        with np.errstate(all="ignore"):
            parts = [
                self._part(is_back, actions[k : k + height], angles[k : k + height], eps)
                for k in range(0, len(actions), height)
            ]
        first, second = zip(*parts, strict=True)
        return np.concatenate(first), np.concatenate(second)

    def _part(
        self, is_back: bool, actions: np.ndarray, angles: np.ndarray, eps: float
    ) -> tuple[np.ndarray, np.ndarray]:
        fixed = self._coefficients(actions, eps) if is_back else self._waves(angles)

        def shift(x: np.ndarray, k: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            known = fixed if len(k) == len(fixed) else fixed[k]
            if is_back:
                _, along_actions, mixed = self._slopes(known, self._waves(x))
                return along_actions, mixed.transpose(0, 2, 1)
            along_angles, _, mixed = self._slopes(self._coefficients(x, eps), known)
            return along_angles, mixed

        if is_back:
            angles = continued(shift, angles)
            along_angles, _, _ = self._slopes(fixed, self._waves(angles))
            return actions + along_angles, angles
        actions = continued(shift, actions)
        _, along_actions, _ = self._slopes(self._coefficients(actions, eps), fixed)
        return actions, angles + along_actions

    def _coefficients(self, actions: np.ndarray, eps: float) -> np.ndarray:
        """The coefficients at each row: sums of monomials."""
        rows = self._powers(*actions.T)
        powers, out = np.empty((len(actions), len(rows))), np.empty((len(actions), len(self._k)))
        for column, row in zip(powers.T, rows, strict=True):
            column[:] = row
        sum_monomials.compiled(powers, self._numbers * eps**self._orders, *self._tables, out)
        return out

    def _waves(self, angles: np.ndarray) -> np.ndarray:
        """cos k·θ or sin k·θ, and its derivative in k·θ, for each column."""
        phase = angles @ self._modes.T
        cosine, sine = np.cos(phase)[:, self._mode], np.sin(phase)[:, self._mode]
        waves = np.where(self._is_sine, sine, cosine), np.where(self._is_sine, cosine, -sine)
        return np.stack(waves, axis=1)

    def _slopes(self, coefficients: np.ndarray, waves: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The gradients ∇_θ S and ∇_b S and the matrices ∂²S/∂θ_i∂b_j."""
        values, derivatives = coefficients * waves[:, 0], coefficients * waves[:, 1]
        along_angles, *mixed = (derivatives[:, kind] @ self._k[kind] for kind in self._kinds)
        along_actions = [values[:, kind].sum(axis=1) for kind in self._kinds[1:]]
        return along_angles, np.stack(along_actions, axis=1), np.stack(mixed, axis=2)
