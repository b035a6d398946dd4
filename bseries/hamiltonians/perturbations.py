"""The non-Hamiltonian part r of a modified field, y' = B(y) ∇H̃(y) + r(y), and the rate at which it changes H̃.

The one-form B^(−1) r may be not closed at some power of h, or closed but not exact where variables are angles.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cached_property, partial, reduce
from typing import TYPE_CHECKING, NamedTuple

import mpmath
import sympy

from bseries.algebra.bseries import BSeries
from bseries.exceptions import SeriesError
from bseries.fields.differential_rings import DifferentialRing
from bseries.fields.inputs import Formula
from bseries.fields.modified_fields import SceneSeries, modified_field
from bseries.fields.modified_invariants import antiderivative, covector, inverse_structure
from bseries.fields.polynomials import Element
from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian, modified_hamiltonian
from bseries.hamiltonians.orbits import DIGITS, WORKING_DIGITS, mean_of_samples
from bseries.hamiltonians.verdicts import hamiltonian_order
from integrators.exact.functions import as_function
from integrators.methods.programs.program import Method
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.model.blocks import canonical_blocks
from integrators.scenes.particles.parts import Parts
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import numpy as np

MOST_VARIABLES = 6  # largest number of variables for which there are formulas


class Perturbation:
    """The part r of a modified field f_h = B ∇H̃ + r, and the rate ∇H̃ · r at which H̃ changes.

    If a method is a known perturbation of a symplectic one, its `twin`, like the simplified Takahashi–Imada method, r
    is the difference of the two modified fields. For others it is f_h itself, whose Hamiltonian part contributes only
    total derivatives to the rate, which have no mean. The rate is given as ∇H · r: for means along solutions of y' =
    f(y) the omitted part is smaller by a factor h^p, p being the order of the method.

    References:
        E. Hairer, lecture on long-time behaviour, equations (17) and (18).
    """

    def __init__(self, method: Method | BSeries, scene: Scene, order: int | None = None, *, parts: Parts | None = None):
        self.field = self.series = modified_field(method, scene, order, parts=parts)
        if scene.hamiltonian is None:
            raise SeriesError(f"scene must have a Hamiltonian, but {scene.name} has none")
        self.scene, self._energy, self._method, self._parts = scene, scene.hamiltonian, method, parts
        twin = getattr(method, "symplectic_form", None)
        self.twin: Method | None = None if twin is method else twin
        if self.twin is not None:
            difference = self.field.series - modified_field(self.twin, scene, order, parts=parts).series
            label = f"{self.field.label} less that of {self.twin.name}"
            self.series = SceneSeries(scene, self.field.trees, difference.with_label(label))

    def __reduce__(self) -> tuple[partial[Perturbation], tuple[Method | BSeries, Scene, int]]:
        return partial(Perturbation, parts=self._parts), (self._method, self.scene, self.field.order)

    @property
    def has_formulas(self) -> bool:
        """Whether there are formulas: few variables, and no decimals."""
        series = self.field.series
        return self.scene.dimension <= MOST_VARIABLES and series.is_exact and series.digits is None

    def has_terms(self, k: int) -> bool:
        """Whether r has trees at h^k."""
        series = self.series.series
        return not all(series.is_zero(series.table[at]) for at in series.table.ids(k + 1))

    def terms(self, k: int) -> tuple[sympy.Expr, ...]:
        """The formulas of r at h^k."""
        return self.series.symbolic(k)

    def rate(self, k: int) -> sympy.Expr:
        """The formula of ∇H · r at h^k."""
        energy = self._energy
        ring, elements = self.ring, self.series.formulas.elements(k + 1)
        H = ring.element(energy)
        return ring.to_expression(ring.dot((ring.derivative(H, i), x) for i, x in enumerate(elements)))

    def rates(self, y: np.ndarray, k: int) -> np.ndarray:
        """∇H · r at h^k at many points (variables, n) of a canonical scene, compiled."""
        pair = canonical_blocks(self.scene.blocks)
        if self.scene.poisson is not None or pair is None:
            raise SeriesError(f"scene must be canonical, but {self.scene.name} is not")
        p, q = (slice(block.offset, block.end) for block in pair)
        f, r = self._first(y, 0.0), self.series.terms(y)[k]
        return (f[q] * r[p] - f[p] * r[q]).sum(axis=0)

    def hamiltonian(self, power: int | None) -> ModifiedHamiltonian:
        """H̃: that of the twin to the order of f_h, or the terms of f_h below a power of h (None: all)."""
        method = self._method if self.twin is None else self.twin
        order = self.field.order if power is None or self.twin is not None else power
        return modified_hamiltonian(method, self.scene, order, parts=self._parts)

    def form(self, k: int) -> list[Element]:
        """The one-form B^(−1) r at h^k, the differential of K if r = B ∇K."""
        return covector(self.series, self._inverse, k)

    @property
    def ring(self) -> DifferentialRing:
        """The ring of the formulas."""
        return self.series.formulas.ring

    @cached_property
    def _inverse(self) -> list[list[Element]]:
        return inverse_structure(self.series)

    @cached_property
    def _first(self) -> SceneSeries:
        """f, compiled."""
        return modified_field(self._method, self.scene, 1, parts=self._parts)


class PeriodGain(NamedTuple):
    """The energy gained in a forward period of an angle, to leading order; a backward period loses as much."""

    variable: str
    period: sympy.Expr
    gain: sympy.Expr  # the coefficient of the power of h
    digits: int | None  # the accuracy; None if exact


class Violation(NamedTuple):
    """A power of h at which a field is not Hamiltonian."""

    power: int
    order: int  # the first power at which it is not even locally Hamiltonian; that of the first term left out if it is
    turns: tuple[PeriodGain, ...]  # the nonzero gains per period of angles, if the field is locally Hamiltonian

    @property
    def is_closed(self) -> bool:
        """Whether the field is locally Hamiltonian at this power of h."""
        return self.power < self.order


def violations(r: Perturbation, least: int) -> Iterator[Violation]:
    """Powers of h from `least` on at which a modified field is not Hamiltonian, up to the first not even locally.

    In a space of states with angles a closed form is the differential of a function only if its integral over each
    period vanishes. This integral does not depend on the path. It is the difference of two values of the local modified
    Hamiltonian, which is constant along solutions, at the same state; the energy changes by minus the integral in every
    period. Periods are examined if there are formulas.
    """
    order = hamiltonian_order(r.field)
    angles = angle_periods(r.scene) if r.has_formulas else {}
    for k in range(least, order):
        gains = tuple(gain for gain in (_period_gain(r, k, i, period) for i, period in angles.items()) if gain.gain)
        if gains:
            yield Violation(k, order, gains)
    if order < r.field.order:
        yield Violation(order, order, ())


def angle_periods(scene: Scene) -> dict[int, sympy.Expr]:
    """The variables, by index, in which the Hamiltonian of a scene is periodic, and their periods."""
    formulas = [scene.hamiltonian, *(entry for row in scene.poisson or () for entry in row)]
    periods = {i: common_period(formulas, x) for i, x in enumerate(scene.symbols)}
    return {i: period for i, period in periods.items() if period is not None}


def common_period(formulas: Iterable[sympy.Expr], x: sympy.Symbol) -> sympy.Expr | None:
    """A common period of formulas in x, as they are written; None if there is none or no formula contains x.

    It is positive if it is a number. For symbols no absolute value is taken, so that multiples of 2π remain
    recognisable.

    Example:
        >>> import sympy
        >>> x, y = sympy.symbols("x y")
        >>> common_period([y * sympy.sin(2 * x / 3), sympy.cos(x / 2 + y)], x), common_period([x + sympy.sin(x)], x)
        (12*pi, None)
    """
    formulas = list(formulas)
    waves = {wave for formula in formulas for wave in formula.atoms(sympy.sin, sympy.cos) if wave.has(x)}
    slopes = {wave: sympy.diff(wave.args[0], x) for wave in waves}
    linear = {wave: sympy.Dummy() for wave, slope in slopes.items() if not slope.has(x)}
    if not linear or any(formula.xreplace(linear).has(x) for formula in formulas):
        return None
    unit = min((slopes[wave] for wave in linear), key=sympy.default_sort_key)
    multiples: list[Formula] = [sympy.simplify(slopes[wave] / unit) for wave in linear]
    if not all(multiple.is_Rational for multiple in multiples):
        return None
    period = 2 * sympy.pi / (reduce(lambda a, b: a.gcd(b), multiples) * unit)
    return abs(period) if period.is_number else -period if period.could_extract_minus_sign() else period


def rise(function: sympy.Expr, x: sympy.Symbol, period: sympy.Expr) -> sympy.Expr:
    """F(period) − F(0), where all sines and cosines in F have this period in x; simplified to 0 if possible."""
    held: Formula = function.xreplace({wave: wave.subs(x, 0) for wave in function.atoms(sympy.sin, sympy.cos)})
    found: Formula = sympy.factor(held.subs(x, period) - held.subs(x, 0))
    return sympy.Integer(0) if found.equals(0) else found


def _period_gain(r: Perturbation, k: int, i: int, period: sympy.Expr) -> PeriodGain:
    """The gain −∫ω_i dy_i over a period, by an antiderivative if possible, else by quadrature."""
    scene, x, name = r.scene, r.scene.symbols[i], r.scene.variables[i]
    formula = r.ring.to_expression(r.form(k)[i], simplify=False)
    found = antiderivative(formula, x)
    if found is not None:
        gain = -rise(found, x, period)
        if not gain.free_symbols & set(scene.symbols):
            return PeriodGain(name, period, gain, None)
    if formula.free_symbols - set(scene.symbols):
        raise SeriesError(f"scene and method must have numbers for parameters, as no rule integrates {formula!s:.60}")
    start = scene.start or (sympy.Integer(0),) * scene.dimension
    others = {symbol: value for symbol, value in zip(scene.symbols, start, strict=True) if symbol != x}
    function = as_function([x], formula.xreplace(others), "mpmath")
    length = mpmath.mpf(sympy.N(period, WORKING_DIGITS))
    mean = mean_of_samples(lambda n: [mpmath.mpf(function(length * j / n)) for j in range(n)])
    return PeriodGain(name, period, sympy.Float(-length * mean, DIGITS) if mean else sympy.Integer(0), DIGITS)


def takahashi_imada_integral(scene: Scene | str) -> sympy.Expr:
    """∫ U‴ U′² dq over a period of the potential U of a scene H = T(p) + U(q) with one degree of freedom.

    With f = −U′ the simplified method's force differs from the symplectic one's by h⁴α²/2 f″(f, f) = −h⁴α²/2 U‴U′². In
    every forward period the modified Hamiltonian of the symplectic method, and the energy, therefore gain −h⁴α²/2 times
    this integral to leading order. If it is not zero, the energy drifts on rotating orbits.

    Args:
        scene: The scene; parameters may be symbols (for a period 2π/k with k taken as positive).

    Raises:
        SeriesError: The scene is not of this kind, or the formula cannot be integrated.

    Example:
        >>> import bseries as bs
        >>> bs.hamiltonians.takahashi_imada_integral(bs.scene("pendulum", effects=["asymmetry"]))
        6*pi/5
        >>> bs.hamiltonians.takahashi_imada_integral(bs.scene("pendulum", effects=["asymmetry"], epsilon="epsilon"))
        6*pi*epsilon
        >>> bs.hamiltonians.takahashi_imada_integral(bs.scene("pendulum"))
        0

    References:
        E. Hairer, R. I. McLachlan, R. D. Skeel, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019.
    """
    scene = as_scene(scene)
    energy = scene.hamiltonian
    if energy is None or scene.poisson is not None or scene.dimension != 2:
        raise SeriesError(f"scene must be canonical with one degree of freedom, but {scene.name} is not")
    p, q = scene.symbols
    potential = energy.subs(p, 0)
    if (energy - potential).expand().has(q):
        raise SeriesError(f"scene must have a Hamiltonian T(p) + U(q), but {scene.name} has {energy!s:.60}")
    period = common_period([potential], q)
    if period is None:
        raise SeriesError(
            f"scene must have a potential that is periodic in {q}, but {scene.name} has {potential!s:.60}"
        )
    found = antiderivative((potential.diff(q, 3) * potential.diff(q) ** 2).expand(), q)
    if found is None:
        raise SeriesError(f"scene must have a potential simple enough to integrate, but {scene.name} has not")
    return rise(found, q, period)
