"""Trajectories: the stored states and observations of a run, in memory and in files."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bseries_base.diagrams import axis_label, draw_curves, of_line
from bseries_base.errors import shorten, shown
from bseries_base.extras import optional_module
from bseries_base.numbers import finite_or_none
from bseries_base.plotting import drawing
from bseries_base.table import Column, Document, LazyRows, Table, Tabular, number_column
from integrators.core.arguments import check_label, items
from integrators.core.errors import IntegratorError
from integrators.core.stored_arrays import (
    MOST_TEXT,
    TEXT,
    Form,
    StoredArrays,
    read_json,
    read_rows,
    reading,
    write_arrays,
)
from integrators.core.text_files import check_path, read_text
from integrators.runs.titles import write_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import DTypeLike
    from pandas import DataFrame
    from xarray import Dataset


OBSERVED = "observed/"
RUN = "run.json"
"""The file that describes the other files in the folder of a run."""
PART = ".part"
"""Suffix of the folder that a run writes to."""
ROWS = {key: f"{key}.f64" for key in ("y", "t", "observed", "observed_t")}
"""The files of rows in it: doubles without a header."""
REAL = "fiu"
META = {key: (None, {"name": (None, str)}) for key in ("method", "scene")} | {"save_every": (None, int)}
CONTENT = {"variables": [str], "observed": [str], "h": (int, float), "same_times": bool, "meta": META}
"""The content of `RUN`."""

DIGITS = "0123456789"
WIDTH, ORBIT_WIDTH = 1.0, 0.5
"""Of lines in a plot, in points; orbits come close to themselves."""

START_AND_END = (
    Column("what", get=lambda record: record["what"]), number_column("start", ".15g"), number_column("end", ".15g"),
    number_column("change", ".3g"),
)  # fmt: skip


class Trajectory(Tabular):
    """The stored states and observations of a run, in float64; made by `integrate` and `load_trajectory`.

    Attributes:
        t: The times of the stored states, (n,).
        y: The stored states, (variables, n).
        observed: The observed quantities by name, arrays (m,).
        observed_t: The times of the observations, (m,); the array `t` itself if exactly the stored states are observed.
        h: The step size.
        variables: The names of the variables.
        meta: The scene, the method and the options of the run, as JSON values.

    Example:
        >>> import bseries as bs
        >>> run = bs.integrate("rk4", bs.scene("pendulum"), h=0.1, steps=200, save_every=100, observe="energy")
        >>> run
        <Trajectory of rk4 on pendulum: 3 states from t = 0 to 20, energy observed>
        >>> run.t, run.variables, run.y.shape, run.meta["method"]["b"]
        (array([ 0., 10., 20.]), ('p', 'q'), (2, 3), ['1/6', '1/3', '1/3', '1/6'])
        >>> bool((run["q"] == run.y[1]).all())
        True
    """

    def __init__(
        self, t: np.ndarray, y: np.ndarray, *, h: float, variables: Sequence[str],
        observed: Mapping[str, np.ndarray] | None = None, observed_t: np.ndarray | None = None,
        meta: Document | None = None,
    ):  # fmt: skip
        self.t, self.y, self.h, self.variables = t, y, h, tuple(variables)
        self.observed, self.meta = dict(observed or {}), dict(meta or {})
        self.observed_t = t if observed_t is None else observed_t

    def __repr__(self) -> str:
        span = f"{len(self.t):,} states from t = {self.t[0]:g} to {self.t[-1]:g}" if len(self.t) else "no states"
        observed = f", {', '.join(self.observed)} observed" if self.observed else ""
        return f"<Trajectory of {_names(self)}: {span}{observed}>"

    def __getitem__(self, name: str) -> np.ndarray:
        """The values of a variable or of an observed quantity, or the times ``t``, by name.

        Raises:
            IntegratorError: There is nothing of this name.
        """
        if name in self.variables:
            return self.y[self.variables.index(name)]
        if name in self.observed:
            return self.observed[name]
        if name == "t":
            return self.t
        known = ", ".join([*self.variables, *self.observed, "t"])
        raise IntegratorError(f"name must be one of {shorten(known)}, but was {shown(name)}")

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> np.ndarray:
        """The stored states, so that NumPy's functions take a run for them."""
        return np.array(self.y, dtype) if copy else np.asarray(self.y, dtype)

    def to_table(self) -> Table:
        """Quantities and variables at the start and at the end; CSV and pandas have a row for each time."""
        records = list(_records(self))
        times = [float(t) for t in self.t[[0, -1]]] if len(self.t) else []
        span = f"{len(self.t):,} states, t = {times[0]:g} to {times[1]:g}, h = {self.h:g}" if times else "no states"
        return Table(
            f"{_names(self)}: {span}",
            START_AND_END,
            records,
            [f"change: the largest distance from the start, at {len(self.observed_t):,} times."] * bool(self.observed),
            data=lambda: {"schema": 1, "kind": "trajectory", "h": self.h, "t": times, "rows": records},
            items="rows",
            records=_states(self),
        )

    def copy(self) -> Trajectory:
        """A copy in memory."""
        observed = {name: values.copy() for name, values in self.observed.items()}
        times = None if self.observed_t is self.t else self.observed_t.copy()
        labels = {"h": self.h, "variables": self.variables, "meta": self.meta}
        return Trajectory(self.t.copy(), self.y.copy(order="F"), observed=observed, observed_t=times, **labels)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a trajectory file, which `load_trajectory` and ``numpy.load`` read.

        Args:
            path: The file; it is replaced only when the new one is complete.

        Raises:
            IntegratorError: The file cannot be written.
        """
        arrays: Document = {"t": self.t, "y": self.y, "h": self.h, "variables": self.variables}
        if self.observed_t is not self.t:
            arrays["observed_t"] = self.observed_t
        arrays |= {OBSERVED + name: values for name, values in self.observed.items()}
        write_arrays(path, arrays | {"meta": json.dumps(self.meta, ensure_ascii=False)})

    def plot(
        self, ax: Axes | None = None, *, x: str = "t", y: str | Sequence[str] | None = None, change: bool = False,
        points: bool = False, label: str | None = None, **style: Any,
    ) -> Axes:  # fmt: skip
        """Variables or observed quantities over time, or over another one: a phase portrait.

        Args:
            x: ``"t"``, a variable or an observed quantity.
            y: Variables or quantities, one or several; by default all variables.
            change: Whether changes since the start are drawn, such as the error of an energy.
            points: Whether states are drawn as points without lines between them.
            label: The name of the run in the legend, for axes with several runs; by default method and scene.
            **style: Properties of the lines, such as ``color`` and ``lw``.

        Raises:
            IntegratorError: A name is unknown, `change` is not True or False, quantities are observed at other times
                than those of the states, or `ax` is no axes.

        Example:
            >>> import bseries as bs
            >>> run = bs.integrate("rk4", bs.scene("pendulum"), h=0.1, steps=200, observe="energy")
            >>> [line.get_label() for line in run.plot().lines]
            ['p', 'q']
            >>> axes = run.plot(y="energy", change=True)
            >>> axes.get_xlabel(), axes.get_ylabel()
            ('time $t$', 'error of the energy, $H - H_0$')
            >>> axes = run.plot(x="q", y="p")
            >>> other = bs.integrate("stormer-verlet", bs.scene("pendulum"), h=0.1, steps=200, observe="energy")
            >>> axes = other.plot(run.plot(y="energy", label="rk4"), y="energy", label="Störmer–Verlet")
            >>> [text.get_text() for text in axes.get_legend().get_texts()]
            ['rk4', 'Störmer–Verlet']
        """
        if not isinstance(change, bool):
            raise IntegratorError(f"change must be True or False, but was {shown(change)}")
        names = ([y] if isinstance(y, str) else items(() if y is None else y, "y")) or self.variables
        across, *curves = self._columns([x, *names])
        with drawing(ax, IntegratorError) as axes:
            if change:
                curves = [curve - curve[:1] for curve in curves]
            width = WIDTH if x == "t" else ORBIT_WIDTH
            first = len(axes.lines)
            run = label or (_names(self) if first else "")
            labels = [f"{name}, {run}" if run and len(names) > 1 else run or name for name in names]
            draw_curves(
                axes, across, dict(zip(labels, curves, strict=True)), first=first, points=points,
                **of_line(style, linewidth=width),
            )  # fmt: skip
            what = names[0] if len(names) == 1 else "value"
            write_title(axes, "" if first else f"{_names(self)}, h = {self.h:g}")
            axes.set(xlabel=axis_label(x), ylabel=axis_label(what, change))
            if len(names) == 1 and x.rstrip(DIGITS) == what.rstrip(DIGITS):
                axes.set_aspect("equal", "datalim")  # coordinates of one place
        return axes

    def _columns(self, names: Sequence[str]) -> list[np.ndarray]:
        """Variables, observed quantities or t, at the same times."""
        known = ["t", *self.variables, *self.observed]
        for name in names:
            if name not in known:
                raise IntegratorError(f"x and y must be of {', '.join(known)}, but one was {shown(name)}")
        stored = dict(zip(self.variables, self.y, strict=True))
        observed = [name for name in names if name not in stored and name != "t"]
        if observed and self.observed_t is not self.t and (mixed := stored.keys() & set(names)):
            raise IntegratorError(
                f"observe_every must be save_every for a plot of {observed[0]} and {min(mixed)}, but times differ"
            )
        columns = stored | dict(self.observed) | {"t": self.observed_t if observed else self.t}
        return [columns[name] for name in names]

    def to_pandas(self) -> DataFrame:
        """The trajectory as a ``pandas.DataFrame``: a row for each time, a column for each variable and quantity.

        Raises:
            IntegratorError: pandas is not installed, or states were not observed exactly when they were stored.
        """
        if self.observed and self.observed_t is not self.t:
            raise IntegratorError(
                f"observe_every must be save_every for one table, but there are {len(self.t)} states and "
                f"{len(self.observed_t)} observations"
            )
        pandas = optional_module("pandas", "to_pandas")
        columns = dict(zip(self.variables, self.y, strict=True)) | self.observed
        return pandas.DataFrame(columns, index=pandas.Index(self.t, name="t"))

    def to_xarray(self) -> Dataset:
        """The trajectory as an ``xarray.Dataset``: y (variable, time), and observations (time) or (observed_time).

        Raises:
            IntegratorError: xarray is not installed, or a quantity has the name of a coordinate.
        """
        xarray = optional_module("xarray", "to_xarray")
        time = "time" if self.observed_t is self.t else "observed_time"
        coordinates = {"variable": list(self.variables), "time": self.t, time: self.observed_t}
        for name in self.observed:
            if name in ("y", *coordinates):
                raise IntegratorError(f"observed must have other names than xarray's coordinates, but has {name}")
        values = {"y": (("variable", "time"), self.y)} | {name: ((time,), x) for name, x in self.observed.items()}
        return xarray.Dataset(values, coordinates, {"h": self.h, "meta": json.dumps(self.meta, ensure_ascii=False)})


def load_trajectory(path: str | os.PathLike[str]) -> Trajectory:
    """Read a trajectory file.

    Args:
        path: The file of a run. During the run, or after a crash, there is only a folder with ``.part`` added to the
            name; then everything written so far is read.

    Returns:
        The trajectory; large arrays are read-only and mapped into memory, without a check of their numbers.

    Raises:
        IntegratorError: The file does not exist, or is not a trajectory.

    Example:
        >>> import bseries as bs
        >>> import pathlib, tempfile
        >>> import numpy as np
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "line.npz")
        ...     bs.Trajectory(np.arange(3.0), np.ones((1, 3)), h=1.0, variables=["y"]).save(path)
        ...     bs.load_trajectory(path)
        <Trajectory of 1 variables: 3 states from t = 0 to 2>
    """
    name = check_path(path, "path")
    sentence = f"{shorten(name, 200)} must be a trajectory file, but was not"
    with reading(sentence):
        if os.path.isdir(name) or (not os.path.exists(name) and os.path.isdir(name + PART)):
            folder = name if os.path.isdir(name) else name + PART
            run = read_run(folder)
            # Times are read first but written last, so their rows are complete.
            widths = reversed(row_widths(run).items())
            rows = {key: read_rows(os.path.join(folder, ROWS[key]), *width) for key, width in widths}
            return _checked(trajectory_of(run, rows))
        arrays = StoredArrays(name, sentence)
        stored = arrays.members
        times = "m" if "observed_t" in stored else "n"
        forms = {"variables": Form("U", ("variables",)), "t": Form(REAL, ("n",)), "y": Form(REAL, ("variables", "n"))}
        forms["h"] = Form(REAL)
        forms |= {name: Form(REAL, (times,)) for name in stored if name == "observed_t" or name.startswith(OBSERVED)}
        found = arrays.read(forms)
        meta = read_json(arrays.read({"meta": TEXT})["meta"], META, "meta") if "meta" in stored else {}
        observed = {key.removeprefix(OBSERVED): values for key, values in found.items() if key.startswith(OBSERVED)}
        labels = {"h": float(found["h"]), "variables": found["variables"], "observed": observed, "meta": meta}
        times = {name: np.asarray(found[name], float) for name in ("t", "observed_t") if name in found}
        return _checked(Trajectory(y=found["y"], **times, **labels))


def read_run(folder: str) -> Document:
    """The description of the rows in the folder of a run."""
    path = os.path.join(folder, RUN)
    if not os.path.isfile(path):
        raise ValueError(f"it has no {RUN}")
    return read_json(read_text(path, MOST_TEXT)[0], CONTENT, RUN)


def row_widths(run: Document) -> dict[str, tuple[int, ...]]:
    """The shapes of rows of states, observations and their times; `run` is the content of `RUN`. Times come last."""
    observed = {"observed": (len(run["observed"]),), "observed_t": ()} if run["observed"] else {}
    return {"y": (len(run["variables"]),), **observed, "t": ()}


def trajectory_of(run: Document, rows: Mapping[str, np.ndarray]) -> Trajectory:
    """The trajectory of the rows that have times; `run` is the content of `RUN`."""
    t = rows["t"]
    times = t if run["same_times"] or not run["observed"] else rows["observed_t"]
    y, observed = rows["y"][: len(t)].T, rows["observed"][: len(times)].T if run["observed"] else ()
    if y.shape[1] < len(t) or any(len(row) < len(times) for row in observed):
        raise ValueError(f"it has {len(t)} times, but fewer states or observations")
    seen = dict(zip(run["observed"], observed, strict=True))
    return Trajectory(t, y, h=run["h"], variables=run["variables"], observed=seen, observed_t=times, meta=run["meta"])


def _checked(run: Trajectory) -> Trajectory:
    """A trajectory as a run may have made it; arrays that are mapped into memory are too large to be scanned.

    Runs store finite states only, also if they fail. Times repeat only where steps may be below their resolution.
    """
    if len(set(run.variables)) < len(run.variables):
        raise ValueError(f"variables must have different names, but were {shorten(', '.join(run.variables))}")
    for name in (*run.variables, *run.observed):
        check_label(name, "names of variables and quantities")
    if not 0 < abs(run.h) <= sys.float_info.max:
        raise ValueError(f"h must be finite and not 0, but was {shorten(str(run.h))}")
    if not isinstance(run.y, np.memmap) and not np.isfinite(run.y).all():
        raise ValueError("y must be finite, but was not")
    for name, t in (("t", run.t), ("observed_t", run.observed_t)):
        if isinstance(t, np.memmap):
            continue
        if not np.isfinite(t).all():
            raise ValueError(f"{name} must be finite, but was not")
        resolution = 2 * np.spacing(np.abs(t).max(initial=0.0))  # of n h as well, where t = t0 + n h
        is_fine = run.meta.get("control") is None and abs(run.h) > resolution
        follows = np.greater if is_fine else np.greater_equal
        if not (follows(t[1:], t[:-1]).all() or follows(t[:-1], t[1:]).all()):
            raise ValueError(f"{name} must be times in order, without repetition, but was not")
    return run


def _names(run: Trajectory) -> str:
    """The method and the scene of a run, or else the number of its variables."""
    names = ((run.meta.get(key) or {}).get("name") for key in ("method", "scene"))
    return " on ".join(name for name in names if name) or f"{len(run.variables)} variables"


def _records(run: Trajectory) -> Iterator[Document]:
    """A record for each quantity and variable; None for numbers that are not finite."""
    for name, values in run.observed.items():
        first, last = (finite_or_none(value) for value in values[[0, -1]]) if len(values) else (None, None)
        change = None if first is None else finite_or_none(abs(values - first).max())
        yield {"what": name, "start": first, "end": last, "change": change}
    for name, values in zip(run.variables, run.y, strict=True) if len(run.t) else ():
        yield {"what": name, "start": float(values[0]), "end": float(values[-1])}


def _states(run: Trajectory) -> Table:
    """A row for each time, with the observations that are made there."""
    same = run.observed_t is run.t
    observed = run.observed if same else {}
    columns = [run.t, *run.y, *observed.values()]

    def rows() -> Iterator[list[float]]:
        return ([float(column[k]) for column in columns] for k in range(len(run.t)))

    return Table("", list(map(Column, ["t", *run.variables, *observed])), LazyRows(rows, len(run.t)))
