"""What a run shows of its energy, beside what the modified equation predicts for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple
from warnings import catch_warnings, simplefilter

import numpy as np

from bseries.exceptions import SeriesError
from bseries.hamiltonians.drift_statistics import (
    BOUNDED,
    LINEAR,
    RANKS,
    SQUARE_ROOT,
    THRESHOLDS,
    UNSEEN,
    UNSTEADY,
    DriftStatistics,
    drift_statistics,
)
from bseries.hamiltonians.modified_hamiltonian import modified_hamiltonian
from bseries.hamiltonians.perturbations import Perturbation
from integrators.methods.programs.program import Method
from integrators.runs.integration import integrate
from integrators.runs.trajectory import Trajectory
from integrators.scenes.particles.parts import Parts
from integrators.steppers.states import StepError

if TYPE_CHECKING:
    from bseries.hamiltonians.modified_hamiltonian import ModifiedHamiltonian

CHUNK = 8192  # number of states of a run in memory at a time


class Leading(NamedTuple):
    """The leading term of the modified equation, which makes the energy oscillate."""

    power: int  # of h
    hamiltonian: ModifiedHamiltonian | None  # H̃ up to this term; None if the method has none for every H

    @property
    def name(self) -> str:
        """The term, as text."""
        return f"the term with h^{self.power}" if self.hamiltonian is None else f"-h^{self.power} H_{self.power + 1}"

    @property
    def formula(self) -> str:
        """The term in a picture."""
        return (
            f"term with $h^{{{self.power}}}$"
            if self.hamiltonian is None
            else f"$-h^{{{self.power}}} H_{{{self.power + 1}}}$"
        )


class Evidence(NamedTuple):
    """A run, its energy, and the predictions for it.

    Attributes:
        h: The step size.
        time: The length of the run, up to where its energy overflows.
        energy: The statistics of the energy; None if it overflows.
        total: Those of the predicted change of H̃, the integral of Σ h^k ∇H · r_k; None if none is predicted.
        rates: Those of the integral of ∇H · r_k, by power k of h.
        leading: The leading term of the modified equation; None if none is known.
        band: The least and the largest change of the energy that it predicts along the run.
        left: The part of the deviation of the energy that all predictions leave.
        rounding: The size of rounding errors in the energy.
    """

    h: float
    time: float
    energy: DriftStatistics | None = None
    total: DriftStatistics | None = None
    rates: tuple[tuple[int, DriftStatistics], ...] = ()
    leading: Leading | None = None
    band: tuple[float, float] | None = None
    left: float = 1.0
    rounding: float = 0.0

    @property
    def is_explained(self) -> bool:
        """Whether the modified equation explains the changes of the energy, or these are only rounding errors."""
        return self.energy is not None and (self.left < THRESHOLDS.explained or self.energy.low == self.energy.high)

    @property
    def predicted(self) -> str:
        """The kind of the predicted change of H̃; bounded if it is below rounding errors, and no line."""
        total = self.total
        if total is None or (total.kind != LINEAR and total.high - total.low <= self.rounding):
            return BOUNDED
        return total.kind

    @property
    def kind(self) -> str:
        """The verdict: that of the predicted change of H̃ if predictions explain the energy, else that of the energy.

        What −h^k H_(k+1) explains is no drift, as it is a function of the state. But a band is a bound only if the
        energy is explained, and its variance saturated.
        """
        if self.energy is None:
            return UNSTEADY
        if not self.is_explained:
            return UNSEEN if self.energy.kind == BOUNDED else self.energy.kind
        return self.predicted if self.energy.kind == BOUNDED else max(self.predicted, UNSEEN, key=RANKS.index)

    @property
    def is_predicted(self) -> bool:
        """Whether the verdict is that of the modified equation."""
        return self.is_explained and self.predicted == self.kind

    @property
    def reason(self) -> str:
        """The reason for the verdict, in a sentence."""
        over = f"over t = {self.time:.6g}"
        if self.energy is None:
            return f"the energy leaves all bounds at t = {self.time:.6g}"
        change = float(np.sign(self.h)) * self.energy.end
        beyond = "" if self.is_predicted else ", which the modified equation does not predict"
        term = "the modified equation" if self.leading is None else self.leading.name
        doubt = (
            "its variance is not saturated" if self.is_explained else f"{term} does not explain it: h is beyond reach"
        )
        return {
            BOUNDED: f"the energy oscillates as predicted, and {over} its variance is saturated",
            LINEAR: f"the mean of dH~/dt along the run is not zero{beyond}",
            UNSTEADY: f"{over} the energy changes by {change:.2g} and does not come back, at no steady rate{beyond}",
            SQUARE_ROOT: f"the integral of dH~/dt along the run spreads as a random walk does, along no line{beyond}",
            UNSEEN: f"no drift of the energy is seen {over}, but {doubt}",
        }[self.kind]

    def facts(self) -> Iterator[tuple[str, str]]:
        """Rows of a table: the change of the energy as measured and as predicted."""
        if self.energy is None:
            return
        low, high = sorted(np.sign(self.h) * end for end in (self.energy.low, self.energy.high))
        yield f"change of the energy over t = {self.time:.6g}", f"{low + 0.0:.3g} to {high + 0.0:.3g}"
        if self.leading is not None and self.band is not None:
            yield f"range of {self.leading.name} along the run", "{:.3g} to {:.3g}".format(*self.band)

    def to_dict(self) -> dict[str, Any]:
        """The evidence as plain data, without the rates."""
        band = None if self.leading is None or self.band is None else {"power": self.leading.power, "range": self.band}
        return {
            "time": self.time,
            "energy": self.energy and self.energy._asdict(),
            "predicted": self.total and self.total._asdict(),
            "leading": band,
            "left": self.left,
            "rounding": self.rounding,
        }


def run_evidence(
    r: Perturbation, method: Method, start: Sequence[float] | np.ndarray, h: float, steps: int, parts: Parts | None, *,
    powers: Sequence[int], order: int, is_symplectic: bool,
) -> Evidence:  # fmt: skip
    """The evidence of a run from a start.

    Args:
        r: The perturbation, on its scene.
        method: The method.
        start: The state at the start.
        h: The step size.
        steps: The number of steps.
        parts: The parts of the scene.
        powers: The powers of h at which H̃ changes.
        order: The order of the method.
        is_symplectic: Whether the method is symplectic for every H.

    Raises:
        StepError: A step failed at an energy that is finite.
    """
    leading = _leading(r, method, order, parts, is_symplectic)
    own = [] if leading is None or leading.hamiltonian is not None else [leading.power]
    wanted = sorted({*own, *powers})
    columns, scale, failure = list[np.ndarray](), 0.0, None
    with np.errstate(all="ignore"), catch_warnings():
        simplefilter("ignore")  # the end of a run need not be finite
        for run, failed in _pieces(r, method, start, h, steps, parts):
            terms = [] if leading is None or leading.hamiltonian is None else [leading.hamiltonian.terms(run.y)[-1]]
            rows = [run.observed["energy"], *terms, *(r.rates(run.y, k) for k in wanted)]
            columns.append(np.array(rows)[:, 1 if columns else 0 :])
            moves = np.linalg.norm(np.diff(run.y), axis=0) * np.linalg.norm(run.y[:, 1:], axis=0)
            scale, failure = max(scale, abs(rows[0]).max(), *(moves / abs(h))), failed
        table = np.hstack(columns)
        finite = np.isfinite(table * table).all(axis=0)
    if not finite.all():
        return Evidence(h, (int(np.argmin(finite)) - 1) * abs(h))
    if failure is not None:
        raise failure
    rounding = THRESHOLDS.roundings * float(np.finfo(float).eps) * (steps + 1) ** 0.5 * float(scale)
    at = len(table) - len(wanted)
    integrals = dict(zip(wanted, (_integral(row, abs(h)) for row in table[at:]), strict=True))
    evidence = Evidence(h, steps * abs(h), leading=leading, rounding=rounding)
    return _judged(evidence, table[:at], integrals, powers)


def _judged(
    evidence: Evidence, values: np.ndarray, integrals: dict[int, np.ndarray], powers: Sequence[int]
) -> Evidence:
    """The evidence with its statistics, from the energy, the leading term and the integrals of rates along a run."""
    h, leading = evidence.h, evidence.leading
    sense, dt = float(np.sign(h)), abs(h)
    changes = values[0] - values[0, 0]
    total = sum((h**k * integrals[k] for k in powers), np.zeros(len(changes)))
    predicted, band = sense * total, None
    if leading is not None:
        k = leading.power
        term = sense * h**k * integrals[k] if leading.hamiltonian is None else -(h**k) * (values[1] - values[1, 0])
        band = float(term.min()) + 0.0, float(term.max()) + 0.0
        predicted = predicted if k in powers else predicted + term
    deviation = float(changes.std())
    return evidence._replace(
        energy=drift_statistics(sense * changes, dt, evidence.rounding),
        total=drift_statistics(total, dt) if powers else None,
        rates=tuple((k, drift_statistics(integrals[k], dt)) for k in powers),
        band=band,
        left=float((changes - predicted).std()) / deviation if deviation else 0.0,
    )


def _leading(r: Perturbation, method: Method, order: int, parts: Parts | None, is_symplectic: bool) -> Leading | None:
    """The first term of the modified equation beyond f; None if it is neither Hamiltonian nor on a canonical scene."""
    power = order if r.twin is not None else next(filter(r.has_terms, range(order, r.field.order)), None)
    if power is None:
        return None
    if r.twin is None and not is_symplectic:
        return Leading(power, None) if r.scene.poisson is None else None
    try:
        return Leading(power, modified_hamiltonian(r.twin or method, r.scene, power + 1, parts=parts))
    except SeriesError:
        return None


def _pieces(
    r: Perturbation, method: Method, start: Sequence[float] | np.ndarray, h: float, steps: int, parts: Parts | None
) -> Iterator[tuple[Trajectory, StepError | None]]:
    """The pieces of a run, each from the last state of the one before; the last one with the failure that ended it."""
    for made in range(0, steps, CHUNK):
        count = min(CHUNK, steps - made)
        try:
            run = integrate(method, r.scene, h=h, steps=count, y0=start, parts=parts, observe="energy", observe_every=1)
        except StepError as error:
            yield error.trajectory, error
            return
        yield run, None
        start = run.y[:, -1]


def _integral(rates: np.ndarray, dt: float) -> np.ndarray:
    """The integral of a function given at equidistant times, by the trapezoidal rule, which is exact over periods."""
    return np.concatenate([[0.0], np.cumsum(rates[1:] + rates[:-1])]) * (dt / 2)
