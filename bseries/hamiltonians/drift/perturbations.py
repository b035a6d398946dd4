"""The non-Hamiltonian part r of a modified field, y' = B(y) ∇H̃(y) + r(y), and the rate at which it changes H̃."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

from bseries.algebra.bseries import BSeries
from bseries.exceptions import SeriesError
from bseries.fields.elementary_differentials import refusing_large
from bseries.fields.modified_fields import SceneSeries, modified_field
from bseries.fields.modified_invariants import covector, inverse_structure
from bseries.fields.symbolic.differential_rings import MOST_MONOMIALS, DifferentialRing
from bseries.fields.symbolic.polynomials import Element
from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian, modified_hamiltonian
from integrators.methods.programs.program import Method
from integrators.scenes.model.blocks import canonical_blocks
from integrators.scenes.scene import Scene

if TYPE_CHECKING:
    import numpy as np
    import sympy


MOST_VARIABLES = 6
"""Largest number of variables for which there are formulas."""


class Perturbation:
    """The part r of a modified field f_h = B ∇H̃ + r, and the rate ∇H̃ · r at which H̃ changes.

    If a method is a known perturbation of a symplectic one, like the simplified Takahashi–Imada method, r is the
    difference of the two modified fields. For others it is f_h itself, whose Hamiltonian part contributes only total
    derivatives to the rate, which have no mean. The rate is given as ∇H · r: for means along solutions of y' = f(y) the
    omitted part is smaller by a factor h^p, p being the order of the method.

    The arguments are those of `modified_field`. `twin` is the symplectic method that r is relative to, if there is one,
    `field` is f_h, and `series` is r.

    Example:
        >>> import bseries as bs
        >>> r = Perturbation(bs.method("simplified-takahashi-imada", alpha="alpha"), bs.scene("pendulum"), 5)
        >>> r.twin.name, r.terms(4), r.rate(4)
        ('takahashi-imada', (alpha**2*sin(q)**3/2, 0), alpha**2*p*sin(q)**3/2)

    References:
        E. Hairer, lecture on long-time behaviour, equations (17) and (18).
    """

    def __init__(self, method: Method | BSeries, scene: Scene, order: int | None = None, *, parts: Any = None):
        self.field = self.series = modified_field(method, scene, order, parts=parts)
        if scene.hamiltonian is None:
            raise SeriesError(f"scene must have a Hamiltonian, but {scene.name} has none")
        self.scene, self._method, self._parts = scene, method, parts
        twin: Any = getattr(method, "symplectic_form", method)
        self.twin: Method | None = None if twin is method else twin
        if self.twin is not None:
            difference = self.field.series - self._modified(self.twin, order).series
            label = f"{self.field.label} less that of {self.twin.name}"
            self.series = SceneSeries(scene, self.field.trees, difference.with_label(label))

    def _modified(self, method: Method | BSeries, order: int | None) -> SceneSeries:
        return modified_field(method, self.scene, order, parts=self._parts)

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
        with refusing_large(MOST_MONOMIALS):
            products = zip(self._gradient, self.series.formulas.elements(k + 1), strict=True)
            return self.ring.to_expression(self.ring.dot(products))

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
    def _gradient(self) -> list[Element]:
        """∇H."""
        formula: Any = self.scene.hamiltonian
        energy = self.ring.element(formula)
        return [self.ring.derivative(energy, i) for i in range(self.scene.dimension)]

    @cached_property
    def _first(self) -> SceneSeries:
        """f, compiled."""
        return self._modified(self._method, 1)
