"""Change of variables b = a − ∇_θ S(b, θ), φ = θ + ∇_b S(b, θ) at many points, in both directions.

S and its derivatives in the actions are Fourier sums. Their coefficients are sums of monomials: numbers times powers of
ε and of the generators of the coefficients, which are the only formulas to be evaluated.
"""

from __future__ import annotations

from itertools import chain

import numpy as np

from bseries.exceptions import SeriesError
from bseries.hamiltonians.action_angle.coordinate_change import continued
from bseries.hamiltonians.action_angle.elimination import Elimination
from trees.compiled import float_kernel

LARGEST_ARRAY = 2**18
"""The number of coefficients that are computed at a time: arrays of two megabytes."""


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
    """The maps for the generating function of an elimination."""

    def __init__(self, elimination: Elimination):
        import sympy

        ring, size = elimination.ring, len(elimination.ring.actions)
        found = [
            [ring.modes(ring.derivative(term, i - 1) if i else term) for term in elimination.generating]
            for i in range(size + 1)
        ]
        modes = sorted({k for term in found[0] for k in term})
        # Re Σ (c_k − i s_k) e^(ik·θ): a column for each real and each imaginary part.
        columns = [
            [
                (n, (1, -1)[part] * float(number), powers)
                for n, term in enumerate(kind)
                if k in term
                for powers, number in term[k][part].terms.items()
            ]
            for kind in found
            for k in modes
            for part in (0, 1)
        ]
        monomials = list(chain(*columns))
        powers = sorted({power for *_, factors in monomials for power in factors})
        formulas = [ring.generators[k] ** n for k, n in powers]
        unknown = sorted({str(x) for formula in formulas for x in formula.free_symbols.difference(ring.actions)})
        if unknown:
            raise SeriesError(f"scene must have numbers for its parameters to map points, but not for {unknown[0]}")
        self._powers = sympy.lambdify(ring.actions, formulas, "numpy", cse=True, dummify=True)
        self._orders = np.array([order for order, *_ in monomials])
        self._numbers = np.array([number for _, number, _ in monomials])
        index = {power: at for at, power in enumerate(powers)}
        factors = [[index[power] for power in powers] for *_, powers in monomials]
        first_factor, first_monomial = (np.cumsum([0, *map(len, parts)]) for parts in (factors, columns))
        self._tables = first_factor, np.array(list(chain(*factors)), int), first_monomial
        self._k = np.array(modes, float).reshape(-1, size)

    def images(
        self, is_back: bool, actions: np.ndarray, angles: np.ndarray, eps: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Map rows (a, θ) to (b, φ), or back; nan where the equations cannot be solved."""
        height = max(1, LARGEST_ARRAY // len(self._tables[-1]))
        if len(actions) > height:
            parts = [
                self.images(is_back, actions[k : k + height], angles[k : k + height], eps)
                for k in range(0, len(actions), height)
            ]
            return np.concatenate([first for first, _ in parts]), np.concatenate([second for _, second in parts])

        def slopes(x: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            """The change of the unknown x, its matrix, and the change of the other variables."""
            if is_back:
                along_angles, along_actions, mixed = self._slopes(known, self._waves(x))
                return along_actions, mixed, along_angles
            along_angles, along_actions, mixed = self._slopes(self._coefficients(x, eps), known)
            return along_angles, mixed.transpose(0, 2, 1), along_actions

        with np.errstate(all="ignore"):
            known = self._coefficients(actions, eps) if is_back else self._waves(angles)
            x = continued(lambda x, k: slopes(x, known[k])[:2], angles if is_back else actions)
            change = slopes(x, known)[2]
        return (actions + change, x) if is_back else (x, angles + change)

    def _coefficients(self, actions: np.ndarray, eps: float) -> np.ndarray:
        """The coefficients of S and its derivatives in the actions at each row: (rows, 1 + actions, modes), complex."""
        rows = self._powers(*actions.T)
        powers, out = np.empty((len(actions), len(rows))), np.empty((len(actions), len(self._tables[-1]) - 1))
        for column, row in zip(powers.T, rows, strict=True):
            column[:] = row
        sum_monomials.compiled(powers, self._numbers * eps**self._orders, *self._tables, out)
        return out.view(complex).reshape(len(actions), -1, len(self._k))

    def _waves(self, angles: np.ndarray) -> np.ndarray:
        """e^(ik·θ) at each row."""
        return np.exp(1j * (angles @ self._k.T))

    def _slopes(self, coefficients: np.ndarray, waves: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The gradients ∇_θ S and ∇_b S and the matrices ∂²S/∂b_i∂θ_j."""
        values = coefficients * waves[:, None]
        along_angles = -np.imag(values) @ self._k
        return along_angles[:, 0], np.real(values[:, 1:]).sum(axis=2), along_angles[:, 1:]
