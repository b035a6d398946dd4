"""Whether a method lets energies, and what else stays the same along an orbit, drift.

They do not if its modified equation is Hamiltonian as the scene is, by a function that is the same after each turn of
an angle; or if both are reversible by a reflection ρ, f(ρ y) = −ρ f(y), that maps the orbit's torus to itself, since
reversible perturbations of integrable systems let actions oscillate only, where frequencies are not resonant. A
reflection that maps it to another one, as p ↦ −p does to a pendulum that turns round and round, proves nothing: so the
simplified Takahashi–Imada method lets energies drift.

References:
    HLW, theorems IX.8.1 and XI.3.1; E. Hairer, R. I. McLachlan, R. D. Skeel, On energy conservation of the simplified
    Takahashi–Imada method, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Any

from bseries.advice.growth import goes_on
from bseries.advice.modified_terms import ModifiedTerms, numeric_inverse_structure
from bseries.fields.modified_fields import modified_field

if TYPE_CHECKING:
    import numpy as np

    from integrators import Scene


@lru_cache(maxsize=16)
def gradient(scene: Scene) -> Any:
    """A function that gives ∇H at many points (variables, n); None if the energy is not conserved.

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
"""In scenes with so many variables each is reflected by itself, at 0 or, as sines need it, at π/2; else blocks are."""
POINTS, EQUAL = 8, 1e-9
"""At how many states fields are compared with their reflections, and how well they agree if they are reversible."""
NEAR = 0.15
"""How near to an orbit, in parts of the range of each variable, its own reflection comes; others are half of it off."""
BESIDE = 0.01
"""How far beside an orbit, in parts of its size."""
TURN = 64
"""Points for a mean over an angle."""


def may_drift(terms: ModifiedTerms, y: np.ndarray) -> bool:
    """Whether what is conserved drifts, as far as the first terms of the modified equation tell.

    Args:
        terms: The terms.
        y: States (variables, n) along the orbit, often enough to show where it is.

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

    some = _some(y)
    with np.errstate(all="ignore"):  # what is not finite is not equal to anything
        there = _values(terms, some)
        turns = _turns(terms, y, some, there)
        is_hamiltonian = terms.is_hamiltonian(y, terms.powers) and not _gains(terms, some[:, 0], turns)
        return not (is_hamiltonian or _is_reversible(terms, y, some, there, turns))


def energy_rate_beside(terms: ModifiedTerms, y: np.ndarray, h: float) -> float:
    """How fast the terms change the energy beside an orbit: on a circle, where they do not, that may be by symmetry.

    Args:
        terms: The terms.
        y: States (variables, n) along the orbit.
        h: The step size.

    Returns:
        The largest rate at some states; 0 if the terms conserve the energy, or there is none.
    """
    import numpy as np

    slopes = gradient(terms.field.scene)
    if slopes is None:
        return 0.0
    some = _some(y)
    aside = some + BESIDE * abs(y).max() * np.random.default_rng(1).uniform(-1, 1, some.shape)
    with np.errstate(all="ignore"):
        products = slopes(aside) * terms.values(aside) * np.float64(h) ** np.array(terms.powers)[:, None, None]
        rates = products.sum(axis=1)
        rates[abs(rates) <= EQUAL * abs(products).sum(axis=1)] = 0.0
    return float(np.nan_to_num(abs(rates)).max())


def _gains(terms: ModifiedTerms, y: np.ndarray, turns: np.ndarray) -> bool:
    """Whether the functions whose derivatives give the terms are other ones after a whole turn of an angle.

    B^(−1) f_{k+1} is closed then, but the differential of no function: its mean over the angle is not zero, at whatever
    values of the other variables.
    """
    import numpy as np

    inverse = numeric_inverse_structure(terms.field.scene)
    for k in np.flatnonzero(turns):
        around = np.repeat(y[:, None], TURN, axis=1)
        around[k] += np.linspace(0, 2 * math.pi, TURN, endpoint=False)
        forms = np.einsum("nj,kjn->kn", [inverse(x)[k] for x in around.T], terms.values(around)) if inverse else None
        if forms is not None and (abs(forms.mean(axis=1)) > EQUAL * abs(forms).max(axis=1)).any():
            return True
    return False


def _is_reversible(terms: ModifiedTerms, y: np.ndarray, some: np.ndarray, there: np.ndarray, turns: np.ndarray) -> bool:
    """Whether scene and terms are reversible by a reflection of the orbit to itself.

    Only even powers of h belong to fields that are reversible whenever f is: methods must be symmetric.

    Args:
        terms: The terms.
        y: The orbit.
        some: Some states of it.
        there: f and the terms at these.
        turns: Which variables are angles that turn.
    """
    if any(k % 2 for k in terms.powers):
        return False
    for sign, shift in zip(*_reflections(terms.field.scene), strict=True):
        reflected = sign[:, None] * some + shift[:, None]
        back = _values(terms, reflected)
        if (abs(back + sign[:, None] * there) <= EQUAL * _sizes(there)).all() and _are_near(reflected, y, turns):
            return True
    return False


def _some(y: np.ndarray) -> np.ndarray:
    """Some states of an orbit."""
    import numpy as np

    return y[:, np.linspace(0, y.shape[1] - 1, POINTS).astype(int)]


def _values(terms: ModifiedTerms, y: np.ndarray) -> np.ndarray:
    """f and the terms: an array (powers, variables, n)."""
    return terms.field.terms(y)[[0, *terms.powers]]


def _reflections(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Signs and shifts of the reflections y ↦ sign · y + shift that are tried, (reflections, variables) each."""
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


def _are_near(states: np.ndarray, y: np.ndarray, turns: np.ndarray) -> bool:
    """Whether states lie near to an orbit, angles up to whole turns."""
    import numpy as np

    ranges = np.where(turns, 2 * math.pi, np.ptp(y, axis=1))
    moves = ranges > 0
    for state in states.T:
        apart = y - state[:, None]
        apart[turns] -= 2 * math.pi * np.rint(apart[turns] / (2 * math.pi))
        if not np.linalg.norm(apart[moves] / ranges[moves, None], axis=0).min() < NEAR:
            return False
    return True


def _turns(terms: ModifiedTerms, y: np.ndarray, some: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Which variables are angles that turn round and round: they go on, and after a whole turn fields are the same."""
    import numpy as np

    found = np.array([goes_on(row) for row in y])
    for k in np.flatnonzero(found):
        shifted = some.copy()
        shifted[k] += 2 * math.pi
        found[k] = (abs(_values(terms, shifted) - there) <= EQUAL * _sizes(there)).all()
    return found


def _sizes(values: np.ndarray) -> np.ndarray:
    """The largest entries of f and of each term."""
    return abs(values).max(axis=(1, 2))[:, None, None]
