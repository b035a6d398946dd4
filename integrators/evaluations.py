"""What a step may ask of the field: the four kinds of evaluation that programs are made of."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from .entries import Entry
    from .linear_forms import LinearForm


class Field(NamedTuple):
    """k = h f^[part](at); `part` None means the sum of all parts."""

    part: int | None
    at: LinearForm


class Derivative(NamedTuple):
    """k = h (f^[part])′(at) · along. With k itself in `along` it is a linear system, as in Rosenbrock methods."""

    part: int | None
    at: LinearForm
    along: LinearForm


class Flow(NamedTuple):
    """k = z(1) − at, where z(0) = at and z′(θ) = time · h f^[part](z(θ)) + Σ_j θ^j forcing[j].

    Without forcing, the exact flow of a part; with it, what exponential and multirate infinitesimal methods solve.
    """

    part: int | None
    at: LinearForm
    time: Entry
    forcing: tuple[LinearForm, ...] = ()


class Average(NamedTuple):
    """k = ∫₀¹ θ^power h f^[part](Σ_j θ^j path[j]) dθ: an average of the field along a polynomial path."""

    part: int | None
    path: tuple[LinearForm, ...]
    power: int = 0


Evaluation = Field | Derivative | Flow | Average


def operands(evaluation: Evaluation) -> Iterator[LinearForm]:
    """All linear forms that an evaluation takes."""
    if isinstance(evaluation, Average):
        yield from evaluation.path
        return
    yield evaluation.at
    if isinstance(evaluation, Derivative):
        yield evaluation.along
    if isinstance(evaluation, Flow):
        yield from evaluation.forcing
