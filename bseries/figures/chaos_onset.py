"""Onset of chaos: the implicit midpoint rule on the pendulum, for a range of starts and step sizes."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import bseries as bs
from bseries.figures.helpers import fitted_factor
from foundation.plotting import BLUE, VERMILION, WHITE

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NUMBER = None
TITLE = "Pendulum: where the implicit midpoint rule becomes chaotic as the step size grows"
CAPTION = (
    "Beyond the lecture, on its figure 6, which states that chaos begins soon after h = 0.7. Blue starts are chaotic: "
    "two orbits that start a relative distance 10⁻¹⁰ apart are more than 0.01 apart at t = 700. For every h there is "
    "chaos in a layer at the separatrix, which is exponentially thin as h → 0. Its width in p is proportional to h⁻³ "
    "e^(−π²/h) at q = 0 (a). At the saddle point (b) the energy differs by p²/2, so the width is proportional to "
    "h^(−3/2) e^(−π²/2h); the factor is fitted, and the width is about 0.03 for h = 0.7. In (a) the layer is visible "
    "only from h ≈ 1 on."
)
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


class ChaosOnset(NamedTuple):
    """Data of the figure."""

    h: np.ndarray  # step sizes
    bottom: np.ndarray  # momenta of starts at q = 0
    saddle: np.ndarray  # momenta of starts at q = −π
    chaotic_bottom: np.ndarray  # whether they are chaotic, (step sizes, momenta)
    chaotic_saddle: np.ndarray  # the same for the starts at q = −π

    @property
    def width(self) -> np.ndarray:
        """The width of the layer in p at the saddle point, by step size: in logarithmic scale, without its islands."""
        import numpy as np

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
    import numpy as np

    return h**-1.5 * np.exp(-(np.pi**2) / 2 / h)


def numbers() -> ChaosOnset:
    """Pairs of orbits up to t = 700 for all step sizes and starts."""
    import numpy as np

    h, bottom, saddle = np.linspace(*STEP_SIZES), np.linspace(*BOTTOM), np.logspace(*SADDLE)
    starts = np.array([*((p, 0.0) for p in bottom), *((p, -np.pi) for p in saddle)])
    chaotic = np.array([is_chaotic(starts, size) for size in h])
    return ChaosOnset(h, bottom, saddle, chaotic[:, : len(bottom)], chaotic[:, len(bottom) :])


def is_chaotic(starts: np.ndarray, h: float, span: float = SPAN) -> np.ndarray:
    """Whether each start and a neighbouring one lead to distant ends."""
    import numpy as np

    steps, p = round(span / h), starts[:, 0]
    nearby = np.column_stack([p + NEARBY * np.where(p == 0, 1, p), starts[:, 1]])
    runs = bs.ensemble(
        METHOD,
        bs.scene("pendulum"),
        h=h,
        steps=steps,
        y0=np.vstack([starts, nearby]),
        observe=None,
        observe_every=steps,
        final=True,
    )
    first, second = np.split(runs.final, 2)
    return np.linalg.norm(first - second, axis=1) > APART


def columns(numbers: ChaosOnset) -> dict[str, np.ndarray]:
    """Whether the orbits are chaotic (1 or 0), by step size and start; and the widths by step size."""
    import numpy as np

    table = {"h": numbers.h, "width": numbers.width}
    for name, p, chaotic in (
        ("bottom", numbers.bottom, numbers.chaotic_bottom),
        ("saddle", numbers.saddle, numbers.chaotic_saddle),
    ):
        table |= {f"h_{name}": np.repeat(numbers.h, len(p)), f"p_{name}": np.tile(p, len(numbers.h))}
        table[f"chaotic_{name}"] = chaotic.ravel().astype(int)
    return table


def draw(numbers: ChaosOnset, figure: Figure) -> None:
    """Left the starts at q = 0, right those near the saddle point."""
    import numpy as np

    left, right = figure.subplots(1, 2)
    _draw_map(left, numbers.h, numbers.bottom, numbers.chaotic_bottom)
    separatrix = 2 / np.sqrt(1 - numbers.h**2 / 12)  # where H + h²H₃ is what it is at the saddle point
    left.plot(numbers.h, separatrix, "--", color=VERMILION, label="separatrix of $H + h^2H_3$")
    left.set(ylabel="momentum $p$ at $q = 0$", title="(a) starts at $q = 0$", ylim=BOTTOM[:2])
    _draw_map(right, numbers.h, numbers.saddle, numbers.chaotic_saddle)
    label = rf"fitted: ${numbers.coefficient:.0f}\,h^{{-3/2}}\,e^{{-\pi^2/2h}}$"
    right.plot(numbers.h, numbers.coefficient * asymptotic_width(numbers.h), "--", color=VERMILION, label=label)
    right.set(ylabel=r"momentum $p$ at $q = -\pi$", title=r"(b) starts above the saddle point, $q = -\pi$")
    right.set(yscale="log", ylim=(10 ** SADDLE[0], 10 ** (SADDLE[1] + 1)))  # leaves room for the legend
    for axes in (left, right):
        axes.set(xlabel="step size $h$", xlim=STEP_SIZES[:2])
        axes.legend(loc="upper left")


def _draw_map(axes: Axes, h: np.ndarray, p: np.ndarray, chaotic: np.ndarray) -> None:
    from matplotlib.colors import ListedColormap

    axes.pcolormesh(h, p, chaotic.T, cmap=ListedColormap([WHITE, BLUE]), shading="nearest", rasterized=True)
    axes.fill([], [], color=BLUE, label="chaotic")
