"""Random starts for the members of an ensemble."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, cast

import numpy as np
import sympy

from bseries_base.errors import shorten
from integrators.core.errors import IntegratorError
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.model.blocks import Block, canonical_blocks
from integrators.scenes.model.formulas import as_float
from integrators.scenes.particles.expansion import filled, written_out
from integrators.scenes.scene import Scene


class NormalStart(NamedTuple):
    """Normally distributed starts, as a function of a NumPy generator."""

    mean: np.ndarray  # (variables,)
    root: np.ndarray  # of the covariance: a matrix with a row for each variable, or the diagonal of one

    def __call__(self, rng: np.random.Generator) -> np.ndarray:
        """Draw a start."""
        deviation = self.root * rng.standard_normal(self.root.shape[-1])
        # Unlike a matrix product, a sum does not depend on the number of threads.
        return self.mean + (deviation if self.root.ndim == 1 else deviation.sum(axis=1))


def perturbed_start(scene: Scene | str, spread: float) -> NormalStart:
    """The start of a scene with a normal number added to each value.

    Args:
        spread: The standard deviation.

    Raises:
        IntegratorError: The scene has no start, or the spread is not a number ≥ 0.

    Example:
        >>> import bseries as bs
        >>> import numpy as np
        >>> draw = bs.runs.perturbed_start(bs.scene("lorenz"), 1e-3)
        >>> print(draw.mean, draw(np.random.default_rng(1)))
        [0. 1. 0.] [3.45584192e-04 1.00082162e+00 3.30437076e-04]
    """
    scene = as_scene(scene)
    deviation = _not_negative(spread, "spread")
    start = scene.y0
    return NormalStart(start, np.full(len(start), deviation))


def thermal_momenta(scene: Scene | str, temperature: float) -> NormalStart:
    """Momenta from the Maxwell–Boltzmann distribution, at the positions of the scene's start.

    Their density is proportional to exp(−H/T), on condition that first integrals linear in the momenta alone, such as
    the total momentum, keep the values of the scene's start. Boltzmann's constant is 1. H is the Hamiltonian without
    effects.

    Args:
        scene: A scene whose Hamiltonian is quadratic in the momenta with a constant, positive matrix.
        temperature: The temperature T, in units of energy.

    Raises:
        IntegratorError: The scene is not of this kind, or the temperature is not a number ≥ 0.

    Example:
        >>> import bseries as bs
        >>> import numpy as np
        >>> atoms = bs.scene("lennard-jones", particles=4, dimension=1)
        >>> y0 = bs.runs.thermal_momenta(atoms, temperature=0.1)(np.random.default_rng(1))
        >>> print(y0[:4], abs(y0[:4].sum()) < 1e-15, (y0[4:] == atoms.y0[4:]).all())
        [ 0.09390815 0.2444433 0.08911821 -0.42746967] True True
    """
    scene = as_scene(scene)
    scale = math.sqrt(_not_negative(temperature, "temperature"))
    mean = scene.y0
    pair = canonical_blocks(scene.blocks)
    hamiltonian = bool(scene.base_summands) and all(summand.target is None for summand in scene.base_summands)
    if pair is None or not hamiltonian or scene.poisson is not None:
        raise IntegratorError(f"scene must have a Hamiltonian in momenta and positions, but {scene.name} has none")
    momenta = pair[0]
    p = slice(momenta.offset, momenta.end)
    places = {sympy.Symbol(name): k for k, name in enumerate(momenta.variables)}
    inverse_masses, drift = _kinetic_energy(scene, momenta, places)
    masses = np.linalg.inv(inverse_masses)
    free_mean, free_root = -masses @ drift, scale * np.linalg.cholesky(masses)
    # The normal distribution with covariance T M under the condition C p = c: subtract M Cᵀ (C M Cᵀ)⁻¹ (C p − c).
    conditions = _linear_integrals(scene, places)
    correction = masses @ conditions.T @ np.linalg.pinv(conditions @ masses @ conditions.T)
    root = np.zeros((len(mean), momenta.dimension))
    root[p] = free_root - correction @ (conditions @ free_root)
    mean[p] = free_mean - correction @ (conditions @ (free_mean - mean[p]))
    return NormalStart(mean, root)


def _not_negative(value: Any, argument: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not 0 <= number < math.inf:
        raise IntegratorError(f"{argument} must be a number from 0 on, but was {shorten(repr(value))}")
    return number


def _kinetic_energy(scene: Scene, momenta: Block, places: Mapping[sympy.Symbol, int]) -> tuple[np.ndarray, np.ndarray]:
    """The matrix A and the vector b of H = ½ pᵀA p + bᵀp + …, where b may depend on q, taken at the start.

    Only the summands with momenta are expanded.
    """
    names = {*momenta.variables, *(f"{component}_" for component in momenta.components)}
    kinetic = [
        formula
        for summand in scene.base_summands
        if any(s.name in names or s.name[:-1] in names for s in _symbols(summand.formula))
        for _, formula in written_out(summand, scene)
    ]
    at_rest: dict[sympy.Basic, sympy.Expr] = dict.fromkeys(places, sympy.Integer(0))
    at_rest |= {x: value for x, value in zip(scene.symbols, scene.start or (), strict=True) if x not in places}
    matrix, drift = np.zeros((len(places), len(places))), np.zeros(len(places))
    for formula in kinetic:
        for x in _symbols(formula) & places.keys():
            derivative = formula.diff(x)
            drift[places[x]] += _number(derivative.xreplace(at_rest), scene)
            for z in _symbols(derivative) & places.keys():
                matrix[places[x], places[z]] += _number(derivative.diff(z).simplify(), scene)
    if not (np.linalg.eigvalsh(matrix) > 0).all():
        raise IntegratorError(f"scene must have a kinetic energy that is positive, but that of {scene.name} is not")
    return matrix, drift


def _linear_integrals(scene: Scene, places: Mapping[sympy.Symbol, int]) -> np.ndarray:
    """The coefficients of first integrals linear in the momenta alone, a row for each."""
    rows = []
    for declared in scene.invariants.values():
        formula = filled(declared, scene)
        gradient = {x: formula.diff(x) for x in _symbols(formula)} if _symbols(formula) <= places.keys() else {}
        if gradient and not any(map(_symbols, gradient.values())):
            row = np.zeros(len(places))
            for x, derivative in gradient.items():
                row[places[x]] = as_float(derivative)
            rows.append(row)
    return np.array(rows).reshape(len(rows), len(places))


def _symbols(formula: sympy.Expr) -> set[sympy.Symbol]:
    return cast("set[sympy.Symbol]", formula.free_symbols)


def _number(value: Any, scene: Scene) -> float:
    if value.free_symbols:
        raise IntegratorError(
            f"scene must have a kinetic energy that is quadratic in the momenta with constant coefficients, "
            f"but {scene.name} has {shorten(str(value))}"
        )
    return as_float(value)
