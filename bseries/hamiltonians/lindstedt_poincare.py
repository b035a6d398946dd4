"""Lindstedt–Poincaré series: normal forms of nearly integrable Hamiltonians, with the change of variables.

For H(a, θ) = K(a) + ε H_1(a, θ) + ε² H_2(a, θ) + … a generating function S(b, θ) = ε S_1 + ε² S_2 + … is found such
that H(b + ∇_θ S, θ) = N(b, θ + ∇_b S), where N depends on resonant angles only, and on none without resonances. With
the terms of lower orders known, the terms with ε^n are

    ω(b)·∇_θ S_n + R_n(b, θ) = N_n(b, θ),    ω = ∇K,

where R_n is the remainder of both compositions. N_n is the mean of R_n, with its resonant modes (k·ω = 0). The other
modes, divided by k·ω(b), give S_n.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from itertools import chain
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import sympy
from numpy.typing import ArrayLike

from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import MOST_MONOMIALS, Composition, PowerSeries
from bseries.fields.inputs import Formula, Step, check_power, in_threads, power_sum, read_states, read_step
from bseries.fields.polynomials import Element, TooLarge
from bseries.hamiltonians.canonical_transformations import Equations, newton, read_pair
from bseries.hamiltonians.fourier import FourierRing, Mode
from bseries_base.formulas import formula_text
from bseries_base.kernels import float_kernel
from integrators.core.arguments import items
from integrators.core.immutable import cached_method
from integrators.exact.functions import as_function
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.model.blocks import Block, check_symbols
from integrators.scenes.model.formulas import read_formula, read_numbers
from integrators.scenes.particles.expansion import filled
from integrators.scenes.scene import Scene


class Elimination:
    """The series S and N for the Hamiltonian K + ε H_1 + …; resonant modes raise an error or stay in N."""

    def __init__(self, ring: FourierRing, terms: Sequence[Element], *, keep_resonant: bool = False):
        self.ring, self._keep = ring, keep_resonant
        if ring.modes(terms[0]).keys() - {ring.constant}:
            names = ", ".join(map(str, ring.actions))
            raise SeriesError(
                f"hamiltonian must depend on {names:.60} only where the parameter is 0, "
                f"but is {ring.waves_expression(terms[0])!s:.60} there"
            )
        d = len(ring.actions)
        self._frequencies = [ring.derivative(terms[0], i) for i in range(d)]
        self.generating, self.normal = [ring.zero], [terms[0]]
        self.denominators: dict[Mode, tuple[Element, int]] = {}  # k·ω(b), and the first order at which it occurs
        self.resonances: dict[Mode, int] = {}  # the first orders at which they occur
        actions, angles = [self._shifted(i, d + i) for i in range(d)], [self._shifted(d + i, i) for i in range(d)]
        fixed = [PowerSeries.polynomial(ring.element(x)) for x in ring.variables]
        at_actions, at_angles = Composition(ring, [*actions, *fixed[d:]]), Composition(ring, [*fixed[:d], *angles])
        frequencies, left = [at_actions(x) for x in self._frequencies], [at_actions(x) for x in terms]
        right = [at_angles(terms[0])]
        for n in range(1, len(terms)):
            # n K_n = Σ m a_m·ω_{n−m} for K and ω at the actions a; the summand with m = n has the unknown S_n.
            moved = zip(actions, frequencies, strict=True)
            known = ring.dot((Fraction(m, n) * a[m], omega[n - m]) for a, omega in moved for m in range(1, n))
            perturbed = ring.dot((1, left[m][n - m]) for m in range(1, n + 1))
            self._split(known + perturbed - ring.dot((1, right[m][n - m]) for m in range(1, n)), n)
            right.append(at_angles(self.normal[n]))

    def _shifted(self, i: int, partner: int) -> PowerSeries:
        """A variable plus the derivative of S in its partner, as a series in ε."""
        start, ring = self.ring.element(self.ring.variables[i]), self.ring
        return PowerSeries(ring, lambda n: ring.derivative(self.generating[n], partner) if n else start)

    def _split(self, rest: Element, order: int) -> None:
        """Split R_n into the terms S_n and N_n, and append them."""
        ring, generating, normal = self.ring, list[tuple[Element, Element]](), list[tuple[Element, Element]]()
        for k, (c, s) in ring.modes(rest).items():
            cosine, sine = ring.wave(k)
            denominator, reciprocal = self._denominator(k)
            if reciprocal is not None:
                self.denominators.setdefault(k, (denominator, order))
                generating += [(s * reciprocal, cosine), (-c * reciprocal, sine)]
            elif k == ring.constant or not (ring.is_zero(c) and ring.is_zero(s)):
                normal += [(c, cosine), (s, sine)]
                if any(k) and not self._keep:
                    raise SeriesError(
                        f"hamiltonian must have no resonance through its terms of order {order}, but k·omega = 0 "
                        f"for k = ({', '.join(map(str, k))}): see keep_resonant"
                    )
                if any(k):
                    self.resonances.setdefault(k, order)
        self.generating.append(ring.dot(generating))
        self.normal.append(ring.dot(normal))

    @cached_method
    def _denominator(self, k: Mode) -> tuple[Element, Element | None]:
        """k·ω(b) and its reciprocal, which is None for a resonance."""
        value = self.ring.dot(zip(k, self._frequencies, strict=True))
        return value, None if self.ring.is_zero(value) else self.ring.reciprocal(value)


class SmallDenominator(NamedTuple):
    """Denominator k·ω at a point: k, the first order in ε at which it occurs, and its value."""

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
        >>> H = "a1^2/2 + sqrt(2)*a2 + eps*cos(theta1 - theta2)"
        >>> rotors = bs.Scene({"a": 2, "theta": 2}, hamiltonian=H, parameters={"eps": "1/100"})
        >>> form = bs.hamiltonians.lindstedt_poincare(rotors, 2)
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
        return self.terms[k]

    @cached_property
    def terms(self) -> list[sympy.Expr]:
        """The terms of the new Hamiltonian by power of ε."""
        return [self._elimination.ring.waves_expression(term) for term in self._elimination.normal]

    def expression(self, eps: Step) -> sympy.Expr:
        """The new Hamiltonian for a value of the parameter, a number or a symbol.

        Raises:
            SeriesError: `eps` is neither a number nor an expression.
        """
        return power_sum(self.terms, eps, self.parameter)

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
        return MappingProxyType({k: write(value) for k, (value, _) in self._elimination.denominators.items()})

    def small_denominators(self, actions: Iterable[object], count: int = 10) -> list[SmallDenominator]:
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
            value: Formula = formula.xreplace(values)
            if not (value.is_number and value.is_finite and value.is_real):
                raise SeriesError(f"actions must be where {formula!s:.60} is a real number, but there it was {value}")
            found.append(SmallDenominator(k, self._elimination.denominators[k][1], float(value)))
        return sorted(found, key=lambda entry: (abs(entry.value), entry.order, entry.k))[:count]

    # The change of variables.

    def to_normal(self, y: ArrayLike, eps: float, workers: int = 1) -> np.ndarray:
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

    def from_normal(self, y: ArrayLike, eps: float, workers: int = 1) -> np.ndarray:
        """Map (b, φ) to (a, θ), the inverse of `to_normal`."""
        return self._mapped(True, y, eps, workers)

    @cached_property
    def _maps(self) -> NormalFormMaps:
        return NormalFormMaps(self._elimination)

    def _mapped(self, is_back: bool, y: ArrayLike, eps: float, workers: int) -> np.ndarray:
        states, shape = read_states(y, self.scene.dimension)
        value, out, maps = read_step(eps, self.parameter), np.empty_like(states), self._maps
        actions, angles = (slice(block.offset, block.end) for block in self._blocks)

        def work(rows: slice) -> None:
            for first in range(rows.start, rows.stop, maps.height):
                some = slice(first, min(first + maps.height, rows.stop))
                given = states[some, actions], states[some, angles]
                out[some, actions], out[some, angles] = maps.images(is_back, *given, value)

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
        rows = (f"{self.parameter}^{k:<3} {formula_text(term)}" for k, term in enumerate(self.terms))
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
                {
                    "power": k,
                    "hamiltonian": formula_text(term),
                    "generating_function": formula_text(self.generating_function(k)),
                }
                for k, term in enumerate(self.terms)
            ],
            "denominators": [
                {"k": list(k), "order": self._elimination.denominators[k][1], "denominator": formula_text(formula)}
                for k, formula in self.denominators.items()
            ],
            "resonances": [{"k": list(k), "order": order} for k, order in self.resonances.items()],
        }


def lindstedt_poincare(
    scene: Scene | str,
    order: int,
    *,
    parameter: str = "eps",
    perturbations: Iterable[object] | None = None,
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

    Raises:
        SeriesError: The scene is not Hamiltonian in all its variables, H has infinitely many Fourier modes, K depends
            on angles, a resonance occurs, or the formulas are too large.

    Example:
        >>> import bseries as bs
        >>> rotor = bs.Scene({"a": 1, "theta": 1}, hamiltonian="a^2/2 + eps*cos(theta)", parameters={"eps": "1/10"})
        >>> form = bs.hamiltonians.lindstedt_poincare(rotor, 4)
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


def _taylor_terms(scene: Scene, parameter: str, order: int, perturbations: Sequence[object] | None) -> list[sympy.Expr]:
    """The Taylor coefficients H_0 = K, H_1, … of the Hamiltonian in the parameter."""
    known = isinstance(parameter, str) and parameter in scene.parameters
    if not known and perturbations is None:
        names = ", ".join(scene.parameters) or "none"
        raise SeriesError(f"parameter must be one of the scene's parameters, {names:.60}, but was {parameter!r:.60}")
    if parameter in scene.variables:
        raise SeriesError(f"parameter must have a name of its own, but {parameter:.60} is a variable")
    check_symbols([parameter], "parameter")
    rest: Formula = (scene.with_parameters(**{parameter: parameter}) if known else scene).hamiltonian
    eps, zero, found = sympy.Symbol(parameter), sympy.Integer(0), []
    for m in range(order + 1):
        term = rest.xreplace({eps: zero})
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


CONTINUATIONS = (1, 8, 64)
"""The numbers of steps of the continuation, tried in this order. Of 2,000 points near a small denominator, 75 would
reach another solution without continuation, and 45 with at most 8 steps."""


def continued(shift: Equations, origin: np.ndarray) -> np.ndarray:
    """Solve x + g(x) = origin at each row, for the solution that continues the identity; nan where that fails.

    The equations have other solutions far away. The wanted one is followed in x + s·g(x) = origin from s = 0 to 1, with
    Newton steps that at least halve (P. Deuflhard, *Newton Methods for Nonlinear Problems*, section 5.1). If a
    continuation fails, one with more steps is tried; in the end, plain Newton steps.
    """
    x, identity = np.full_like(origin, np.nan), np.eye(origin.shape[1])
    for count, growth in [*((count, 0.5) for count in CONTINUATIONS), (1, np.inf)]:
        rest = np.flatnonzero(np.isnan(x).any(axis=1))
        found = origin[rest]
        for share in np.arange(1, count + 1) / count:

            def equations(
                z: np.ndarray, k: np.ndarray, share: float = share, at: np.ndarray = rest
            ) -> tuple[np.ndarray, np.ndarray]:
                value, matrix = shift(z, at[k])
                return z + share * value - origin[at[k]], identity + share * matrix

            found = newton(equations, found, growth)
        x[rest] = found
    return x


LARGEST_ARRAY = 2**18  # the number of coefficients computed at a time: arrays of two megabytes


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
    """The maps for the generating function of an elimination, at many points.

    S and its derivatives in the actions are Fourier sums. Their coefficients are sums of monomials: numbers times
    powers of ε and of the generators of the ring. Only the formulas of these generators are evaluated.
    """

    def __init__(self, elimination: Elimination):
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
        self._powers = as_function(ring.actions, formulas, "numpy")
        self._orders = np.array([order for order, *_ in monomials])
        self._numbers = np.array([number for _, number, _ in monomials])
        index = {power: at for at, power in enumerate(powers)}
        factors = [[index[power] for power in powers] for *_, powers in monomials]
        first_factor, first_monomial = (np.cumsum([0, *map(len, parts)]) for parts in (factors, columns))
        self._tables = first_factor, np.array(list(chain(*factors)), int), first_monomial
        self._k = np.array(modes, float).reshape(-1, size)
        self.height = max(1, LARGEST_ARRAY // len(first_monomial))
        """The number of points mapped at a time."""

    def images(
        self, is_back: bool, actions: np.ndarray, angles: np.ndarray, eps: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Map rows (a, θ) to (b, φ), or back; nan where the equations cannot be solved."""

        def changes(x: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            """The change of the unknown x, its Jacobian, and the change of the other variables."""
            if is_back:
                along_angles, along_actions, mixed = self._gradients(known, self._waves(x))
                return along_actions, mixed, along_angles
            along_angles, along_actions, mixed = self._gradients(self._coefficients(x, eps), known)
            return along_angles, mixed.transpose(0, 2, 1), along_actions

        with np.errstate(all="ignore"):
            known = self._coefficients(actions, eps) if is_back else self._waves(angles)
            x = continued(lambda x, k: changes(x, known[k])[:2], angles if is_back else actions)
            change = changes(x, known)[2]
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

    def _gradients(self, coefficients: np.ndarray, waves: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The gradients ∇_θ S and ∇_b S and the matrices ∂²S/∂b_i∂θ_j."""
        values = coefficients * waves[:, None]
        along_angles = -np.imag(values) @ self._k
        return along_angles[:, 0], np.real(values[:, 1:]).sum(axis=2), along_angles[:, 1:]
