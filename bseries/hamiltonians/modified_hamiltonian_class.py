"""Modified Hamiltonians as functions of the state and the step size, whichever way they were found."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from bseries.algebra.bseries import BSeries
from bseries.exceptions import SeriesError
from bseries.fields.inputs import check_power, read_states, read_step, read_symbolic_step, warn_where_not_finite
from bseries.fields.scene_series import modified_field
from bseries.hamiltonians.evaluation import EnergyFormulas
from bseries.hamiltonians.verdicts import HamiltonianVerdict, name_of, verdict_beyond
from bseries.scene_text import formula_notes, hamiltonian_equation, head, place, remarks, span
from bseries.table import Column, Table, listed
from integrators.reference.plain_arithmetic import Arithmetic

if TYPE_CHECKING:
    import numpy as np
    import sympy

    from bseries.fields.scene_series import SceneSeries
    from bseries.hamiltonians.evaluation import EnergySeries
    from integrators import Scene
    from integrators.methods.program.program import Method


class ModifiedHamiltonian:
    """The modified Hamiltonian H̃ = H + h H_2 + h² H_3 + …, truncated, as a function of the state and the step size.

    Such functions are made by `modified_hamiltonian`. For h = 0 it is H, with its constant.

    Attributes:
        method: The method, or the field series.
        scene: The scene.
        order: The number of terms N: powers h^0 … h^(N−1).
        parts: What the method's parts are on the scene, if that was said.
        route: How it was found: ``"trees"``, ``"brackets"``, ``"generating-function"`` or ``"integration"``.

    Example:
        >>> import bseries as bs
        >>> H = bs.modified_hamiltonian(bs.method("implicit-midpoint"), bs.scene("pendulum"), 5)
        >>> H
        <the modified Hamiltonian of implicit-midpoint on pendulum: order 5, by trees>
        >>> H.symbolic(2)
        -p**2*cos(q)/24 - sin(q)**2/24
        >>> H([0.0, -1.5], 0.1), H.gradient([0.0, -1.5], 0.1).round(6).tolist()
        (-0.071151..., [0.0, -0.997436])
    """

    def __init__(
        self,
        method: Method | BSeries,
        scene: Scene,
        order: int,
        parts: Any,
        route: str,
        energy: EnergySeries | EnergyFormulas,
    ):
        self.method, self.scene, self.order, self.parts, self.route = method, scene, order, parts, route
        self._energy = energy

    def __reduce__(self) -> tuple[Any, ...]:
        return ModifiedHamiltonian, (self.method, self.scene, self.order, self.parts, self.route, self._energy)

    @property
    def label(self) -> str:
        """What it is the modified Hamiltonian of."""
        return f"the modified Hamiltonian of {name_of(self.method)}"

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of the variables."""
        return self.scene.variables

    def __repr__(self) -> str:
        return f"<{self.label} on {self.scene.name}: order {self.order}, by {self.route}>"

    def __str__(self) -> str:
        rows = (f"h^{k:<3} {self.symbolic(k)}" for k in range(self.order))
        limit = self.verdict.limit()
        return "\n".join([f"{self.label} on {self.scene.name}", *rows, *([limit] if limit else [])])

    @cached_property
    def verdict(self) -> HamiltonianVerdict:
        """How far there is a modified Hamiltonian, which may end with the terms here: looked at beyond them.

        Example:
            >>> import bseries as bs
            >>> H = bs.modified_hamiltonian(bs.method("rk4"), bs.scene("pendulum"), 5)
            >>> H.verdict.exists_through
            4
            >>> print(H.verdict.limit())
            H~ exists through h^4 only: on pendulum the term with h^5 has no Hamiltonian; the first tree to break it for
            all H is [τ,[[τ]]].
        """
        return verdict_beyond(self.method, self.scene, self.order, self.parts)

    def __call__(self, y: Any, h: float, workers: int = 1) -> Any:
        """The value at one point or many.

        Args:
            y: The state, of shape (variables,), or (variables, n) for n points.
            h: The step size.
            workers: The number of threads that share the points.

        Returns:
            A float, or an array of shape (n,).

        Raises:
            SeriesError: `y` has another number of variables, or is not of numbers.
        """
        states, shape = read_states(y, self.scene.dimension)
        step = read_step(h)
        values = self._energy.evaluator.values(states, step, workers)
        warn_where_not_finite(values, f"{self.label} on {self.scene.name}", step, stacklevel=3)
        return values if len(shape) == 2 else float(values[0])

    def terms(self, y: Any, *, workers: int = 1) -> np.ndarray:
        """The terms at one point or many, without powers of h.

        Args:
            y: As for calls.
            workers: The number of threads that share the points.

        Returns:
            An array (order,) or (order, n): its k-th row is what h^k multiplies.
        """
        states, shape = read_states(y, self.scene.dimension)
        return self._energy.evaluator.terms(states, workers).reshape(self.order, *shape[1:])

    @property
    def compiled(self) -> Any:
        """A function (y, h) compiled by numba, for use in other compiled code."""
        return self._energy.evaluator.compiled

    def observer(self, h: float) -> Callable[[float, Any], float]:
        """A function (t, y) that `bs.integrate` can observe.

        Example:
            >>> import bseries as bs
            >>> pendulum, midpoint = bs.scene("pendulum"), bs.method("implicit-midpoint")
            >>> H = bs.modified_hamiltonian(midpoint, pendulum, 3)
            >>> run = bs.integrate(pendulum, midpoint, h=0.1, steps=1000, observe={"H": H.observer(0.1)})
            >>> bool(abs(run.observed["H"] - run.observed["H"][0]).max() < 1e-6)
            True
        """
        step, compiled = read_step(h), self.compiled

        def modified_energy(t: float, y: Any) -> float:
            """The modified Hamiltonian at y."""
            return compiled(y, step)

        return modified_energy

    def precise(self, y: Any, h: Any, digits: int = 50) -> Any:
        """The value at one point in so many digits, as a number of mpmath.

        Args:
            y: One point: numbers, fractions, text or numbers of mpmath.
            h: The step size.
            digits: The number of decimal digits.

        Raises:
            SeriesError: The coefficients are not known to so many digits, or `y` has another number of values.
            IntegratorError: An argument is not of its kind.
        """

        arithmetic = Arithmetic(digits)
        with arithmetic.working():
            point = arithmetic.read(y, "y")
            if len(point) != self.scene.dimension:
                raise SeriesError(f"y must have {self.scene.dimension} values, but had {len(point)}")
            value = self._energy.precise(list(point), arithmetic.number(h, "h"), digits)
            return arithmetic.rounded(arithmetic.vector([value]))[0]

    def symbolic(self, k: int) -> sympy.Expr:
        """The formula of what h^k multiplies.

        Args:
            k: The power of h, from 0 to order − 1.

        Raises:
            SeriesError: There is no such power.
        """
        check_power(k, self.order - 1)
        if k not in self._formulas:
            self._formulas[k] = self._energy.symbolic(k)
        return self._formulas[k]

    @cached_property
    def _formulas(self) -> dict[int, sympy.Expr]:
        return {}

    def expression(self, h: Any) -> sympy.Expr:
        """The whole formula for a step size, a number or a symbol.

        Raises:
            SeriesError: `h` is neither.
        """
        import sympy

        step = read_symbolic_step(h)
        return sympy.Add(*(self.symbolic(k) * step**k for k in range(self.order)))

    @cached_property
    def field(self) -> SceneSeries:
        """The truncated modified equation, whose Hamiltonian it is."""
        return modified_field(self.method, self.scene, self.order, parts=self.parts)

    def gradient(self, y: Any, h: float, workers: int = 1) -> np.ndarray:
        """The gradient at one point or many; for trees it is the field, f = (−∂H̃/∂q, ∂H̃/∂p), read from it.

        Args:
            y: As for calls.
            h: The step size.
            workers: The number of threads that share the points.

        Returns:
            An array of the shape of `y`.
        """
        import numpy as np

        if isinstance(self._energy, EnergyFormulas):
            states, shape = read_states(y, self.scene.dimension)
            return self._energy.gradient(states, read_step(h), workers).T.reshape(shape)
        field = self.field(y, h, workers=workers)
        gradient = np.empty_like(field)
        momenta, positions = (slice(block.offset, block.end) for block in self.scene.canonical_pair or ())
        gradient[momenta], gradient[positions] = field[positions], -field[momenta]
        return gradient

    def to_dict(self) -> dict[str, Any]:
        """The formulas as JSON-ready data."""
        return {
            "schema": 1,
            "kind": "hamiltonian",
            "method": name_of(self.method),
            "scene": self.scene.name,
            "route": self.route,
            "order": self.order,
            "variables": list(self.variables),
            "exists_through": self.verdict.exists_through,
            "verdict": self.verdict.to_dict(),
            "terms": [{"power": k, "hamiltonian": str(self.symbolic(k))} for k in range(self.order)],
        }

    def to_latex(self) -> str:
        """The formula as LaTeX, without terms that vanish; it says where the modified Hamiltonian ends."""
        import sympy

        terms = [(k, sympy.latex(self.symbolic(k))) for k in range(self.order) if self.symbolic(k) != 0]
        powers = {0: "", 1: "h ", **{k: f"h^{{{k}}} " for k, _ in terms if k > 1}}
        formula = " + ".join(f"{powers[k]}\\left({text}\\right)" if k else text for k, text in terms) or "0"
        limit = self.verdict.limit(latex=True)
        return f"{formula}\\quad\\text{{({limit})}}" if limit else formula

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle {self.to_latex()}$"

    def to_table(
        self, powers: Sequence[int] | None = None, *, nonzero: bool = False, effects: Sequence[str] | None = None
    ) -> Table:
        """The formulas as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            powers: Consecutive powers of h; by default all.
            nonzero: Leave out formulas that are zero.
            effects: Effects for the title; by default those that are on.
        """
        powers = range(self.order) if powers is None else powers
        terms = [(k, self.symbolic(k)) for k in powers]
        rows = [(k, formula) for k, formula in terms if formula != 0 or not nonzero]
        method, scene, series = name_of(self.method), self.scene, self.field.series
        issues = getattr(self.method, "issues", ())
        meaning = "The numerical solution follows the system with the Hamiltonian Σ h^k · (coefficient of h^k)."

        def data() -> dict[str, Any]:
            return {
                **head("hamiltonian", method, scene, effects),
                "order": self.order,
                "route": self.route,
                "domain": series.domain,
                "variables": list(self.variables),
                "exists_through": self.verdict.exists_through,
                "verdict": self.verdict.to_dict(),
                **remarks(series, issues, scene),
                "terms": [{"power": k, "hamiltonian": str(formula)} for k, formula in rows],
            }

        return Table(
            f"Modified Hamiltonian of {place(method, scene, effects)}: {span(powers)}, by {self.route}",
            (Column("k", True), Column("coefficient of h^k")),
            rows,
            [self.verdict.limit() or meaning, *formula_notes(series, issues, scene, nonzero=nonzero)],
            data=data,
            items="terms",
            records=listed([("power", itemgetter(0)), ("hamiltonian", itemgetter(1))], rows),
            own={"latex": lambda width: hamiltonian_equation(scene, terms, self.verdict.limit(latex=True))},
        )
