"""Steps of linear multistep methods: the same nodes as for one-step methods, and vectors that are kept from the past.

As ρ(1) = 0, ρ(ζ) = (ζ − 1) Σ γ_i ζ^i, and a step adds h Σ x_e k_e to the newest y, as a Runge–Kutta step does, where
the k_e are differences (y_{n+i+1} − y_{n+i})/h and slopes f(y_{n+j}):

    γ_{k−1} (y_{n+k} − y_{n+k−1}) = −Σ_{i<k−1} γ_i (y_{n+i+1} − y_{n+i}) + h Σ_j β_j f(y_{n+j}).

So sums are compensated, and implicit steps are solved, as for other methods.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from fractions import Fraction
from itertools import accumulate
from typing import Any

import numpy as np

from bseries_base.errors import shown
from integrators.core.arguments import read_array
from integrators.core.errors import IntegratorError
from integrators.methods.kinds.memory import LinearMultistep
from integrators.steppers.step_model import Form, Key, Node, Past, Point, fraction
from integrators.steppers.structure import Structure


class MultistepNodes:
    """The evaluation of a step of a multistep method on a scene, its end, and what it keeps of the past.

    Evaluations have numbers: i < k − 1 for the differences, k − 1 + j for the slope at y_{n+j}, 2k for the newest
    difference while the others move.
    """

    def __init__(self, method: LinearMultistep, structure: Structure):
        if method.parameters:
            raise IntegratorError(f"parameters must have values before a step, but {method.parameters[0]} had none")
        k, piece = method.steps, len(structure.pieces) - 1
        differences, slopes = _terms(method)
        terms = (
            *((i, x) for i, x in enumerate(differences) if x),
            *((k - 1 + j, x) for j, x in enumerate(slopes) if x),
        )
        moved = structure.writes(piece)
        end = {b: Form.of(Fraction(1), dict(terms) if b in moved else {}) for b in range(len(structure.blocks))}
        newest = k - 1 if method.is_explicit else k  # of the slopes
        at = {b: Form.of(Fraction(1), {}) for b in end} if method.is_explicit else end

        def point(blocks: Iterable[int]) -> Point:
            return tuple((block, at[block]) for block in sorted(blocks))

        self.structure, self.result = structure, end
        self.nodes: dict[Key, Node] = {
            (k - 1 + newest, b): Node("field", piece, (point(structure.dependence(piece, b).blocks),))
            for b in sorted(moved)
        }
        one = Fraction(1)
        past: list[Any] = []
        if any(differences):
            past = [(2 * k, terms), *((i, ((i + 1, one),)) for i in range(k - 2)), (k - 2, ((2 * k, one),))]
        first = _first_slope(method)
        self.past: Past = (*past, *((k - 1 + j, ((k + j, one),)) for j in range(first, newest)))

    def abscissa(self, e: int) -> Fraction:
        """The abscissa of the implicit evaluation: the end of the step."""
        return Fraction(1)


def _terms(method: LinearMultistep) -> tuple[list[Fraction], list[Fraction]]:
    """The coefficients of differences, i < k − 1, and of slopes, j ≤ k."""
    *others, last = [-x for x in accumulate(map(fraction, method.alpha[:-1]))]  # γ_0 … γ_{k−1}
    return [-x / last for x in others], [fraction(x) / last for x in method.beta]


def _first_slope(method: LinearMultistep) -> int:
    """The oldest slope that a step needs."""
    return next(j for j, x in enumerate(method.beta) if x != 0)


def read_starting_values(method: LinearMultistep, y0: object, dimension: int, argument: str = "y0") -> np.ndarray:
    """The k starting values of a method, (k, variables), oldest first."""
    values, wanted = read_array(y0), (method.steps, dimension)
    if values.shape != wanted or not np.isfinite(values).all():
        raise IntegratorError(
            f"{argument} must be the {method.steps} starting values of {method.name}, finite and in the shape "
            f"{wanted}, but was {shown(y0)}"
        )
    return np.ascontiguousarray(values)


def past_vectors(
    method: LinearMultistep, states: np.ndarray, h: float, field: Callable[[np.ndarray, np.ndarray], object]
) -> list[np.ndarray]:
    """What a step keeps of the past after these states, in the order of `MultistepNodes.past`."""
    vectors: list[np.ndarray] = []
    if any(_terms(method)[0]):
        vectors = [np.zeros(states.shape[1]), *np.diff(states, axis=0) / h]
    newest = method.steps - 1 if method.is_explicit else method.steps
    for state in states[_first_slope(method) : newest]:
        slope = np.empty(states.shape[1])
        field(np.ascontiguousarray(state), slope)
        vectors.append(slope)
    return vectors
