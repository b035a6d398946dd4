"""The drift of an energy in a log: of any program, and of energies alone, without positions and forces."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from typing import IO, Any, NamedTuple

import numpy as np

from bseries.exceptions import SeriesError
from bseries.hamiltonians.drift_statistics import BOUNDED, UNSEEN, DriftStatistics, drift_statistics
from bseries.shadow.sources import chosen_names, text_lines
from bseries_base.errors import shown
from bseries_base.table import Column, Table, as_html, as_text
from integrators.exact.arguments import read_number

TOTAL = re.compile(r"(?:total[ _-]?energy|conserved|toteng|e_?tot(?:al)?|econserve|energy|H)\b.*", re.I)
"""Names of columns of a total energy, of LAMMPS (TotEng), GROMACS, OpenMM and others."""
TIME = re.compile(r"(?:time|t|#?step)\b.*", re.I)
LEGEND = re.compile(r'@\s*s\d+\s+legend\s+"(.*)"')
"""The name of a column in XVG files."""
EVEN = 1e-3
"""Times whose steps differ by less, relative to a step, are equidistant: they may be rounded."""


class EnergyLog(NamedTuple):
    """What a log of an energy shows.

    Attributes:
        column: The name of the column.
        interval: The time between two values.
        length: The number of values.
        statistics: The statistics of the energy.

    Example:
        >>> import numpy as np
        >>> import bseries as bs
        >>> t = np.arange(2000)
        >>> lines = ["Step TotEng", *(f"{k} {-3 + 1e-6 * k + 1e-4 * np.cos(k):.12f}" for k in t)]
        >>> log = bs.shadow.energy_log(lines)
        >>> log.kind, f"{log.statistics.mean:.3g}"
        ('linear drift', '1e-06')
    """

    column: str
    interval: float
    length: int
    statistics: DriftStatistics

    def __repr__(self) -> str:
        return f"<EnergyLog: {self.column}, {self.kind}>"

    @property
    def kind(self) -> str:
        """``linear drift``, ``unsteady drift``, ``square-root drift`` or ``no drift seen``: no values prove a bound."""
        return UNSEEN if self.statistics.kind == BOUNDED else self.statistics.kind

    def to_dict(self) -> dict[str, Any]:
        """The results as plain data."""
        s = self.statistics
        return {
            "schema": 1, "kind": "energy-log", "column": self.column, "values": self.length, "interval": self.interval,
            "time": s.time, "verdict": self.kind, "slope": s.mean, "slope_error": s.error, "diffusion": s.diffusion,
            "diffusion_error": s.diffusion_error, "deviation": s.deviation, "amplitude": s.amplitude, "change": s.end,
        }  # fmt: skip

    def to_table(self) -> Table:
        """The verdict and the numbers that it rests on."""
        s = self.statistics
        facts = [
            ("values", f"{self.length:,}, at intervals of {self.interval:.6g}"),
            ("slope", f"{s.mean:.4g} ± {s.error:.2g}"),
            ("diffusion", f"{s.diffusion:.3g} ± {s.diffusion_error:.2g}"),
            ("half of the range", f"{s.amplitude:.4g}"),
            ("standard deviation", f"{s.deviation:.4g}"),
            ("change from start to end", f"{s.end:.4g}"),
        ]
        columns = (Column("quantity"), Column("value"))
        return Table(f"{self.column}: {self.kind}", columns, facts, data=self.to_dict)

    __str__, _repr_html_ = as_text, as_html


def energy_log(
    source: str | os.PathLike[str] | IO[str] | Sequence[str], column: str | None = None, *, h: float | str | None = None
) -> EnergyLog:
    """Whether the energy in a log stays bounded, drifts or walks, from its values alone.

    Args:
        source: A file, its path, or its lines: text with the names of columns in a line and numbers below it, such as
            logs of LAMMPS, XVG files of GROMACS and CSV of OpenMM. Of several tables the longest counts.
        column: The name, a pattern or the place (from 0) of the energy; by default the total energy.
        h: The time between two values; by default that of a column ``time``, ``t`` or ``step``, else 1.

    Returns:
        An `EnergyLog`.

    Raises:
        SeriesError: There is no such column, there are fewer than 512 values, one is not finite, the times are not
            equidistant, or `h` is not positive.
        IntegratorError: `h` is no number.

    Example:
        >>> import bseries as bs
        >>> run = bs.integrate("rk4", "pendulum", h=0.5, steps=2000, observe="energy")
        >>> lines = ["energy", *map(str, run["energy"])]
        >>> bs.shadow.energy_log(lines, h=0.5).kind
        'linear drift'
    """
    names, table = _longest_table(source)
    place = _energy(names, column)
    interval = _interval(names, table, place) if h is None else read_number(h, "h")
    if not 0 < interval < np.inf:
        raise SeriesError(f"h must be a positive number, but was {shown(interval)}")
    values = table[:, place]
    return EnergyLog(names[place], interval, len(values), drift_statistics(values, interval))


def _longest_table(source: Any) -> tuple[list[str], np.ndarray]:
    """The names and the numbers of the longest table in a text."""
    best: tuple[list[str], list[list[float]]] = [], []
    names: list[str] = []
    legends: list[str] = []
    rows: list[list[float]] = []
    for line in _lines(source):
        cells = [cell.strip().strip('"') for cell in (line.split(",") if "," in line else line.split())]
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            row = []
        if rows and len(row) != len(rows[0]):
            best, rows = max(best, (names, rows), key=lambda table: len(table[1])), []
        if row:
            if not rows and len(legends) == len(row) - 1:
                names = ["Time", *legends]
            elif not rows and len(names) != len(row):
                names = [str(k) for k in range(len(row))]
            rows.append(row)
        elif legend := LEGEND.match(line):
            legends.append(legend[1])
        elif not line.startswith(("#", "@")) or line.startswith(('#"', "# ")):
            names = [cell.lstrip("# ").strip('"') for cell in cells if cell != "#"]
    names, rows = max(best, (names, rows), key=lambda table: len(table[1]))
    if not rows:
        raise SeriesError("source must have a table of numbers, but has none")
    return names, np.array(rows)


def _lines(source: Any) -> Iterator[str]:
    """The lines that are not empty."""
    if isinstance(source, str | os.PathLike):
        source = os.fspath(source)
        return text_lines(source, source, "text in UTF-8, but was not")
    if hasattr(source, "readline"):
        return text_lines(source, "source", "text in UTF-8, but was not")
    return filter(None, map(str.strip, source))


def _energy(names: Sequence[str], column: str | None) -> int:
    """The place of the column of the energy."""
    found = (
        [name for name in names if TOTAL.fullmatch(name)]
        if column is None
        else chosen_names(column, list(names), "source")
    )
    if column is None and not found and len(names) <= 2:
        found = [names[-1]]
    if len(found) != 1:
        which = "no total energy" if not found else f"several: {', '.join(found):.200}"
        raise SeriesError(f"column must be one of {', '.join(names):.200}, but was {shown(column)}: there is {which}")
    return names.index(found[0])


def _interval(names: Sequence[str], table: np.ndarray, energy: int) -> float:
    """The time between two values: that of a column of times or steps, else 1."""
    place = next((k for k, name in enumerate(names) if k != energy and TIME.fullmatch(name)), None)
    if place is None or len(table) < 2:
        return 1.0
    steps = np.diff(table[:, place])
    mean = float(steps.mean())
    if not np.abs(steps - mean).max() <= max(EVEN * abs(mean), np.spacing(np.abs(table[:, place]).max())):
        raise SeriesError(
            f"{names[place]} must be equidistant, but its steps are {steps.min():.6g} to {steps.max():.6g}"
        )
    return mean
