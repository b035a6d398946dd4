"""Stability functions: exact rational functions of z, with evaluation, poles, and text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cached_property
from numbers import Rational
from typing import TYPE_CHECKING, Any, Self, SupportsIndex

from bseries.analysis.stability import field_elements as field
from bseries.analysis.stability.field_elements import Coefficients, Element, Inexact, Vector
from bseries_base.diagrams import draw_region
from bseries_base.errors import shorten
from bseries_base.numbers import latex_number
from bseries_base.plotting import BLACK, drawing
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.core.immutable import ImmutableValue
from integrators.exact.arguments import read_window
from integrators.exact.entries import FLOAT_PRECISION, is_sympy, read_entry, round_entry, symbol_names
from integrators.exact.expressions import format_number
from integrators.exact.polynomials import divide, evaluate, from_flint, trim

if TYPE_CHECKING:
    import numpy as np
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from integrators.exact.entries import Entry

POINTS = 400
"""Of a plot, in each direction."""
SPACE = 1.3
"""Size of a plot, relative to what it shows."""
NARROW = 4.0
"""Ratio of sides from which on a plot stretches the shorter one."""


class StabilityFunction(ImmutableValue):
    """Stability function R(z) = P(z)/Q(z) of a method: y_1 = R(hλ) y_0 for y' = λy.

    Numerator and denominator have no common factor, and Q(0) = 1. Approximate common factors of polynomials in floats
    are kept.

    Args:
        numerator: the coefficients of 1, z, z², …; any entries that a tableau may have.
        denominator: the same for the denominator.

    Raises:
        IntegratorError: an entry is no number or formula, or the denominator vanishes at 0.

    Example:
        >>> import bseries as bs
        >>> from fractions import Fraction
        >>> R = bs.stability.StabilityFunction([1, "1/2"], [1, "-1/2"])
        >>> print(R)
        (1 + z/2)/(1 - z/2)
        >>> R(Fraction(1)), R.at_infinity, R.poles
        (Fraction(3, 1), Fraction(-1, 1), ((2+0j),))

    References:
        Hairer, Wanner, *Solving Ordinary Differential Equations II*, §IV.3.
    """

    # P and Q as elements of one field, see `bseries.analysis.stability.field_elements`
    p: Coefficients
    q: Coefficients
    floating: bool
    digits: int | None

    def __init__(self, numerator: Sequence[Entry | int | str], denominator: Sequence[Entry | int | str] = (1,)) -> None:
        above = [read_entry(value, f"numerator[{k}]") for k, value in enumerate(items(numerator, "numerator"))]
        below = [read_entry(value, f"denominator[{k}]") for k, value in enumerate(items(denominator, "denominator"))]
        entries = [*above, *below]
        if floating := any(isinstance(value, float) for value in entries):
            if symbol_names(entries):
                raise IntegratorError("numerator and denominator must not mix floats and symbols: write fractions")
            entries = list(map(round_entry, entries))
        elements = field.to_elements(entries, FLOAT_PRECISION if floating else 0)
        p, q = elements[: len(above)], elements[len(above) :]
        if not q or not q[0]:
            raise IntegratorError(f"denominator must not vanish at z = 0, but was {shorten(str(denominator))}")
        self._set(p, q, floating=floating, digits=None)

    @classmethod
    def from_elements(cls, p: Vector, q: Vector, *, floating: bool, digits: int | None) -> Self:
        """Construct the function from coefficients in one field (see `field_elements`)."""
        function = cls.__new__(cls)
        function._set(p, q, floating=floating, digits=digits)
        return function

    def _set(self, p: Vector, q: Vector, *, floating: bool, digits: int | None) -> None:
        p, q = trim(p), trim(q)
        if p and all(map(field.has_exact_zero_test, (*p, *q))):
            common = field.monic_gcd(p, q)
            p, q = divide(p, common)[0], divide(q, common)[0]
        if q[0] != 1:
            p, q = tuple(a / q[0] for a in p), (Fraction(1), *(a / q[0] for a in q[1:]))
        self.__dict__.update(p=p, q=q, floating=floating, digits=digits)

    @cached_property
    def numerator(self) -> tuple[Entry, ...]:
        """The coefficients of 1, z, z², … in the numerator."""
        return tuple(field.from_element(a, floating=self.floating) for a in self.p)

    @cached_property
    def denominator(self) -> tuple[Entry, ...]:
        """The coefficients of 1, z, z², … in the denominator; the first is 1."""
        return tuple(field.from_element(a, floating=self.floating) for a in self.q)

    @property
    def _data(self) -> tuple[object, ...]:
        return self.numerator, self.denominator, self.floating, self.digits

    def __reduce_ex__(self, protocol: SupportsIndex) -> str | tuple[object, ...]:
        """Pickle exact functions by their entries: polynomials of flint and SymPy's fractions cannot be pickled."""
        if self.is_inexact:
            return super().__reduce_ex__(protocol)
        return StabilityFunction, (self.numerator, self.denominator)

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the symbols in the coefficients, sorted."""
        return symbol_names((*self.numerator, *self.denominator))

    @cached_property
    def has_signs(self) -> bool:
        """Whether signs are decided: no symbols, and no roots of too high a degree."""
        return all(map(field.has_sign, (*self.p, *self.q)))

    @property
    def is_inexact(self) -> bool:
        """Whether the coefficients come from decimals or floats."""
        return any(isinstance(a, Inexact) for a in (*self.p, *self.q))

    @property
    def at_infinity(self) -> Entry:
        """The limit of R(z) for z → ∞; ``inf`` where R grows without bound."""
        if len(self.p) != len(self.q):
            return math.inf if len(self.p) > len(self.q) else Fraction(0)
        return field.from_element(self.p[-1] / self.q[-1], floating=self.floating)

    @cached_property
    def poles(self) -> tuple[complex, ...]:
        """The poles in double precision, repeated by multiplicity, sorted by real and then imaginary part."""
        if not self.has_signs:
            raise IntegratorError(
                f"coefficients must be numbers before poles are found, but Q(z) was {shorten(polynomial_text(self.q))}"
            )
        factors = enumerate(field.squarefree_factors(tuple(map(field.midpoint, self.q))), 1)
        found = [root for times, factor in factors for root in field.roots(factor) * times]
        places = [
            [field.nearest_float(from_flint(part.mid().fmpq())) for part in (root.real, root.imag)] for root in found
        ]
        return tuple(complex(*place) for place in sorted(places))

    def __call__(self, z: Any) -> Any:
        """The value R(z).

        Args:
            z: an integer or fraction, with an exact value if the coefficients are exact; a real or complex number or an
                array, evaluated in double precision; or a SymPy expression.

        Returns:
            A number, an array of the shape of `z`, or a SymPy expression.

        Raises:
            IntegratorError: `z` is a pole or no number, or the coefficients have symbols and `z` is a float.
        """
        if is_sympy(z):
            above, below = (sum(a * z**k for k, a in enumerate(p)) for p in (self.numerator, self.denominator))
            return above / below
        if isinstance(z, Rational):
            x = Fraction(int(z.numerator), int(z.denominator))
            below = evaluate(self.q, x)
            if not below:
                raise IntegratorError(f"z must not be a pole, but was {shorten(str(x))}")
            return field.from_element(evaluate(self.p, x) / below, floating=self.floating)
        if self.parameters:
            raise IntegratorError(
                f"z must be exact while {', '.join(self.parameters)} have no values, but was {z!r:.60}"
            )
        return self._in_floats(z)

    def _in_floats(self, z: ArrayLike) -> complex | np.ndarray:
        """Values at a number or an array of numbers; in powers of 1/z for |z| > 1, to avoid overflow."""
        import numpy as np
        from numpy.polynomial.polynomial import polyval

        p, q = self._float_coefficients()
        try:
            points = np.asarray(z) * 1.0
        except (TypeError, ValueError):
            points = np.asarray(None)
        if points.dtype.kind not in "fc":
            raise IntegratorError(f"z must be a number or an array of numbers, but was {shorten(repr(z))}")
        with np.errstate(all="ignore"):
            near, inverse, powers = abs(points) <= 1, 1 / points, points ** float(len(p) - len(q))
            above, below = (np.where(near, polyval(points, a), polyval(inverse, a[::-1])) for a in (p, q))
            values = np.where(near, 1.0, powers) * (above / below)
        if values.ndim:
            return values
        if not below:
            raise IntegratorError(f"z must not be a pole, but was {z!r}")
        return values.item()

    def _float_coefficients(self) -> list[list[float]]:
        """The coefficients of numerator and denominator in double precision."""
        return [
            [round_entry(a) if is_sympy(a) else field.nearest_float(a) for a in values] or [0.0]
            for values in (self.numerator, self.denominator)
        ]

    def _logarithms(self, ends: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A grid x, y of a window, and log |R(x + iy)| there, (len(y), len(x))."""
        import numpy as np

        left, right, bottom, top = ends
        x, y = np.linspace(left, right, POINTS), np.linspace(bottom, top, POINTS)
        with np.errstate(all="ignore"):
            return x, y, np.log(np.abs(self(x + 1j * y[:, None])))

    def plot(self, ax: Axes | None = None, *, order_star: bool = False, window: Sequence[float] | None = None) -> Axes:
        """The region of stability |R(z)| ≤ 1, or the order star |R(z)| > |exp z| with zeros ○ and poles ×.

        Args:
            ax: The axes; None for pyplot's current or new ones.
            order_star: Whether the order star is drawn.
            window: The ends (left, right, bottom, top) of the axes; by default, of the region, or of zeros and poles.

        Returns:
            The axes.

        Raises:
            IntegratorError: The coefficients have symbols, or an argument has the wrong type.
            ImportError: matplotlib is not installed.

        Example:
            >>> import bseries as bs
            >>> axes = bs.stability_function("rk4").plot()
            >>> axes.get_xlabel(), round(float(axes.get_xlim()[0]), 1)
            ('Re z,  z = hλ', -3.3)

        References:
            G. Wanner, E. Hairer, S. P. Nørsett, BIT 18 (1978) 475–489, doi:10.1007/BF01932026 (order stars).
        """
        import numpy as np

        poles: Any = np.array(self.poles)
        zeros: Any = np.roots(self._float_coefficients()[0][::-1])
        given = None if window is None else read_window(window)
        size = SPACE * max(abs(np.concatenate([zeros, poles, [1]])))
        ends = given or (-size, size, -size, size)
        x, y, sizes = self._logarithms(ends)
        if given is None and not order_star:  # the region may be much smaller
            ends = (*_ends(x, (sizes <= 0).any(axis=0)), *_ends(y, (sizes <= 0).any(axis=1)))
            x, y, sizes = self._logarithms(ends)
        with drawing(ax, IntegratorError) as axes:
            draw_region(axes, x, y, x - sizes if order_star else sizes)
            if order_star:
                axes.plot(zeros.real, zeros.imag, "o", color=BLACK, mfc="none", markersize=4, clip_on=True)
                axes.plot(poles.real, poles.imag, "x", color=BLACK, markersize=4, clip_on=True)
            title = "shaded: |R| > |exp|, zeros ○, poles ×" if order_star else "shaded: |R(z)| ≤ 1"
            axes.set(title=title, xlabel="Re z,  z = hλ", ylabel="Im z", xlim=ends[:2], ylim=ends[2:])
            if (x[-1] - x[0]) < NARROW * (y[-1] - y[0]):
                axes.set_aspect("equal")
        return axes

    def __str__(self) -> str:
        above, below = polynomial_text(self.p), polynomial_text(self.q)
        if len(self.q) == 1:
            return above
        return f"({above})/({below})" if " " in above else f"{above}/({below})"

    def __repr__(self) -> str:
        return f"StabilityFunction({shorten(str(self))})"

    def to_latex(self) -> str:
        """The function as LaTeX.

        Example:
            >>> import bseries as bs
            >>> print(bs.stability.StabilityFunction([1], [1, -1, "1/2"]).to_latex())
            \\frac{1}{1 - z + \\frac{1}{2} z^{2}}
        """
        above, below = (polynomial_text(values, latex=True) for values in (self.p, self.q))
        return above if len(self.q) == 1 else f"\\frac{{{above}}}{{{below}}}"

    def _repr_latex_(self) -> str:
        return f"${self.to_latex()}$"


def _ends(line: np.ndarray, inside: Any) -> tuple[float, float]:
    """The ends of a region and 0 with some space, within those of a grid."""
    grid, found = line.tolist(), [*line[inside].tolist(), 0.0]
    space = max((SPACE - 1) * (max(found) - min(found)), 2 * (grid[1] - grid[0]))
    return max(min(found) - space, grid[0]), min(max(found) + space, grid[-1])


def polynomial_text(p: Vector, *, latex: bool = False) -> str:
    """The nonzero terms of a polynomial as text or LaTeX, in ascending powers of z."""
    terms = [_term(a, k, latex) for k, a in enumerate(p) if a]
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _term(a: Element, k: int, latex: bool) -> str:
    """A nonzero coefficient times a power of z."""
    power = "" if not k else "z" if k == 1 else f"z^{{{k}}}" if latex else f"z^{k}"
    value = a if isinstance(a, Inexact) else field.from_element(a)
    below = ""
    if isinstance(value, Inexact):
        number, _, exponent = value.text.partition("e")
        if exponent:
            number += f" \\cdot 10^{{{int(exponent)}}}" if latex else f"e{exponent}"
    elif isinstance(value, Fraction) and not latex:
        number, below = str(value.numerator), f"/{value.denominator}" * (value.denominator > 1)
    else:
        number = latex_number(value, None) if latex else format_number(value)
        if " " in number and power:
            number = f"\\left({number}\\right)" if latex else f"({number})"
    if power and number in ("1", "-1"):
        return number[:-1] + power + below
    return number + (" " if latex else "*") * bool(power) + power + below
