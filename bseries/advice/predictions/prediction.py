"""Predictions of runs: the expected time and errors, or the reasons why they are unknown."""

from __future__ import annotations

from typing import Any, NamedTuple

from bseries.advice.predictions.calibration import duration
from foundation.table import Table, as_html, fact_table


class ExpectedError(NamedTuple):
    """An expected error, or the reason why it is unknown.

    Attributes:
        value: The error; None if unknown.
        reason: The reason, or a remark on the value; may be empty.

    Example:
        >>> print(ExpectedError(2.13e-7), ExpectedError(None, "there is no energy"))
        2.1e-07 unknown: there is no energy
    """

    value: float | None
    reason: str = ""

    def __str__(self) -> str:
        text = "unknown" if self.value is None else f"{self.value:.1e}"
        return f"{text}: {self.reason}" if self.reason else text


class Prediction(NamedTuple):
    """Expected time and errors of a run; made by `predict_run`.

    Attributes:
        h: The step size.
        steps: The number of steps.
        seconds: The time on this machine; None if not requested, or if there are too few steps to measure it.
        energy: The largest change of the energy, relative to its value at the start if that is not 0.
        solution: The largest distance from the exact solution, relative to the largest state of the whole run.
        powers: The powers of h in the modified equation from which the errors follow; may be empty.
        pilot: The part of the run covered by the perturbation run, from 0 to 1; errors of the rest follow a growth law.

    Example:
        >>> import bseries as bs
        >>> print(bs.predict_run("gauss2", bs.scene("henon-heiles"), h=0.1, steps=1000, timed=False))
        relative energy error 1.8e-07, relative solution error 2.8e-05 (from the modified equation to h^6)
    """

    h: float
    steps: int
    seconds: float | None
    energy: ExpectedError
    solution: ExpectedError
    powers: tuple[int, ...]
    pilot: float

    @property
    def basis(self) -> str:
        """The origin of expected errors."""
        if not self.powers:
            return ""
        rest = "" if self.pilot >= 1 else f", extrapolated from {100 * self.pilot:.2g} % of the time"
        return f"from the modified equation to h^{self.powers[-1]}{rest}"

    def __str__(self) -> str:
        time = [] if self.seconds is None else [duration(self.seconds, 2)]
        errors = [f"relative energy error {self.energy}", f"relative solution error {self.solution}"]
        if self.energy == self.solution and self.energy.value is None:
            errors = [f"errors {self.energy}"]
        return ", ".join([*time, *errors]) + (f" ({self.basis})" if self.basis else "")

    def __repr__(self) -> str:
        return f"<Prediction of {self.steps:,} steps of {self.h:g}: {self}>"

    def to_table(self) -> Table:
        """The prediction as a table."""
        time = None if self.seconds is None else duration(self.seconds, 2)
        errors = [("relative energy error", str(self.energy)), ("relative solution error", str(self.solution))]
        facts = [("step size", self.h), ("steps", self.steps), ("time", time), *errors, ("basis", self.basis or None)]
        return fact_table("Prediction of a run", facts)._replace(data=self.to_dict)

    _repr_html_ = as_html

    def to_dict(self) -> dict[str, Any]:
        """The prediction as plain data."""
        errors = {"energy_error": self.energy._asdict(), "solution_error": self.solution._asdict()}
        facts = {key: value for key, value in self._asdict().items() if key not in ("energy", "solution")}
        return {"schema": 1, "kind": "prediction", **facts, **errors, "powers": list(self.powers)}


def time_only(h: Any, steps: int, reason: str, seconds: float | None = None) -> Prediction:
    """A prediction with unknown errors, and the reason."""
    unknown = ExpectedError(None, reason)
    return Prediction(float(h), steps, seconds, unknown, unknown, (), 0.0)
