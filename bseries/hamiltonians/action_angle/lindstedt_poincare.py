"""Lindstedt–Poincaré series: normal forms of nearly integrable Hamiltonians, with the change of variables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import sympy

from bseries.exceptions import SeriesError
from bseries.fields.inputs import check_power, in_threads, power_sum, read_states, read_step
from bseries.fields.symbolic.differential_rings import MOST_MONOMIALS
from bseries.fields.symbolic.polynomials import TooLarge
from bseries.hamiltonians.action_angle.coordinate_change import read_pair
from bseries.hamiltonians.action_angle.elimination import Elimination
from bseries.hamiltonians.action_angle.fourier import FourierRing
from bseries.hamiltonians.action_angle.normal_form_maps import NormalFormMaps
from integrators.core.arguments import items
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.model.blocks import Block, check_symbols
from integrators.scenes.model.formulas import read_formula, read_numbers
from integrators.scenes.particles.expansion import filled
from integrators.scenes.scene import Scene


class SmallDenominator(NamedTuple):
    """Denominator k·ω at a point: k, the first order in ε at which it occurs, and its value.

    Example:
        >>> SmallDenominator((3, -2), 3, 0.26).k
        (3, -2)
    """

    k: tuple[int, ...]
    order: int
    value: float


class NormalForm:
    """Result of `lindstedt_poincare`: the new Hamiltonian, the generating function and the change of variables.

    The new variables (b, φ) have the names of the old ones (a, θ) in formulas and states. In the generating function
    S(b, θ), actions are new and angles old variables.

    Attributes:
        scene: The scene.
        parameter: The name of the small parameter ε.
        order: The largest power of ε.
        actions: The symbols of the actions.
        angles: The symbols of the angles.

    Example:
        >>> import bseries as bs
        >>> from bseries.hamiltonians.action_angle.lindstedt_poincare import lindstedt_poincare
        >>> H = "a1^2/2 + sqrt(2)*a2 + eps*cos(theta1 - theta2)"
        >>> rotors = bs.Scene({"a": 2, "theta": 2}, hamiltonian=H, parameters={"eps": "1/100"})
        >>> form = lindstedt_poincare(rotors, 2)
        >>> form.symbolic(2)
        1/(4*(a1 - sqrt(2))**2)
        >>> form.small_denominators(["3/2", 1], 1)
        [SmallDenominator(k=(1, -1), order=1, value=0.0857864376269...)]
        >>> b = form.to_normal([1, 1, 0.5, 0.25], 0.01)
        >>> form.from_normal(b, 0.01)
        array([1.  , 1.  , 0.5 , 0.25])
    """

    def __init__(self, scene: Scene, parameter: str, blocks: tuple[Block, Block], elimination: Elimination):
        self.scene, self.parameter, self._blocks, self._elimination = scene, parameter, blocks, elimination
        self.actions, self.angles = elimination.ring.actions, elimination.ring.angles
        self.order = len(elimination.normal) - 1

    @property
    def variables(self) -> tuple[str, ...]:
        """The names of the variables."""
        return self.scene.variables

    def symbolic(self, k: int) -> sympy.Expr:
        """The term of the new Hamiltonian with ε^k.

        Raises:
            SeriesError: The power is out of range.
        """
        check_power(k, self.order, self.parameter)
        return self._hamiltonians[k]

    @cached_property
    def _hamiltonians(self) -> list[sympy.Expr]:
        return [self._elimination.ring.waves_expression(term) for term in self._elimination.normal]

    def expression(self, eps: Any) -> sympy.Expr:
        """The new Hamiltonian for a value of the parameter, a number or a symbol.

        Raises:
            SeriesError: `eps` is neither a number nor an expression.
        """
        return power_sum(self._hamiltonians, eps, self.parameter)

    def generating_function(self, k: int) -> sympy.Expr:
        """The term S_k(b, θ) of the generating function with ε^k; S_0 = 0.

        Raises:
            SeriesError: The power is out of range.
        """
        check_power(k, self.order, self.parameter)
        return self._elimination.ring.waves_expression(self._elimination.generating[k])

    @property
    def resonances(self) -> Mapping[tuple[int, ...], int]:
        """The resonant modes k of the new Hamiltonian, with the first orders at which they occur."""
        return MappingProxyType(self._elimination.resonances)

    @cached_property
    def denominators(self) -> Mapping[tuple[int, ...], sympy.Expr]:
        """The formulas of the denominators k·ω(b), by k."""
        write = self._elimination.ring.to_expression
        return MappingProxyType({k: write(found.value) for k, found in self._elimination.denominators.items()})

    def small_denominators(self, actions: Any, count: int = 10) -> list[SmallDenominator]:
        """The smallest denominators at a point; zero for a resonance.

        Args:
            actions: The values of the actions.
            count: The number of denominators to list.

        Raises:
            SeriesError: `actions` are not the right number of numbers, or outside the domain of ω, or `count` is
                invalid.
        """
        if isinstance(count, bool) or not isinstance(count, int) or count < 0:
            raise SeriesError(f"count must be a whole number, 0 or more, but was {count!r:.60}")
        numbers = read_numbers(items(actions, "actions"), "actions")
        if len(numbers) != len(self.actions):
            raise SeriesError(f"actions must be {len(self.actions)} numbers, but were {len(numbers)}")
        values = dict(zip(self.actions, numbers, strict=True))
        found = []
        for k, formula in self.denominators.items():
            value: Any = formula.xreplace(values)
            if not (value.is_number and value.is_finite and value.is_real):
                raise SeriesError(f"actions must be where {formula!s:.60} is a real number, but there it was {value}")
            found.append(SmallDenominator(k, self._elimination.denominators[k].order, float(value)))
        return sorted(found, key=lambda entry: (abs(entry.value), entry.order, entry.k))[:count]

    # The change of variables.

    def to_normal(self, y: Any, eps: float, workers: int = 1) -> np.ndarray:
        """Map (a, θ) to (b, φ) at one point or many: b = a − ∇_θ S(b, θ), φ = θ + ∇_b S(b, θ).

        Args:
            y: The state, of shape (variables,), or (variables, n) for n points.
            eps: The value of the parameter.
            workers: The number of threads that share the points.

        Returns:
            An array of the shape of `y`.

        Raises:
            SeriesError: Newton's method does not converge at a point: ε is too large, or a denominator too small.
        """
        return self._mapped(False, y, eps, workers)

    def from_normal(self, y: Any, eps: float, workers: int = 1) -> np.ndarray:
        """Map (b, φ) to (a, θ), the inverse of `to_normal`."""
        return self._mapped(True, y, eps, workers)

    @cached_property
    def _maps(self) -> NormalFormMaps:
        from bseries.hamiltonians.action_angle.normal_form_maps import NormalFormMaps

        return NormalFormMaps(self._elimination)

    def _mapped(self, is_back: bool, y: Any, eps: Any, workers: int) -> np.ndarray:
        states, shape = read_states(y, self.scene.dimension)
        value, out, maps = read_step(eps, self.parameter), np.empty_like(states), self._maps
        actions, angles = (slice(block.offset, block.end) for block in self._blocks)

        def work(rows: slice) -> None:
            given = states[rows, actions], states[rows, angles]
            out[rows, actions], out[rows, angles] = maps.images(is_back, *given, value)

        in_threads(work, len(states), workers)
        failed = np.flatnonzero(~np.isfinite(out).all(axis=1))
        if failed.size:
            raise SeriesError(
                f"y must be where Newton's method can solve for the change of variables with {self.parameter} = "
                f"{value}, but at {failed.size} of {len(states)} points it could not, such as "
                f"{states[failed[0]].tolist()!s:.60}"
            )
        return out.T.reshape(shape)

    @cached_property
    def normal_scene(self) -> Scene:
        """The system with the truncated new Hamiltonian, as a scene with the parameter as a symbol."""
        blocks = {block.name: block.size for block in self.scene.blocks}
        energy = self.expression(sympy.Symbol(self.parameter))
        symbols = {str(symbol) for symbol in energy.free_symbols} - set(self.variables)
        names = {name: name for name in sorted({self.parameter, *symbols})}
        return Scene(blocks, hamiltonian=energy, parameters=names, name=f"normal form of {self.scene.name}")

    def __repr__(self) -> str:
        return f"<NormalForm of {self.scene.name} through {self.parameter}^{self.order}>"

    def __str__(self) -> str:
        rows = (f"{self.parameter}^{k:<3} {term}" for k, term in enumerate(self._hamiltonians))
        return "\n".join([f"normal form of {self.scene.name}", *rows])

    def to_dict(self) -> dict[str, Any]:
        """The series as plain data."""
        return {
            "schema": 1,
            "kind": "normal-form",
            "scene": self.scene.name,
            "parameter": self.parameter,
            "order": self.order,
            "actions": list(map(str, self.actions)),
            "angles": list(map(str, self.angles)),
            "terms": [
                {"power": k, "hamiltonian": str(term), "generating_function": str(self.generating_function(k))}
                for k, term in enumerate(self._hamiltonians)
            ],
            "denominators": [
                {"k": list(k), "order": self._elimination.denominators[k].order, "denominator": str(formula)}
                for k, formula in self.denominators.items()
            ],
            "resonances": [{"k": list(k), "order": order} for k, order in self.resonances.items()],
        }


def lindstedt_poincare(
    scene: Scene | str,
    order: int,
    *,
    parameter: str = "eps",
    perturbations: Iterable[Any] | None = None,
    keep_resonant: bool = False,
    limit: int = MOST_MONOMIALS,
) -> NormalForm:
    """Eliminate the angles of H = K(a) + ε H_1(a, θ) + ε² H_2(a, θ) + … up to a power of ε.

    The symplectic change of variables b = a − ∇_θ S(b, θ), φ = θ + ∇_b S(b, θ) with S = ε S_1 + … + ε^N S_N transforms
    H to K(b) + ε K_1(b) + … + ε^N K_N(b) + O(ε^(N+1)), so that b changes by O(t ε^(N+1)) along solutions. The formulas
    are exact, with denominators k·ω(b), ω = ∇K, for finitely many k.

    Args:
        scene: The system in action-angle variables, with blocks of actions and angles in the roles of p and q.
        order: The highest power N of ε.
        parameter: The name of ε, that of a parameter of the scene with any value.
        perturbations: Formulas H_1, H_2, … to be added to the Hamiltonian of the scene, which then need not have the
            parameter.
        keep_resonant: Whether to keep modes with k·ω = 0 for all actions in the new Hamiltonian, which then depends on
            resonant combinations of angles. Otherwise they raise an error.
        limit: Largest number of monomials in an intermediate result.

    Returns:
        The series, as a `NormalForm`.

    Raises:
        SeriesError: The scene is not Hamiltonian in all its variables, H has infinitely many Fourier modes, K depends
            on angles, a resonance occurs, or the formulas are too large.

    Example:
        >>> import bseries as bs
        >>> rotor = bs.Scene({"a": 1, "theta": 1}, hamiltonian="a^2/2 + eps*cos(theta)", parameters={"eps": "1/10"})
        >>> form = lindstedt_poincare(rotor, 4)
        >>> print(form)
        normal form of scene
        eps^0   a**2/2
        eps^1   0
        eps^2   1/(4*a**2)
        eps^3   0
        eps^4   5/(64*a**6)
        >>> form.generating_function(1), dict(form.denominators)
        (-sin(theta)/a, {(1,): a, (2,): 2*a, (3,): 3*a, (4,): 4*a})

    References:
        HLW, section X.2; E. Hairer, lecture on long-time behaviour, section 7; for resonant modes F. G. Gustavson,
        Astron. J. 71 (1966) 670, doi:10.1086/110172.
    """
    scene = as_scene(scene)
    if isinstance(order, bool) or not isinstance(order, int) or order < 1:
        raise SeriesError(f"order must be a whole number ≥ 1, but was {order!r:.60}")
    if not scene.is_hamiltonian:
        raise SeriesError(f"scene must be Hamiltonian, but {scene.name} is not")
    blocks = read_pair(scene, "scene")
    given = None if perturbations is None else items(perturbations, "perturbations")
    energies = _taylor_terms(scene, parameter, order, given)

    actions, angles = (scene.symbols[block.offset : block.end] for block in blocks)
    try:
        ring = FourierRing(energies, actions, angles, limit=limit)
        elimination = Elimination(ring, list(map(ring.read, energies)), keep_resonant=keep_resonant)
    except TooLarge:
        raise SeriesError(f"order must be smaller: a coefficient would have more than {limit} monomials") from None
    except RecursionError:
        raise SeriesError("hamiltonian must be nested less deeply than the interpreter's limit") from None
    return NormalForm(scene, parameter, blocks, elimination)


def _taylor_terms(scene: Scene, parameter: str, order: int, perturbations: Sequence[Any] | None) -> list[sympy.Expr]:
    """The Taylor coefficients H_0 = K, H_1, … of the Hamiltonian in the parameter."""
    known = isinstance(parameter, str) and parameter in scene.parameters
    if not known and perturbations is None:
        names = ", ".join(scene.parameters) or "none"
        raise SeriesError(f"parameter must be one of the scene's parameters, {names:.60}, but was {parameter!r:.60}")
    if parameter in scene.variables:
        raise SeriesError(f"parameter must have a name of its own, but {parameter:.60} is a variable")
    check_symbols([parameter], "parameter")
    rest: Any = (scene.with_parameters(**{parameter: parameter}) if known else scene).hamiltonian
    eps, zero, found = sympy.Symbol(parameter), sympy.Integer(0), []
    for m in range(order + 1):
        term: Any = rest.xreplace({eps: zero})
        if term.has(sympy.nan, sympy.zoo, sympy.oo):
            raise SeriesError(
                f"parameter must be one that can be small, but at {parameter} = 0 there is no Hamiltonian"
            )
        found.append(term)
        rest = rest.diff(eps) / (m + 1)
    names = [*scene.variables, *scene.parameter_values]
    for m, formula in enumerate(perturbations or [], 1):
        added = filled(read_formula(formula, names, f"perturbations[{m}]"), scene)
        if m <= order:
            found[m] += added
    return found
