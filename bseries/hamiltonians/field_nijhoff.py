"""The Hamiltonian of Field and Nijhoff, H = c ln(α + p) + c ln(β + q), with the symplectic Euler methods."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .symplectic_stages import canonical_pairs, entry, symplectic_stages

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from integrators.scenes.base import Scene

    from ..coefficients import Method


class FieldNijhoff:
    """H̃ = c ((I ln I − (I − u) ln(I − u))/u − 1) with I = (α + p)(β + q) and u = c h, or u = −c h if implicit in q.

    The method conserves I, multiplies α + p by 1 − u/I and divides β + q by it (or the other way round).

    Args:
        invariant: I.
        c: The factor of H.
        sign: 1 if the method is implicit in p, −1 if it is in q.
        symbols: The variables.
    """

    kind = "field-nijhoff"

    def __init__(self, invariant: Any, c: Any, sign: int, symbols: Any):
        import sympy

        self._invariant, self._c, self._sign = invariant, c, sign
        self.radius = invariant / abs(c)
        self._numeric = sympy.lambdify(symbols, invariant, "numpy")

    @classmethod
    def of(cls, method: Method, scene: Scene, parts: Any) -> FieldNijhoff | None:
        """The closed form of a method on a scene, if they are such a pair."""
        import sympy

        pairs = canonical_pairs(scene)
        if len(pairs) != 1:
            return None
        p, q = (scene.symbols[i] for i in pairs[0])
        H: Any = scene.hamiltonian
        stages = symplectic_stages(method, scene, parts)
        kicks = [stage for stage in stages.stages if stage.kicks]
        drifts = [stage for stage in stages.stages if stage.drifts]
        if len(stages.stages) != 2 or len(kicks) != 1 or len(drifts) != 1:
            return None
        before = entry(drifts[0].at, kicks[0].forces), entry(kicks[0].at, drifts[0].velocities)
        factors = [sympy.cancel(1 / H.diff(x)) for x in (p, q)]
        slopes = [factor.diff(x) for factor, x in zip(factors, (p, q), strict=True)]
        linear = all(factor.free_symbols == {x} for factor, x in zip(factors, (p, q), strict=True))
        if sorted(before) != [0, 1] or not linear or slopes[0] != slopes[1] or not slopes[0].is_number:
            return None
        return cls(factors[0] * factors[1] / slopes[0] ** 2, 1 / slopes[0], 1 if before[0] else -1, (p, q))

    @property
    def limit(self) -> sympy.Expr:
        """The formula for h = 0."""
        import sympy

        return self._c * sympy.log(self._invariant)

    def expression(self, h: Any) -> sympy.Expr:
        """The formula."""
        import sympy

        i, u = self._invariant, self._sign * self._c * h
        return self._c * ((i * sympy.log(i) - (i - u) * sympy.log(i - u)) / u - 1)

    def radii(self, y: np.ndarray) -> np.ndarray:
        """|I/c|, where H is defined."""
        import numpy as np

        return np.maximum(self._numeric(*y.T) / abs(float(self._c)), 0)

    def values(self, y: np.ndarray, h: float) -> np.ndarray:
        """H̃, without cancellation for small steps."""
        import numpy as np

        i, c = self._numeric(*y.T), float(self._c)
        u = self._sign * c * h / i
        return c * (np.log(i) - ((1 / u - 1) * np.log1p(-u) + 1 if h else 0))
