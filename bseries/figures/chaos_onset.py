"""Onset of chaos: the implicit midpoint rule on the pendulum, for a range of starts and step sizes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import fitted_factor, label_panels, reduced_angle, set_angle_axis
from bseries.figures.options import read_number
from bseries.figures.words import scientific
from bseries_base.extras import np
from bseries_base.plotting import BLACK, BLUE, ORANGE, SKY, WHITE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from integrators import Method

NUMBER = None
TITLE = "Pendulum: where the implicit midpoint rule becomes chaotic as the step size grows"
SIZE = (16.0, 8.0)

METHOD = "implicit-midpoint"
SPAN = 700.0
NEARBY, APART = 1e-10, 0.01
"""Relative distance of two starts, and the distance at the end from which on they are chaotic."""
STEP_SIZES = (0.4, 1.8, 36)
"""The least, the largest, and their number."""
BOTTOM = (1.5, 3.0, 46)
"""Momenta at q = 0, in the same way; the separatrix of the exact flow is at 2."""
SADDLE = (-4.0, 0.0, 49)
"""Decimal logarithms of momenta at q = −π; the separatrix is at p = 0."""
FRAMES, ORBIT = 106, 800
"""Frames of the animation, and steps of its orbits."""
MOVING = (0.3, 3.6, 34)
"""Momenta of these orbits at q = 0."""
HEIGHTS = (-2.8, 4.2)
"""Least and largest momentum in the animation."""


class ChaosOnset(NamedTuple):
    """Data of the figure."""

    span: float  # length of the runs
    h: np.ndarray  # step sizes
    bottom: np.ndarray  # momenta of starts at q = 0
    saddle: np.ndarray  # momenta of starts at q = −π
    chaotic_bottom: np.ndarray  # whether they are chaotic, (step sizes, momenta)
    chaotic_saddle: np.ndarray  # the same for the starts at q = −π

    @property
    def width(self) -> np.ndarray:
        """The width of the layer in p at the saddle point, by step size: in logarithmic scale, without its islands."""
        exponents = np.log10(self.saddle)
        return 10 ** (exponents[0] + self.chaotic_saddle.mean(axis=1) * (exponents[-1] - exponents[0]))

    @property
    def coefficient(self) -> float:
        """The factor c of the width c h^(−3/2) e^(−π²/2h)."""
        return fitted_factor(self.width, asymptotic_width(self.h))


def asymptotic_width(h: np.ndarray) -> np.ndarray:
    """The width of the layer in p at the saddle point as h → 0, up to a factor.

    The solution on the separatrix has its singularities at t = ±iπ/2, so that stable and unstable curves intersect at
    q = 0 under an angle proportional to h⁻³ e^(−π²/h). This is the width of the layer in energy, which is p²/2 at the
    saddle point.

    References:
        V. F. Lazutkin, Splitting of separatrices for the Chirikov standard map, J. Math. Sci. 128 (2005) 2687–2705
        (Russian original 1984); the power −3 of this method is measured.
    """
    return h**-1.5 * np.exp(-(np.pi**2) / 2 / h)


def numbers(*, span: object = SPAN) -> ChaosOnset:
    """Pairs of orbits of the implicit midpoint rule for all step sizes and starts."""
    span = read_number(span, "span", 50, 5000)
    h, bottom, saddle = np.linspace(*STEP_SIZES), np.linspace(*BOTTOM), np.logspace(*SADDLE)
    starts = np.array([*((p, 0.0) for p in bottom), *((p, -np.pi) for p in saddle)])
    chaotic = np.array([is_chaotic(starts, size, span) for size in h])
    return ChaosOnset(span, h, bottom, saddle, chaotic[:, : len(bottom)], chaotic[:, len(bottom) :])


def is_chaotic(starts: np.ndarray, h: float, span: float = SPAN, method: Method | str = METHOD) -> np.ndarray:
    """Whether each start and a neighbouring one lead to distant ends."""
    steps, p = round(span / h), starts[:, 0]
    nearby = np.column_stack([p + NEARBY * np.where(p == 0, 1, p), starts[:, 1]])
    y0 = np.vstack([starts, nearby])
    ends = bs.ensemble(method, "pendulum", h=h, steps=steps, y0=y0, observe=None, observe_every=steps, final=True).final
    first, second = np.split(ends, 2)
    return np.linalg.norm(first - second, axis=1) > APART


def columns(numbers: ChaosOnset) -> dict[str, np.ndarray]:
    """Whether the orbits are chaotic (1 or 0), by step size and start; and the widths by step size."""
    table = {"h": numbers.h, "width": numbers.width}
    starts = (("bottom", numbers.bottom, numbers.chaotic_bottom), ("saddle", numbers.saddle, numbers.chaotic_saddle))
    for name, p, chaotic in starts:
        table |= {f"h_{name}": np.repeat(numbers.h, len(p)), f"p_{name}": np.tile(p, len(numbers.h))}
        table[f"chaotic_{name}"] = chaotic.ravel().astype(int)
    return table


def caption(numbers: ChaosOnset) -> str:
    """What chaotic means, and the width of the layer."""
    width = float(np.interp(0.7, numbers.h, numbers.width))
    distance = scientific(NEARBY, 1)
    first = numbers.h[numbers.chaotic_bottom.any(axis=1)]
    seen = f"visible only from h = {first[0]:.2g} on" if len(first) else "not visible"
    return (
        "Beyond the lecture, on its figure 6, which states that chaos begins soon after h = 0.7: starts of the "
        "implicit midpoint rule on the pendulum. Starts in the coloured regions are chaotic: two orbits that start a "
        f"relative distance {distance} apart are more than {APART:g} apart at t = {numbers.span:g}. "
        "Chaos is expected for every h, in a layer at the separatrix that is exponentially thin as h → 0. Its width in "
        "p is like h⁻³ e^(−π²/h) at q = 0 (a), as measured. At the saddle point (b) the energy differs by p²/2, so "
        "that the width is like h^(−3/2) e^(−π²/2h); the factor is fitted, and the width found is "
        f"{scientific(width, 2)} for h = 0.7. In (a) the layer is {seen}."
    )


def draw(numbers: ChaosOnset, figure: Figure) -> None:
    """Left the starts at q = 0, right those near the saddle point."""
    left, right = figure.subplots(1, 2)
    label_panels((left, right), ("starts at $q = 0$", r"starts above the saddle point, $q = -\pi$"))
    _draw_bottom(left, numbers)
    _draw_map(right, numbers.h, numbers.saddle, numbers.chaotic_saddle)
    label = rf"fitted: ${numbers.coefficient:.0f}\,h^{{-3/2}}\,e^{{-\pi^2/2h}}$"
    right.plot(numbers.h, numbers.coefficient * asymptotic_width(numbers.h), "--", color=BLACK, label=label)
    right.set(ylabel=r"momentum $p$ at $q = -\pi$", xlabel="step size $h$", xlim=STEP_SIZES[:2])
    right.set(yscale="log", ylim=(10 ** SADDLE[0], 10 ** (SADDLE[1] + 1)))  # leaves room for the legend
    for axes in (left, right):
        axes.legend(loc="upper left")


def _draw_bottom(axes: Axes, numbers: ChaosOnset) -> None:
    """The starts at q = 0, and the separatrix of the modified Hamiltonian."""
    _draw_map(axes, numbers.h, numbers.bottom, numbers.chaotic_bottom)
    separatrix = 2 / np.sqrt(1 - numbers.h**2 / 12)  # where H + h²H₃ is what it is at the saddle point
    axes.plot(numbers.h, separatrix, "--", color=BLACK, label="separatrix of $H + h^2H_3$")
    axes.set(ylabel="momentum $p$ at $q = 0$", xlabel="step size $h$", xlim=STEP_SIZES[:2], ylim=BOTTOM[:2])


def _draw_map(axes: Axes, h: np.ndarray, p: np.ndarray, chaotic: np.ndarray) -> None:
    """The starts by step size, chaotic ones coloured."""
    from matplotlib.colors import ListedColormap

    axes.pcolormesh(h, p, chaotic.T, cmap=ListedColormap([WHITE, SKY]), shading="nearest", rasterized=True)
    axes.fill([], [], color=SKY, label="chaotic")


def frames(numbers: ChaosOnset, figure: Figure) -> Iterator[tuple[int, int]]:
    """Orbits while the step size grows, chaotic ones dark; and where the step size is in the map of starts."""
    left, right = figure.subplots(1, 2, width_ratios=(1.25, 1))
    _draw_bottom(right, numbers)
    right.legend(loc="upper left")
    marker = right.axvline(numbers.h[0], color=BLACK, linewidth=1.2)
    p = np.linspace(*MOVING)
    dots = [left.plot([], [], ".", markersize=1.4, markeredgewidth=0)[0] for _ in p]
    left.set(xlabel="angle $q$", ylabel="momentum $p$", ylim=HEIGHTS)
    set_angle_axis(left)
    sizes = np.linspace(*STEP_SIZES[:2], FRAMES)
    for frame, h in enumerate(sizes, 1):
        chaotic = is_chaotic(np.column_stack([p, 0 * p]), h, numbers.span)
        for start, dot, is_dark in zip(p, dots, chaotic, strict=True):
            y = bs.integrate(METHOD, bs.scene("pendulum"), h=h, steps=ORBIT, y0=[start, 0.0]).y
            dot.set_data(reduced_angle(y[1]), y[0])
            dot.set(color=BLUE if is_dark else ORANGE)
        label_panels((left, right), (f"orbits, $h = {h:.3f}$; chaotic ones are dark", "starts at $q = 0$"))
        marker.set_xdata([h, h])
        yield frame, len(sizes)
