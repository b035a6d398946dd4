"""Exercise 5: the modified Hamiltonian of Field and Nijhoff in closed form."""

from __future__ import annotations

import math

import numpy as np
import sympy
from numpy.typing import NDArray

import bseries as bs
from integrators import Scene
from integrators.exact.functions import as_function


class FieldNijhoff:
    """The form (I ln I − (I − u) ln(I − u))/u − 1 with I = (α + p)(β + q) and u = h, or u = −h if implicit in q.

    The symplectic Euler method conserves I, multiplies α + p by 1 − u/I and divides β + q by it (or vice versa).
    """

    kind = "field-nijhoff"

    def __init__(self, scene: Scene, variant: str):
        self._arguments, self._sign = (scene, variant), 1 if variant == "p" else -1
        self.radius = self._invariant = sympy.exp(scene.hamiltonian)  # H = ln I
        self._numeric = as_function(scene.symbols, self._invariant, "numpy")

    def __reduce__(self) -> tuple[type, tuple[Scene, str]]:
        return FieldNijhoff, self._arguments

    def expression(self, h: sympy.Expr) -> sympy.Expr:
        """The formula for a step size."""
        i, u = self._invariant, self._sign * h
        return (i * sympy.log(i) - (i - u) * sympy.log(i - u)) / u - 1

    def radius_at(self, y: NDArray[np.float64]) -> float:
        """The least I at the rows of y; 0 where H is not defined."""
        return max(0.0, float(self._numeric(*y.T).min(initial=math.inf)))

    def values(self, y: NDArray[np.float64], h: float) -> NDArray[np.float64]:
        """Values of H̃, without cancellation for small steps."""
        i = self._numeric(*y.T)
        u = self._sign * h / i
        return np.log(i) - ((1 / u - 1) * np.log1p(-u) + 1 if h else 0)


def field_nijhoff(variant: str = "p", scene: Scene | str = "field-nijhoff") -> bs.hamiltonians.ClosedHamiltonian:
    """The modified Hamiltonian of the symplectic Euler method on H = ln(α + p) + ln(β + q).

    Args:
        variant: ``"p"`` for the method implicit in p, ``"q"`` for the one implicit in q.
        scene: The scene ``field-nijhoff``, with values of α and β.

    Example:
        >>> print(field_nijhoff())
        modified Hamiltonian of symplectic-euler-p on field-nijhoff, for |h| < (p + 1)*(q + 1)
        -1 + (-(-h + (p + 1)*(q + 1))*log(-h + (p + 1)*(q + 1)) + (p + 1)*(q + 1)*log((p + 1)*(q + 1)))/h

    References:
        C. M. Field, F. W. Nijhoff, Nonlinearity 16 (2003) 1673–1683; E. Hairer, lecture on long-time behaviour,
        exercise 5.
    """
    made = bs.scene(scene) if isinstance(scene, str) else scene
    label = f"symplectic-euler-{variant} on {made.name}"
    return bs.hamiltonians.ClosedHamiltonian(label, made, FieldNijhoff(made, variant))
