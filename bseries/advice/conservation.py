"""Whether a method lets the energy and other conserved quantities of an orbit drift.

They do not drift if the modified equation is Hamiltonian like the scene, with a Hamiltonian that is periodic in the
angles; or if both equations are reversible by a reflection ρ, f(ρ y) = −ρ f(y), that maps the orbit's torus to itself,
since reversible perturbations of integrable systems let actions only oscillate away from resonances. A reflection that
maps the torus to another one, as p ↦ −p does for a rotating pendulum, proves nothing: so the simplified
Takahashi–Imada method lets energies drift.

References:
    HLW, theorems IX.8.1 and XI.3.1; E. Hairer, R. I. McLachlan, R. D. Skeel, On energy conservation of the simplified
    Takahashi–Imada method, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

from bseries.advice.growth import is_unbounded
from bseries.advice.modified_terms import ModifiedTerms, numeric_inverse_structure
from bseries.fields.modified_fields import modified_field

if TYPE_CHECKING:
    import numpy as np

    from integrators import Scene


@lru_cache(maxsize=16)
def gradient(scene: Scene) -> Any:
    """∇H as a function of many points (variables, n); None if the energy is not conserved.

    Example:
        >>> import bseries as bs, numpy as np
        >>> gradient(bs.scene("pendulum"))(np.array([[1.0], [0.0]])).ravel().tolist()
        [1.0, 0.0]
    """
    import numpy as np

    if not scene.is_hamiltonian:
        return None
    from integrators import method

    inverse = numeric_inverse_structure(scene) if scene.canonical_pair is not None else None
    if inverse is not None:
        field, matrix = modified_field(method("explicit-euler"), scene, 1), inverse(np.zeros(scene.dimension))
        return lambda y: matrix @ field.terms(y)[0]
    import sympy

    formula: Any = scene.hamiltonian
    values: Any = list(scene.parameter_values.items())
    gradients = [sympy.diff(formula.subs(values), x) for x in scene.symbols]
    function = sympy.lambdify([scene.symbols], gradients, "numpy", cse=True)
    return lambda y: np.array([np.broadcast_to(row, y.shape[1:]) for row in function(y)])


SMALL = 4
"""Scenes with at most this many variables: each is reflected by itself, at 0 or (for sines) π/2; else blocks are."""
POINTS, EQUAL = 8, 1e-9
"""Number of states at which fields are compared with their reflections, and the tolerance."""
NEAR = 0.15
"""Largest relative distance of a reflected orbit from the orbit itself; other orbits are about 0.5 away."""
BESIDE = 0.01
"""Relative distance of states near an orbit."""
PERIOD = 64
"""Points for a mean over an angle."""


def may_drift(terms: ModifiedTerms, y: np.ndarray) -> bool:
    """Whether conserved quantities may drift, by the first terms of the modified equation.

    Example:
        >>> import bseries as bs
        >>> from bseries.advice.modified_terms import modified_terms
        >>> pendulum = bs.scene("pendulum")
        >>> y = bs.integrate(pendulum, "gauss4", h=0.1, steps=200).y
        >>> names = "rk4", "gauss2", "lobatto-iiia3"
        >>> {name: may_drift(modified_terms(bs.method(name), pendulum), y) for name in names}
        {'rk4': True, 'gauss2': False, 'lobatto-iiia3': False}
    """
    import numpy as np

    sample = _sample(y)
    with np.errstate(all="ignore"):  # comparisons with nan are false
        fields = _values(terms, sample)
        rotating = _rotating_angles(terms, y, sample, fields)
        is_hamiltonian = terms.is_hamiltonian(y, terms.powers) and not _gains(terms, sample[:, 0], rotating)
        return not (is_hamiltonian or _is_reversible(terms, y, sample, fields, rotating))


def energy_rate_nearby(terms: ModifiedTerms, y: np.ndarray, h: float) -> float:
    """The rate of energy change near an orbit; on special orbits such as circles it may vanish by symmetry.

    Returns:
        The largest rate at some states; 0 if the terms conserve the energy or the scene has none.
    """
    import numpy as np

    slopes = gradient(terms.field.scene)
    if slopes is None:
        return 0.0
    sample = _sample(y)
    aside = sample + BESIDE * abs(y).max() * np.random.default_rng(1).uniform(-1, 1, sample.shape)
    with np.errstate(all="ignore"):
        products = slopes(aside) * terms.values(aside) * np.float64(h) ** np.array(terms.powers)[:, None, None]
        rates = products.sum(axis=1)
        rates[abs(rates) <= EQUAL * abs(products).sum(axis=1)] = 0.0
    return float(np.nan_to_num(abs(rates)).max())


def _gains(terms: ModifiedTerms, y: np.ndarray, rotating: np.ndarray) -> bool:
    """Whether a term has a nonzero mean over an angle, so that B^(−1) f_{k+1} is closed but not a differential."""
    import numpy as np

    inverse = numeric_inverse_structure(terms.field.scene)
    for k in np.flatnonzero(rotating):
        around = np.repeat(y[:, None], PERIOD, axis=1)
        around[k] += np.linspace(0, 2 * math.pi, PERIOD, endpoint=False)
        forms = np.einsum("nj,kjn->kn", [inverse(x)[k] for x in around.T], terms.values(around)) if inverse else None
        if forms is not None and (abs(forms.mean(axis=1)) > EQUAL * abs(forms).max(axis=1)).any():
            return True
    return False


def _is_reversible(
    terms: ModifiedTerms, y: np.ndarray, sample: np.ndarray, fields: np.ndarray, rotating: np.ndarray
) -> bool:
    """Whether scene and terms are reversible by a reflection that maps the orbit to itself."""
    if any(k % 2 for k in terms.powers):
        return False
    for sign, shift in zip(*_reflections(terms.field.scene), strict=True):
        reflected = sign[:, None] * sample + shift[:, None]
        back = _values(terms, reflected)
        if (abs(back + sign[:, None] * fields) <= EQUAL * _sizes(fields)).all() and _are_near(reflected, y, rotating):
            return True
    return False


def _sample(y: np.ndarray) -> np.ndarray:
    """States at equidistant times along an orbit."""
    import numpy as np

    return y[:, np.linspace(0, y.shape[1] - 1, POINTS).astype(int)]


def _values(terms: ModifiedTerms, y: np.ndarray) -> np.ndarray:
    """f and the terms, (powers, variables, n)."""
    return terms.field.terms(y)[[0, *terms.powers]]


def _reflections(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Signs and shifts of the reflections y ↦ sign · y + shift to try, (reflections, variables) each."""
    import numpy as np

    if scene.dimension <= SMALL:
        choices = list(product(((-1, 0.0), (-1, math.pi), (1, 0.0)), repeat=scene.dimension))
    else:
        sizes = [block.end - block.offset for block in scene.blocks]
        choices = [
            [(sign, 0.0) for sign, size in zip(signs, sizes, strict=True) for _ in range(size)]
            for signs in product((-1, 1), repeat=len(sizes))
        ]
    pairs = np.array(choices, dtype=float)
    return pairs[:, :, 0], pairs[:, :, 1]


def _are_near(states: np.ndarray, y: np.ndarray, rotating: np.ndarray) -> bool:
    """Whether states are near an orbit, angles modulo 2π."""
    import numpy as np

    ranges = np.where(rotating, 2 * math.pi, np.ptp(y, axis=1))
    moves = ranges > 0
    for state in states.T:
        apart = y - state[:, None]
        apart[rotating] -= 2 * math.pi * np.rint(apart[rotating] / (2 * math.pi))
        if not np.linalg.norm(apart[moves] / ranges[moves, None], axis=0).min() < NEAR:
            return False
    return True


def _rotating_angles(terms: ModifiedTerms, y: np.ndarray, sample: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """Which variables are rotating angles: unbounded, with fields that have the period 2π."""
    import numpy as np

    found = np.array([is_unbounded(row) for row in y])
    for k in np.flatnonzero(found):
        shifted = sample.copy()
        shifted[k] += 2 * math.pi
        found[k] = (abs(_values(terms, shifted) - fields) <= EQUAL * _sizes(fields)).all()
    return found


def _sizes(values: np.ndarray) -> np.ndarray:
    """The largest entries of f and of each term."""
    return abs(values).max(axis=(1, 2))[:, None, None]
