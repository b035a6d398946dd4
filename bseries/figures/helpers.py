"""Helpers that figures share: truncated modified equations as scenes, fits, words of captions, panels and axes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import bseries as bs
from foundation.extras import np
from foundation.printed_names import printed_name
from integrators.methods.catalogue.registry import as_method

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from integrators import Method, Scene


def truncated_scene(method: Method | str, scene: Scene, terms: int, h: float) -> Scene:
    """The truncated modified equation y' = f(y) + h f_2(y) + … + h^(N−1) f_N(y) for one step size, as a scene.

    Example:
        >>> truncated_scene("explicit-euler", bs.scene("riccati"), 3, 0.1).field
        (3*y**4/200 - y**3/10 + y**2,)
    """
    import sympy

    method = as_method(method)
    f, step = bs.modified_field(method, scene, terms), sympy.Symbol("h")
    field = [sum(step**k * f.symbolic(k)[i] for k in range(terms)) for i in range(scene.dimension)]
    return bs.Scene(
        dict.fromkeys(scene.variables, 1),
        field=dict(zip(scene.variables, field, strict=True)),
        parameters={"h": h},
        name=f"{method.name} on {scene.name}, {terms} terms",
    )


def power_exponent(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The exponent of x in y: the slope of a line fitted in logarithmic scales, for each column of y.

    Example:
        >>> import numpy as np
        >>> round(float(power_exponent(np.array([1.0, 2.0, 4.0]), np.array([3.0, 12.0, 48.0]))), 12)
        2.0
    """
    return np.polyfit(np.log(x), np.log(y), 1)[0]


def value_at(place: float, x: np.ndarray, y: np.ndarray) -> Any:
    """The value at a place of the polynomial that interpolates y as a function of x."""
    return np.polyval(np.polyfit(x - place, y, len(x) - 1), 0)


def growth_exponent(t: np.ndarray, values: np.ndarray, first: float, last: float, points: int) -> float:
    """The exponent of t in values, fitted at times between two, equidistant in logarithmic scale."""
    times = np.geomspace(first, last, points)
    return float(power_exponent(times, np.interp(times, t, values)))


def fitted_factor(values: np.ndarray, shape: np.ndarray) -> float:
    """The factor c of values ≈ c · shape, fitted in logarithmic scale."""
    return float(np.exp(np.mean(np.log(values / shape))))


def logarithmic_indices(count: int, points: int) -> np.ndarray:
    """Indices from 1 to count − 1, about equidistant in logarithmic scale."""
    return np.unique(np.geomspace(1, count - 1, points).astype(int))


def power(variable: str, exponent: float) -> str:
    """A fitted power for captions.

    Example:
        >>> power("t", 1.9249), power("t", -0.001)
        ('t^1.92', 't^0.00')
    """
    return f"{variable}^{exponent:.2f}".replace("-0.00", "0.00")


def superscript(number: int) -> str:
    """A whole number as a superscript in captions.

    Example:
        >>> "h" + superscript(4), "10" + superscript(-6)
        ('h⁴', '10⁻⁶')
    """
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def subscript(number: int) -> str:
    """A whole number as a subscript in captions."""
    return str(number).translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))


def power_of_h(exponent: int) -> str:
    """h, h², h³, … in captions."""
    return "h" + (superscript(exponent) if exponent > 1 else "")


def scientific(value: float, digits: int = 3) -> str:
    """A number for captions, with a power of ten where it is small.

    Example:
        >>> scientific(0.000123456), scientific(-1.5), scientific(2210), scientific(0.0)
        ('1.23·10⁻⁴', '−1.5', '2.21·10³', '0')
    """
    if not value or 1e-3 <= abs(value) < 10**digits:
        return f"{value:.{digits}g}".replace("-", "−")
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{superscript(int(exponent))}".replace("-", "−")


def state(values: Iterable[float]) -> str:
    """A state in captions and legends, with −π as such.

    Example:
        >>> from math import pi
        >>> state((2.5, 0.0)), state((1.5, -pi))
        ('(2.5, 0)', '(1.5, −π)')
    """
    from math import pi

    names = {pi: "π", -pi: "−π"}
    return f"({', '.join(names.get(value, f'{value:g}'.replace('-', '−')) for value in values)})"


def listed(words: Sequence[str]) -> str:
    """Words in a sentence.

    Example:
        >>> listed(["1"]), listed(["1", "2", "3"])
        ('1', '1, 2 and 3')
    """
    return " and ".join([*filter(None, [", ".join(words[:-1])]), words[-1]])


def name_of(method: Method) -> str:
    """The name of a method in captions and legends."""
    return printed_name(method.name or "method")


def short_names(methods: Sequence[Method]) -> list[str]:
    """The names of methods in titles and legends, without what is in brackets as long as they differ.

    Example:
        >>> short_names([bs.method("stormer-verlet"), bs.method("symplectic-euler-p")])
        ['Störmer–Verlet', 'symplectic Euler']
    """
    names = [name_of(method) for method in methods]
    short = [name.partition(" (")[0] for name in names]
    return short if len(set(short)) == len(short) else names


def column_names(methods: Sequence[Method]) -> list[str]:
    """The names of methods in names of columns, all different.

    Example:
        >>> column_names([bs.method("symplectic-euler-p"), bs.method("rk4")])
        ['symplectic_euler_p', 'rk4']
        >>> column_names([bs.method("rk4"), bs.method("rk4")])
        ['rk4_1', 'rk4_2']
    """
    names = [(method.name or f"method{k}").replace("-", "_") for k, method in enumerate(methods, 1)]
    return names if len(set(names)) == len(names) else [f"{name}_{k}" for k, name in enumerate(names, 1)]


def label_panels(panels: Iterable[Axes], titles: Iterable[str]) -> None:
    """Titles of panels, which begin with (a), (b), …"""
    for letter, axes, title in zip("abcdefghi", panels, titles, strict=False):
        axes.set_title(f"({letter}) {title}")


def reduced_angle(q: Any) -> Any:
    """An angle modulo 2π, from −π on."""
    return np.remainder(q + np.pi, 2 * np.pi) - np.pi


def set_angle_axis(axes: Axes) -> None:
    """Let the horizontal axis show an angle from −π to π."""
    from math import pi

    axes.set_xlim(-pi, pi)
    axes.set_xticks([-pi, 0, pi], [r"$-\pi$", "0", r"$\pi$"])
