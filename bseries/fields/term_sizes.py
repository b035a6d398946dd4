"""Sizes of the terms of series on scenes: where to truncate, and the warning beyond it.

In general a modified equation diverges: the terms h^k f_{k+1}(y) shrink up to some power of h and grow beyond it, and
the smallest term is about the best accuracy that any truncation has.
"""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bseries.exceptions import SeriesError
from bseries.fields.scene_trees import SeriesOnScene
from bseries_base.diagrams import draw_legend, of_line
from bseries_base.errors import warn_user
from bseries_base.plotting import BLUE, VERMILION, drawing
from integrators.runs.titles import write_title

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_CHECKED = 32
"""States of one call that are looked at, spread evenly over all."""
NEARBY_POINTS = 4
NEARBY = 2.0**-50  # relative distance of nearby points, whose values separate rounding errors from terms


SHRINKING = 0.7
"""Largest ratio of two terms to the two before them in a series that still shrinks. Terms grow like factorials, so that
a ratio nearer to 1 is that of the optimum, and the next two terms are larger. In 164 steps of eleven methods from large
to small this finds 199 of 251 orders whose error is three times that of a lower one, and a ratio of 1 finds 181."""


class TruncationWarning(UserWarning):
    """Warning that the last terms of a truncated series make it worse."""


class Reach(NamedTuple):
    """Sizes of the terms of a field at a point, with the optimal truncation and the error.

    Attributes:
        label: The name of the field.
        h: The step size.
        norms: The norms of f_{k+1}(y), without h^k; 0 for pure rounding errors.
        spectral_radius: That of the matrix of a linear scene; None for other scenes, or without a method.
        radius: The radius of convergence on a linear scene; None if `spectral_radius` is.

    Example:
        >>> import bseries as bs
        >>> f = bs.modified_field(bs.method("explicit-euler"), bs.scene("riccati"), 6)
        >>> found = bs.fields.reach(f, [1.0], 0.25)
        >>> found.optimal_order, found.is_beyond, round(found.largest_step, 3)
        (6, False, 0.451)
    """

    label: str
    h: float
    norms: tuple[float, ...]
    spectral_radius: float | None = None
    radius: float | None = None

    @property
    def order(self) -> int:
        """The number N of terms, with the powers h^0 … h^(N−1)."""
        return len(self.norms)

    @property
    def sizes(self) -> tuple[float, ...]:
        """The norms of the terms, h^k times `norms`."""
        powers = itertools.accumulate(self.norms[1:], lambda power, _: power * abs(self.h), initial=1.0)
        return tuple(norm and norm * power for norm, power in zip(self.norms, powers, strict=True))

    @property
    def powers(self) -> tuple[int, ...]:
        """The powers of h with nonzero terms."""
        return tuple(k for k, norm in enumerate(self.norms) if norm)

    @property
    def optimal_power(self) -> int:
        """The power of h of the smallest nonzero term (0 without one), where the series is best truncated.

        Each term is taken together with the one before, and compared by the larger of both: a single term may be small
        by chance or by construction, and is not the optimum if later terms keep shrinking. The last pair counts that is
        no larger than any pair before, and smaller than those it has no term in common with by the factor `SHRINKING`.
        """
        sizes = [self.sizes[k] for k in self.powers]
        pairs = [(max(pair), pair[1]) for pair in zip([0.0, *sizes], sizes, strict=False)]
        best = 0
        for i, pair in enumerate(pairs):
            if pair <= min(pairs[: i + 1]) and all(
                pair[0] <= SHRINKING * before for before, _ in pairs[: max(i - 1, 0)]
            ):
                best = i
        return self.powers[best] if pairs else 0

    @property
    def optimal_order(self) -> int:
        """The order of the best truncation; it includes the term with `optimal_power`."""
        return self.optimal_power + 1

    @property
    def converges(self) -> bool | None:
        """Whether the series converges: h times the spectral radius is below the radius; None if unknown."""
        if self.spectral_radius is None or self.radius is None:
            return None
        return abs(self.h) * self.spectral_radius < self.radius

    @property
    def is_beyond(self) -> bool:
        """Whether the order exceeds the optimum, so that the last terms make the field worse."""
        if self.converges is not None:
            return not self.converges
        return bool(self.powers) and self.powers[-1] > self.optimal_power

    @property
    def error(self) -> float | None:
        """Estimated error: the first omitted term, extrapolated from the last two; None for f alone."""
        if len(self.powers) < 2:
            return None
        before, last = self.powers[-2:]
        ratio = abs(self.h) * (self.norms[last] / self.norms[before]) ** (1 / (last - before))
        # Symmetric methods have every other term only; the gap after f itself comes from the order of the method.
        step = last - before if before else 1
        return math.prod([self.sizes[last], *[ratio] * step])

    @property
    def best_error(self) -> float | None:
        """The size of the optimal term, about the error of the best truncation; None for f alone."""
        return self.sizes[self.optimal_power] if len(self.powers) > 1 else None

    @property
    def largest_step(self) -> float:
        """The largest step size for which the order does not exceed the optimum at this point."""
        if self.spectral_radius is not None and self.radius is not None:
            return self.radius / self.spectral_radius if self.spectral_radius else math.inf
        powers = self.powers
        # Stopping at k is better if one of the last two terms, u, exceeds the term k and the one before it, times
        # `SHRINKING` unless one of these is u: h^u ‖f_u‖ > h^k ‖f_k‖ for both.
        return min(
            (
                max((share * self.norms[k] / self.norms[u]) ** (1 / (u - k)) for k in powers[max(i - 1, 0) : i + 1])
                for i in range(len(powers) - 1)
                for share in [SHRINKING if i < len(powers) - 2 else 1.0]
                for u in powers[max(i + 1, len(powers) - 2) :]
            ),
            default=math.inf,
        )

    def plot(self, ax: Axes | None = None, **style: Any) -> Axes:
        """The sizes of the nonzero terms against the power of h, with the optimal truncation.

        Args:
            ax: The axes, which are returned; None for pyplot's current or new ones.
            **style: Properties of the line of the sizes, such as ``color`` and ``lw``.

        Raises:
            SeriesError: `ax` is no axes.
            ImportError: matplotlib is not installed.

        Example:
            >>> import bseries as bs
            >>> field = bs.modified_field("explicit-euler", "riccati", 12)
            >>> axes = bs.fields.reach(field, [1.0], 0.25).plot()
            >>> axes.get_ylabel(), len(axes.lines[0].get_xdata())
            ('size of the term with $h^k$', 12)
        """
        sizes = [self.sizes[k] for k in self.powers]
        with drawing(ax, SeriesError) as axes:
            axes.plot(self.powers, sizes, **of_line(style, color=BLUE, marker="o", label="terms"))
            if self.powers:
                best = self.optimal_power
                ring = {"color": VERMILION, "marker": "D", "markersize": 6, "mfc": "none", "linestyle": "none"}
                axes.plot([best], [self.sizes[best]], label=f"optimal, k = {best}", **ring)
                draw_legend(axes)
            axes.locator_params(axis="x", integer=True)
            axes.set(xlabel="k", ylabel="size of the term with $h^k$", yscale="log")
            write_title(axes, f"{self.label}, h = {self.h:g}")
        return axes

    def __str__(self) -> str:
        rows = ["power   size"]
        for k, size in enumerate(self.sizes):
            mark = "   optimal" if self.powers and k == self.optimal_power else ""
            rows.append(f"h^{k:<5} {size:.3g}{mark}")
        if self.converges is not None:
            place = "inside: the series converges" if self.converges else "outside: the series diverges"
            product = abs(self.h) * (self.spectral_radius or 0.0)
            end = f"h times the spectral radius is {product:.6g}, the radius {self.radius:.6g}, {place}"
        else:
            place = "beyond the optimum" if self.is_beyond else "not beyond the optimum"
            error = "unknown" if self.error is None else f"about {self.error:.1e}"
            end = f"order {self.order}: {place}, next term {error}; largest h for it: {self.largest_step:.3g}"
        return "\n".join([f"{self.label}, h = {self.h:g}", *rows, end])

    def to_dict(self) -> dict[str, Any]:
        """The result as plain data; None stands for an infinite or unknown value."""
        return {
            "schema": 1,
            "kind": "reach",
            "series": self.label,
            "order": self.order,
            "h": self.h,
            "terms": [{"power": k, "size": size} for k, size in enumerate(self.sizes)],
            **{
                name: getattr(self, name)
                for name in ("optimal_power", "optimal_order", "is_beyond", "error", "best_error")
            },
            "largest_step": self.largest_step if math.isfinite(self.largest_step) else None,
            "spectral_radius": self.spectral_radius,
            "radius": self.radius if self.radius is not None and math.isfinite(self.radius) else None,
            "converges": self.converges,
        }


def warn_beyond_reach(f: SeriesOnScene, states: np.ndarray, h: float, label: str) -> None:
    """Warn that a series is evaluated beyond its optimum at some rows of `states`, of which a few are looked at."""
    chosen = states[:: max(1, -(-len(states) // MOST_CHECKED))]
    found = [Reach(label, h, norms) for norms in term_norms(f, chosen) if all(map(math.isfinite, norms))]
    worst = min((each for each in found if each.is_beyond), key=lambda each: each.largest_step, default=None)
    if worst is not None:
        warn_user(f"{label} {too_long(worst)}", TruncationWarning)


def too_long(found: Reach) -> str:
    """What is wrong with an order beyond the optimum."""
    last, far = found.optimal_power, found.largest_step
    return (
        f"is worse at order {found.order} than at order {last + 1}: for h = {found.h:g} its terms no longer "
        f"shrink beyond h^{last}; order {found.order} needs h ≤ {far:.3g}"
    )


def term_norms(f: SeriesOnScene, states: np.ndarray) -> list[tuple[float, ...]]:
    """Euclidean norms of the terms at rows of states: 0 without coefficients, or if they vary by their size nearby."""
    shifts = np.random.default_rng(f.dimension).uniform(-NEARBY, NEARBY, (NEARBY_POINTS, f.dimension))
    sizes = np.abs(states).max(axis=1)[:, None, None]
    nearby = states[:, None, :] + np.where(sizes > 0, sizes, 1.0) * shifts
    points = np.concatenate([states[:, None, :], nearby], axis=1)
    values = f.terms(points.reshape(-1, f.dimension).T).reshape(f.order, f.dimension, *points.shape[:2])
    here = values[..., 0]
    norms = _lengths(here)
    with np.errstate(invalid="ignore"):  # infinite terms are refused or left out where norms are used
        changes = _lengths(values[..., 1:] - here[..., None]).max(axis=-1)
    series = f.series
    present = [not all(map(series.is_zero_at, series.table.ids(n))) for n in range(1, f.order + 1)]
    kept = np.where(np.array(present)[:, None] & ~(changes >= norms / 2), norms, 0.0)
    return list(map(tuple, kept.T.tolist()))


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """Euclidean norms along axis 1; entries are scaled, so that squares neither overflow nor underflow."""
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    scale = np.where((largest > 0) & np.isfinite(largest), largest, 1.0)
    with np.errstate(over="ignore"):
        return np.linalg.norm(vectors / scale, axis=1) * scale[:, 0]
