"""Modified Hamiltonians in closed form: sums of convergent series, with their radii of convergence."""

from __future__ import annotations

from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from bseries.algebra.stages import check_method
from bseries.exceptions import SeriesError
from bseries.fields.inputs import read_states, read_step, read_symbolic_step
from bseries.hamiltonians.linear_hamiltonians import LinearHamiltonian, quadratic_form
from bseries.hamiltonians.symplectic_stages import canonical_pairs, entry, symplectic_stages

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from integrators.methods.program.program import Method
    from integrators.scenes.scene import Scene


class FieldNijhoff:
    """Closed form c ((I ln I − (I − u) ln(I − u))/u − 1), I = (α + p)(β + q), u = c h, or u = −c h if implicit in q.

    The method conserves I, multiplies α + p by 1 − u/I and divides β + q by it (or vice versa).

    Args:
        invariant: The invariant I.
        c: The factor of H.
        sign: 1 if the method is implicit in p, −1 if it is implicit in q.
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
        """The closed form of a symplectic Euler method on a scene of this kind; None for others."""
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
        rates = [factor.diff(x) for factor, x in zip(factors, (p, q), strict=True)]
        linear = all(factor.free_symbols == {x} for factor, x in zip(factors, (p, q), strict=True))
        if sorted(before) != [0, 1] or not linear or rates[0] != rates[1] or not rates[0].is_number:
            return None
        return cls(factors[0] * factors[1] / rates[0] ** 2, 1 / rates[0], 1 if before[0] else -1, (p, q))

    @property
    def limit(self) -> sympy.Expr:
        """The limit h → 0."""
        import sympy

        return self._c * sympy.log(self._invariant)

    def expression(self, h: Any) -> sympy.Expr:
        """The formula for a step size."""
        import sympy

        i, u = self._invariant, self._sign * self._c * h
        return self._c * ((i * sympy.log(i) - (i - u) * sympy.log(i - u)) / u - 1)

    def radii(self, y: np.ndarray) -> np.ndarray:
        """Radii of convergence |I/c|, where H is defined."""
        import numpy as np

        return np.maximum(self._numeric(*y.T) / abs(float(self._c)), 0)

    def values(self, y: np.ndarray, h: float) -> np.ndarray:
        """Values of H̃, without cancellation for small steps."""
        import numpy as np

        i, c = self._numeric(*y.T), float(self._c)
        u = self._sign * c * h / i
        return c * (np.log(i) - ((1 / u - 1) * np.log1p(-u) + 1 if h else 0))


class ClosedHamiltonian:
    """Modified Hamiltonian in closed form, the sum of its series; made by `closed_hamiltonian`.

    Attributes:
        label: The names of the method and the scene.
        scene: The scene.
        kind: ``"linear"`` or ``"field-nijhoff"``.
        radius: The radius of convergence in h, a number or a formula in the variables.

    Example:
        >>> import bseries as bs
        >>> closed = bs.closed_hamiltonian(bs.method("symplectic-euler-p"), bs.scene("field-nijhoff"))
        >>> closed.kind, closed.radius
        ('field-nijhoff', (p + 1)*(q + 1))
    """

    def __init__(self, method: Method, scene: Scene, parts: Any, form: FieldNijhoff | LinearHamiltonian):
        self.label = f"{method.name} on {scene.name}"
        self.scene, self._form, self._arguments = scene, form, (method, scene, parts)
        self.kind, self.radius = form.kind, form.radius

    def __reduce__(self) -> tuple[Any, ...]:
        method, scene, parts = self._arguments
        return partial(closed_hamiltonian, parts=parts), (method, scene)

    def __repr__(self) -> str:
        return f"<modified Hamiltonian of {self.label}: closed form for |h| < {self._shown_radius}>"

    def __str__(self) -> str:
        heading = f"modified Hamiltonian of {self.label}, for |h| < {self._shown_radius}"
        return heading if self._shown_formula is None else f"{heading}\n{self._shown_formula}"

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of the variables."""
        return self.scene.variables

    @property
    def _shown_radius(self) -> str:
        return f"{self.radius:.6g}" if isinstance(self.radius, float) else str(self.radius)

    @property
    def _shown_formula(self) -> str | None:
        """The formula as text; None without one."""
        import sympy

        try:
            return str(self.expression(sympy.Symbol("h")))
        except SeriesError:
            return None

    def expression(self, h: Any) -> sympy.Expr:
        """The formula for a step size, a number or a symbol.

        For linear systems the branches of roots and arc functions hold up to the first step size at which an eigenvalue
        of the step matrix is −1.

        Raises:
            SeriesError: `h` is neither a number nor an expression, or the frequencies of the linear system are not
                square roots.
        """
        return self._form.expression(read_symbolic_step(h)) + self._constant

    @cached_property
    def _constant(self) -> sympy.Expr:
        """The difference of H and the closed form for h = 0."""
        import sympy

        energy: Any = self.scene.hamiltonian
        return sympy.simplify(sympy.logcombine(sympy.expand(energy - self._form.limit), force=True))

    def __call__(self, y: Any, h: float) -> Any:
        """The value at one point or many.

        Args:
            y: The state, of shape (variables,), or (variables, n) for n points.
            h: The step size.

        Returns:
            A float, or an array of n.

        Raises:
            SeriesError: |h| is not less than the radius of convergence, or `y` has the wrong shape.
        """
        states, shape = read_states(y, self.scene.dimension)
        step = read_step(h)
        smallest = float(self._form.radii(states).min(initial=float("inf")))
        if not abs(step) < smallest:
            raise SeriesError(
                f"h must be less than {smallest:.6g}, the radius of convergence, in absolute value, but was {step}"
            )
        values = self._form.values(states, step) + float(self._constant)
        return float(values[0]) if len(shape) == 1 else values

    def to_dict(self) -> dict[str, Any]:
        """The closed form as plain data."""
        return {
            "schema": 1,
            "kind": "closed-hamiltonian",
            "label": self.label,
            "closed_form": self.kind,
            "variables": list(self.variables),
            "radius": self._shown_radius,
            "hamiltonian": self._shown_formula,
        }


def closed_hamiltonian(method: Method, scene: Scene, *, parts: Any = None) -> ClosedHamiltonian:
    """The modified Hamiltonian of a symplectic method as the sum of its series, where a closed form is known.

    - Linear systems with H = ½ yᵀSy: H̃ = yᵀ J log Φ_h y / (2h) with the step matrix Φ_h. It is R(hA), A = J⁻¹S, for
      Runge–Kutta methods, and the series converges if |hλ| < ρ for all eigenvalues λ of A, with ρ the distance of the
      nearest zero or pole of R from 0. For H = T(p) + U(q) also other methods made of kicks and drifts.
    - H = ln(α + p) + ln(β + q) with the symplectic Euler methods, which preserve I = (α + p)(β + q).

    Args:
        method: The method, exact.
        scene: The scene.
        parts: As for `modified_field`.

    Raises:
        SeriesError: No closed form is known, or the method is not symplectic.

    Example:
        >>> import bseries as bs
        >>> oscillator = bs.Scene({"p": 1, "q": 1}, hamiltonian="(p^2 + q^2)/2", name="oscillator")
        >>> print(closed_hamiltonian(bs.method("implicit-midpoint"), oscillator))
        modified Hamiltonian of implicit-midpoint on oscillator, for |h| < 2
        2*(p**2/2 + q**2/2)*atan(h/2)/h
        >>> print(closed_hamiltonian(bs.method("symplectic-euler-p"), bs.scene("field-nijhoff")))
        modified Hamiltonian of symplectic-euler-p on field-nijhoff, for |h| < (p + 1)*(q + 1)
        -1 + (-(-h + (p + 1)*(q + 1))*log(-h + (p + 1)*(q + 1)) + (p + 1)*(q + 1)*log((p + 1)*(q + 1)))/h

    References:
        E. Hairer, lecture on long-time behaviour, example 3 and exercise 5; C. M. Field, F. W. Nijhoff, Nonlinearity 16
        (2003) 1673–1683.
    """
    check_method(method)
    canonical_pairs(scene)
    form = quadratic_form(scene)
    found = FieldNijhoff.of(method, scene, parts) if form is None else LinearHamiltonian(method, scene, form, parts)
    if found is None:
        raise SeriesError(
            "scene must be linear, or ln(α + p) + ln(β + q) with a symplectic Euler method, for a closed form, but was "
            f"{scene.name} with {method.name}"
        )
    return ClosedHamiltonian(method, scene, parts, found)
