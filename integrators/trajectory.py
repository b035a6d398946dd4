"""Trajectory: what is kept of a run."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .errors import IntegratorError
from .optional_modules import optional_module

if TYPE_CHECKING:
    import numpy as np


class Trajectory:
    """What is kept of a run, as arrays of doubles; made by `integrate` and `load_trajectory`.

    Attributes:
        t: The times of the stored states, (n,).
        y: The stored states, (variables, n).
        observed: What was observed, by name: arrays (m,).
        observed_t: The times of that, (m,); the array `t` itself where exactly the stored states were observed.
        h: The step size.
        variables: The names of the variables.
        meta: The scene, the method and the options of the run, as JSON can hold them.

    Example:
        >>> from integrators import scene
        >>> from integrators.loop import integrate
        >>> run = integrate(scene("pendulum"), "rk4", h=0.1, steps=200, save_every=100, observe="energy")
        >>> run
        <Trajectory of rk4 on pendulum: 3 states from t = 0 to 20, energy observed>
        >>> run.t, run.variables, run.y.shape, run.meta["method"]["b"]
        (array([ 0., 10., 20.]), ('p', 'q'), (2, 3), ['1/6', '1/3', '1/3', '1/6'])
    """

    def __init__(
        self,
        t: np.ndarray,
        y: np.ndarray,
        *,
        h: float,
        variables: Sequence[str],
        observed: Mapping[str, np.ndarray] | None = None,
        observed_t: np.ndarray | None = None,
        meta: Mapping[str, Any] | None = None,
    ):
        self.t, self.y, self.h, self.variables = t, y, h, tuple(variables)
        self.observed = dict(observed or {})
        self.observed_t = t if observed_t is None else observed_t
        self.meta = dict(meta or {})

    def __repr__(self) -> str:
        names = ((self.meta.get(key) or {}).get("name") for key in ("method", "scene"))
        of = " on ".join(name for name in names if name) or f"{len(self.variables)} variables"
        span = f"{len(self.t):,} states from t = {self.t[0]:g} to {self.t[-1]:g}" if len(self.t) else "no states"
        observed = f", {', '.join(self.observed)} observed" if self.observed else ""
        return f"<Trajectory of {of}: {span}{observed}>"

    def copy(self) -> Trajectory:
        """The same trajectory in arrays of its own, in memory."""
        labels = {"h": self.h, "variables": self.variables, "meta": self.meta}
        t, y, observed = self.t.copy(), self.y.copy(order="F"), {key: x.copy() for key, x in self.observed.items()}
        times = None if self.observed_t is self.t else self.observed_t.copy()
        return Trajectory(t, y, observed=observed, observed_t=times, **labels)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a trajectory file, which `load_trajectory` and ``numpy.load`` read.

        Args:
            path: The file; it is replaced at once when everything is written, or left as it was.

        Raises:
            IntegratorError: The file cannot be written.
        """
        from .trajectory_files import save_trajectory

        save_trajectory(self, path)

    def to_pandas(self) -> Any:
        """The trajectory as a ``pandas.DataFrame``: a row for each time, a column for each variable and observation.

        Raises:
            IntegratorError: pandas is missing, or the states were stored at other times than observed.
        """
        if self.observed and self.observed_t is not self.t:
            raise IntegratorError(
                f"observe_every must be save_every for one table, but there are {len(self.t)} states and "
                f"{len(self.observed_t)} observations"
            )
        pandas = optional_module("pandas", "to_pandas")
        columns = dict(zip(self.variables, self.y, strict=True)) | self.observed
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def to_xarray(self) -> Any:
        """The trajectory as an ``xarray.Dataset``: y (variable, time), and observations (time) or (observed_time).

        Raises:
            IntegratorError: xarray is missing, or something observed has the name of a coordinate.
        """
        import json

        xarray = optional_module("xarray", "to_xarray")
        time = "time" if self.observed_t is self.t else "observed_time"
        coordinates = {"variable": list(self.variables), "time": self.t, time: self.observed_t}
        for name in self.observed:
            if name in ("y", *coordinates):
                raise IntegratorError(f"observed must have other names than xarray's coordinates, but has {name}")
        values = {"y": (("variable", "time"), self.y)} | {name: ((time,), x) for name, x in self.observed.items()}
        return xarray.Dataset(values, coordinates, {"h": self.h, "meta": json.dumps(self.meta, ensure_ascii=False)})
