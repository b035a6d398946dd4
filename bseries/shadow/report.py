"""Statistics of shadow energies in one pass, and the report: the step, the drift, the step for an error bound."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from operator import itemgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bseries.exceptions import SeriesError
from bseries.picture_files import check_picture, save_picture
from bseries.shadow.slope_noise import CHANCE, slope_noise
from bseries_base.diagrams import OVER_DATA, axis_label, draw_curves, of_line
from bseries_base.kernels import float_kernel
from bseries_base.plotting import BLACK, BLUE, VERMILION, drawing, new_figure, print_style
from bseries_base.table import Column, Table, as_frame, as_html, as_text, listed
from integrators.core.arguments import items
from integrators.exact.arguments import read_number
from integrators.runs.titles import write_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes


BLOCKS = 2048


class OrderStatistics(NamedTuple):
    """Statistics of the shadow energy of one order along a trajectory."""

    order: int  # the order; 2 is the energy itself
    mean: float  # its mean
    deviation: float  # half its range
    scatter: float  # its standard deviation about a straight line in time
    gap: float | None  # half the range of its difference to the order before; None for order 2
    drift: float  # the slope of the line by least squares, in energy per time
    drift_error: float  # the standard error of the slope, with correlations in time taken into account
    drift_limit: float  # the slope that noise alone exceeds in 0.27 % of runs


@float_kernel
def add_values(values, first, moments, blocks, position, size):
    """Add values (orders, steps) to the statistics.

    Args:
        values: Values at consecutive steps.
        first: The value of step 0 for each order, which is subtracted.
        moments: For each order the sums of v, n v and v², the extremes of v, and those of its difference to the order
            before.
        blocks: For each order and block the sum and the extremes of v.
        position: The number of the first step.
        size: The number of steps in a block.
    """
    orders, steps = values.shape
    for order in range(orders):
        total, sums, before = moments[order], blocks[order], max(order - 1, 0)
        for k in range(steps):
            n = position + k
            v = values[order, k] - first[order]
            lower = values[before, k] - first[before]
            total[0] += v
            total[1] += n * v
            total[2] += v * v
            total[3], total[4] = min(total[3], v), max(total[4], v)
            total[5], total[6] = min(total[5], v - lower), max(total[6], v - lower)
            block = sums[n // size]
            block[0] += v
            block[1], block[2] = min(block[1], v), max(block[2], v)


class Statistics:
    """Statistics of the shadow energies of several orders after any number of steps, in constant memory."""

    def __init__(self, orders: tuple[int, ...]):
        self.orders, self.count, self.size = orders, 0, 1
        self.first = np.zeros(len(orders))
        self._moments = np.tile([0.0, 0.0, 0.0, np.inf, -np.inf, np.inf, -np.inf], (len(orders), 1))
        self._blocks = np.tile([0.0, np.inf, -np.inf], (len(orders), BLOCKS, 1))

    def add(self, values: np.ndarray) -> None:
        """Add the values (orders, steps) of the next steps."""
        if not self.count:
            self.first = values[:, 0].copy()
        done = 0
        while done < values.shape[1]:
            if self.count == BLOCKS * self.size:
                self._merge()
            taken = values[:, done : done + BLOCKS * self.size - self.count]
            add_values.compiled(taken, self.first, self._moments, self._blocks, self.count, self.size)
            self.count += taken.shape[1]
            done += taken.shape[1]

    def _merge(self) -> None:
        """Merge blocks in pairs."""
        sums, least, largest = np.moveaxis(self._blocks.reshape(len(self.orders), -1, 2, 3), -1, 0)
        merged = np.stack((sums.sum(axis=2), least.min(axis=2), largest.max(axis=2)), axis=-1)
        self._blocks[:, : BLOCKS // 2], self._blocks[:, BLOCKS // 2 :] = merged, (0.0, np.inf, -np.inf)
        self.size *= 2

    def blocks(self) -> np.ndarray:
        """Mean, least and largest values of full blocks, (orders, blocks, 3), relative to the first value."""
        found = self._blocks[:, : self.count // self.size].copy()
        found[..., 0] /= self.size
        return found

    def results(self, h: float) -> tuple[OrderStatistics, ...]:
        """The statistics so far, for steps of size h."""
        return tuple(self._of_order(k, h, means) for k, means in enumerate(self.blocks()[..., 0]))

    def _of_order(self, k: int, h: float, means: np.ndarray) -> OrderStatistics:
        n = self.count
        total, weighted, squares, least, largest, least_gap, largest_gap = map(float, self._moments[k])
        slope = (weighted - 0.5 * (n - 1) * total) * 12 / (n * (n * n - 1.0))
        noise, duration = slope_noise(means), self.size * abs(h)
        about_line = squares - total * total / n - slope * slope * n * (n * n - 1.0) / 12
        return OrderStatistics(
            order=self.orders[k],
            mean=float(self.first[k]) + total / n,
            deviation=0.5 * (largest - least),
            scatter=math.sqrt(max(about_line, 0.0) / (n - 2)),
            gap=0.5 * (largest_gap - least_gap) if k else None,
            drift=slope / h,
            drift_error=noise.error / duration,
            drift_limit=noise.limit / duration,
        )


HEADINGS = ("order", "mean", "±", "scatter", "drift", "± drift")
LIMITS = {
    "rounding": "the rest is rounding",
    "order": "higher orders may show less",
    "step": "higher orders scatter more, since the step is large",
    "slow": "no order explains the rest: rounding errors of the data, their sums, or forces that jump",
}
COMFORTABLE, LARGE = 0.25, 0.5
"""Bounds of small and of moderate steps, relative to the largest step."""
KEY = (
    "±: half of the range. scatter: standard deviation from a straight line. drift: the line's slope, energy per time, "
    "and its standard error."
)


def _cells(row: OrderStatistics) -> list[str]:
    """A row of the table."""
    digits = 15 if row.scatter == 0 else max(4, min(16, 3 - math.floor(math.log10(row.scatter / (abs(row.mean) or 1)))))
    numbers = (row.deviation, row.scatter, row.drift, row.drift_error)
    return [str(row.order), f"{row.mean:.{digits}g}", *(f"{number:.2e}" for number in numbers)]


def _sentences(report: ShadowReport, bound: float | None) -> Iterator[str]:
    """The conclusions from the table, in sentences, with the step size for a bound of the energy's deviation."""
    best, most = report.best, report.largest_step
    yield f"Best order: {best.order}, scatter {best.scatter:.2g}; {LIMITS[report.limit]}."
    drift = f"{best.drift:.2g} ± {best.drift_error:.1g}"
    alone = f"(from the energy alone: ± {report.rows[0].drift_error:.1g})."
    if report.has_drift:
        change = best.drift * report.h * (report.states - 1)
        yield f"Drift: {drift} energy per time, {change:.2g} in all {alone}"
    else:
        limit = f"noise alone exceeds {best.drift_limit:.1g} in {CHANCE:.2%} of runs"
        yield f"No drift: {drift}; {limit} {alone}"
    if most is not None:
        part = report.h / most
        size = "small" if part <= COMFORTABLE else "moderate" if part <= LARGE else "large"
        where = "where order 4 is no steadier than the energy"
        yield f"Step: h = {report.h:g} is {size}, {part:.2g} of {most:.3g}, {where}."
    elif best.order > 2:
        yield "Step: no order above 4 is useful; the step is small."
    elif report.limit == "rounding":
        yield "Step: the energy changes by no more than rounding, so the step cannot be judged."
    else:
        yield "Step: no order is steadier than the energy; the step is too large, or forces are not smooth."
    if bound is not None:
        yield f"The energy stays within ±{bound:g} with steps up to h = {report.step_for(bound):.3g}."


SIZE = (17.0, 6.0)


def _draw_orders(report: ShadowReport, ax: Axes) -> None:
    """Range and scatter of each order."""
    orders = [row.order for row in report.rows]
    for name, marker in (("deviation", "o"), ("scatter", "s")):
        values = [getattr(row, name) or None for row in report.rows]
        ax.plot(orders, values, marker=marker, color=BLUE, mfc="white" if marker == "o" else BLUE, label=name)  # type: ignore[arg-type]
    ax.axvline(report.best.order, color=VERMILION, linewidth=1, zorder=0)
    ticks = orders[:: max(1, len(orders) // 6)]
    ax.set(xlabel="order", yscale="log", title=f"constant up to (best: order {report.best.order})", xticks=ticks)
    ax.legend(**OVER_DATA | {"loc": "upper right"})  # sizes fall


def _draw_times(report: ShadowReport, ax: Axes, k: int, color: str) -> None:
    """The energy of an order minus its mean: means of blocks, the range of all values, and the drift."""
    t, blocks = report.blocks()
    row = report.rows[k]
    means, least, largest = (blocks[k] - blocks[k, :, 0].mean()).T
    ax.fill_between(t, least, largest, color=color, alpha=0.25, linewidth=0)
    ax.plot(t, means, color=color, linewidth=0.8)
    middle = 0.5 * (t[0] + t[-1])
    ax.plot(t[[0, -1]], row.drift * (t[[0, -1]] - middle), color=BLACK, linewidth=1, linestyle="--")
    name = "energy" if row.order == 2 else f"order {row.order}"
    ax.set(xlabel=axis_label("t"), title=f"{name}, less its mean")
    ax.ticklabel_format(axis="y", scilimits=(-2, 3))


MOST_CURVES = 6
GAIN = 1.25
"""Least reduction of the scatter, as a factor, that makes a higher order useful."""
LOSS = 3.0
"""Ratio to the least scatter from which on an order is worse."""
ROUNDINGS = 4
"""Scatter that counts as rounding, in roundings of the energy."""


class ShadowReport:
    """The modified energies of a trajectory; made by `shadow_energy`.

    Attributes:
        label: The name of the trajectory.
        h: The step size.
        start: The time of the first state.
        states: The number of states.
        rows: For each order its statistics: `order`, `mean`, `deviation` (half the range), `scatter` (about a line),
            `gap` (half the range of the difference to the order before), `drift` with its
            `drift_error`, and `drift_limit`, which noise alone exceeds in 0.27 % of runs.
        values: The energies by order, if they were kept, at the times `times`.

    Example:
        >>> import bseries as bs
        >>> report = bs.shadow_energy(bs.integrate("stormer-verlet", bs.scene("pendulum"), h=0.1, steps=4000))
        >>> report.has_drift, report.limit
        (False, 'rounding')
        >>> print(f"{report.largest_step:.2f}, {report.step_for(1e-4):.4f}")
        1.44, 0.0320
    """

    def __init__(
        self,
        label: str,
        h: float,
        start: float,
        states: int,
        statistics: Statistics,
        offset: float,
        rounding: float,
        values: Mapping[int, np.ndarray] | None,
    ):
        self.label, self.h, self.start, self.states, self.values = label, h, start, states, values
        self._end = start + h * (states - 1)
        self.rows = tuple(row._replace(mean=row.mean + offset) for row in statistics.results(h))
        self._statistics = statistics
        self._rounding = rounding

    def __repr__(self) -> str:
        return (
            f"<ShadowReport of {self.label}: orders 2 to {self.rows[-1].order}, {self.states:,} states, h = {self.h:g}>"
        )

    @property
    def best(self) -> OrderStatistics:
        """The lowest order whose scatter is not much reduced by higher orders."""
        scatters = [row.scatter for row in self.rows]
        useful = (row for k, row in enumerate(self.rows) if row.scatter <= GAIN * min(scatters[k:]))
        return next(useful, self.rows[-1])

    @property
    def limit(self) -> str:
        """The reason why no order is better than the best one.

        ``rounding``: rounding of the numbers; ``order``: the largest order requested; ``step``: the step is large, so
        that higher orders have more scatter; ``slow``: changes that no order explains, such as accumulated roundings,
        or forces that jump.
        """
        best = self.best
        if best.scatter <= ROUNDINGS * self._rounding:
            return "rounding"
        if best.order == self.rows[-1].order:
            return "order"
        return "step" if self.rows[-1].scatter > LOSS * best.scatter else "slow"

    @property
    def noise_floor(self) -> float | None:
        """The least scatter of any order; None if higher orders may have less."""
        return None if self.limit == "order" else self.best.scatter

    @property
    def has_drift(self) -> bool:
        """Whether the drift of the best order exceeds its `drift_limit`, as by chance in 0.27 % of runs."""
        return abs(self.best.drift) > self.best.drift_limit

    @property
    def gaps(self) -> dict[int, float]:
        """Half the range of the difference of the orders 2k and 2k + 2 by power 2k of h, up to the best order."""
        best = self.best.order
        return {low.order: high.gap or 0.0 for low, high in pairwise(self.rows) if high.order <= best}

    @property
    def largest_step(self) -> float | None:
        """The step size at which order 4 would be no steadier than the energy; None if fewer orders are useful.

        The difference of orders 2 and 4 is proportional to h^2, that of orders 4 and 6 to h^4; at this step they would
        be equal: an empirical rule.
        """
        gaps = list(self.gaps.values())[:2]
        return self.h * (gaps[0] / gaps[1]) ** 0.5 if len(gaps) == 2 and gaps[1] > 0 else None

    def step_for(self, bound: float) -> float:
        """The largest step with which the energy would stay within ± a bound of the middle of its range.

        The deviation of the energy from its shadow is the sum of the gaps between orders, which are proportional to
        h^2, h^4, …. The result does not exceed `largest_step`, where this becomes invalid.

        Args:
            bound: The bound, in units of energy.

        Raises:
            SeriesError: The bound is not positive, or no higher order explains how the energy changes.
            IntegratorError: The bound is not a finite number.
        """
        limit = read_number(bound, "bound")
        if limit <= 0:
            raise SeriesError(f"bound must be a positive energy, but was {bound!r:.60}")
        # gap factor^power / limit = (rate factor)^power stays at most 1, for limits of any size
        rates = {power: gap ** (1 / power) / limit ** (1 / power) for power, gap in self.gaps.items() if gap}
        if not rates:
            raise SeriesError("bound must be on an energy whose changes a higher order explains, but none does")
        low, high = 0.0, 1 / max(rates.values())
        for _ in range(60):
            middle = 0.5 * (low + high)
            fits = sum((rate * middle) ** power for power, rate in rates.items()) <= 1
            low, high = (middle, high) if fits else (low, middle)
        most = self.largest_step
        return self.h * (low if most is None else min(low, most / self.h))

    @property
    def times(self) -> np.ndarray:
        """The times of `values`."""
        count = self._statistics.count
        return self.start + self.h * (np.arange(count) + (self.states - count) // 2)

    def blocks(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (blocks,), and mean, least and largest values there, (orders, blocks, 3), less the first value."""
        found, size = self._statistics.blocks(), self._statistics.size
        reach = (self.states - self._statistics.count) // 2
        return self.start + self.h * (reach + size * (np.arange(found.shape[1]) + 0.5) - 0.5), found

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON-ready data."""
        return {
            "schema": 1,
            "kind": "shadow",
            "trajectory": self.label,
            "h": self.h,
            "states": self.states,
            "t": [self.start, self._end],
            "best_order": self.best.order,
            "limit": self.limit,
            "noise_floor": self.noise_floor,
            "drift": {"value": self.best.drift, "error": self.best.drift_error, "significant": self.has_drift},
            "largest_step": self.largest_step,
            "rows": [row._asdict() for row in self.rows],
        }

    def save_plot(self, path: str | os.PathLike[str]) -> None:
        """Draw a figure of three panels: sizes by order, the energy and the best shadow energy over time.

        Args:
            path: A file with the extension ``.png``, ``.svg`` or ``.pdf``.

        Raises:
            SeriesError: The extension is another one, or the folder does not exist.
            IntegratorError: The file cannot be written, or matplotlib is missing.
        """
        check_picture(path)
        with print_style():
            figure = new_figure(SIZE)
            gains, energy, shadow = figure.subplots(1, 3)
            _draw_orders(self, gains)
            _draw_times(self, energy, 0, BLUE)
            _draw_times(self, shadow, self.rows.index(self.best), VERMILION)
            heading = f"{os.path.basename(self.label)}: {self.states:,} states, h = {self.h:g}"
            figure.suptitle(heading, fontsize="medium", parse_math=False)
        save_picture(path, figure)

    def plot(self, ax: Axes | None = None, *, orders: Sequence[int] | None = None, **style: Any) -> Axes:
        """Shadow energies over time: the distance of each order from its mean, the largest in each block of steps.

        Args:
            ax: The axes, which are returned; None for pyplot's current or new ones.
            orders: The orders; by default 2, which is the energy, to the best one, six at most.
            **style: Properties of the lines, such as ``color`` and ``lw``.

        Raises:
            SeriesError: An order is not in the report, or `ax` is no axes.
            ImportError: matplotlib is not installed.

        Example:
            >>> import bseries as bs
            >>> report = bs.shadow_energy(bs.integrate("stormer-verlet", "pendulum", h=0.1, steps=4000))
            >>> axes = report.plot()
            >>> [text.get_text() for text in axes.get_legend().get_texts()]
            ['order 2: energy', 'order 6', 'order 10', 'order 14', 'order 16']
        """
        known = [row.order for row in self.rows]
        for order in items(orders or (), "orders"):
            if order not in known:
                raise SeriesError(f"orders must be of {', '.join(map(str, known))}, but one was {order!r:.60}")
        useful = known[: known.index(self.best.order) + 1]
        step = -(-len(useful) // (MOST_CURVES - 1))
        chosen = sorted({*useful[::step], useful[-1]}) if orders is None else list(orders)
        t, blocks = self.blocks()
        curves = {}
        for order in chosen:
            rows = blocks[known.index(order)]
            strayed = np.abs(rows[:, 1:] - rows[:, :1].mean()).max(axis=1)
            name = "order 2: energy" if order == 2 else f"order {order}"
            curves[name] = np.where(strayed > 0, strayed, np.nan)
        with drawing(ax, SeriesError) as axes:
            draw_curves(axes, t, curves, **of_line(style, linestyle="-", linewidth=0.7))
            write_title(axes, f"{os.path.basename(self.label)}, h = {self.h:g}")
            axes.set(xlabel=axis_label("t"), ylabel="largest distance from the mean", yscale="log")
        return axes

    def to_table(self, bound: float | None = None) -> Table:
        """The report as a table, which is text, Markdown, CSV, LaTeX, HTML or JSON.

        Args:
            bound: A bound on the energy's deviation; the notes name the largest step that keeps it.
        """
        data = self.to_dict()
        if bound is not None:
            data["bound"] = {"energy": bound, "step": self.step_for(bound)}
        return Table(
            f"{self.label}: {self.states:,} states, h = {self.h:g}, t = {self.start:g} to {self._end:g}",
            [Column(heading, True) for heading in HEADINGS],
            list(map(_cells, self.rows)),
            [*_sentences(self, bound), "", KEY],
            data=lambda: data,
            items="rows",
            records=listed([(name, itemgetter(name)) for name in OrderStatistics._fields], data["rows"]),
        )

    __str__, _repr_html_, to_pandas = as_text, as_html, as_frame
