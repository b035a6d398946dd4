"""Linear forms, and the four kinds of evaluations of the field in a program."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

from bseries_base.errors import shorten, shown
from integrators.core.errors import IntegratorError
from integrators.core.immutable import ImmutableValue
from integrators.exact.entries import Entry, multiply_entries, read_entry, sum_entries
from integrators.exact.expressions import format_number


class Field(NamedTuple):
    """k = h f^[part](at); the sum of all parts if `part` is None."""

    part: int | None
    at: LinearForm


class Derivative(NamedTuple):
    """k = h (f^[part])′(at) · along. A linear system if `along` contains k, as in Rosenbrock methods."""

    part: int | None
    at: LinearForm
    along: LinearForm


class Flow(NamedTuple):
    """k = z(1) − at, where z(0) = at and z′(θ) = time · h f^[part](z(θ)) + Σ_j θ^j forcing[j].

    Without forcing, the exact flow of a part; with forcing, as in exponential and multirate infinitesimal methods.
    """

    part: int | None
    at: LinearForm
    time: Entry
    forcing: tuple[LinearForm, ...] = ()


class Average(NamedTuple):
    """k = ∫₀¹ θ^power h f^[part](Σ_j θ^j path[j]) dθ, an average of the field along a polynomial path."""

    part: int | None
    path: tuple[LinearForm, ...]
    power: int = 0


Evaluation = Field | Derivative | Flow | Average


def operands(evaluation: Evaluation) -> Iterator[LinearForm]:
    """The linear forms in an evaluation."""
    for value in evaluation:
        if isinstance(value, LinearForm):
            yield value
        elif isinstance(value, tuple):
            yield from value


class LinearForm(ImmutableValue):
    """start · y₀ + Σ terms[e] · k_e: a point of a step (start = 1) or a vector (start = 0).

    Forms can be added, subtracted, and multiplied by numbers; `ProgramBuilder` creates the first ones. Coefficients are
    finite numbers or formulas; zeros are dropped.

    Example:
        >>> y = LinearForm(1)
        >>> print(y + LinearForm(0, {0: 1}) / 2 - 3 * LinearForm(0, {1: "1/3"}))
        y + 1/2*k1 - k2
    """

    start: Entry
    terms: Mapping[int, Entry]
    owner: object | None

    def __init__(self, start: object = 0, terms: Mapping[int, object] | None = None) -> None:
        read = {e: read_entry(x, f"coefficient of k{e + 1}") for e, x in (terms or {}).items()}
        self._set(read_entry(start, "coefficient of y"), read)

    def _set(self, start: Entry, terms: Mapping[int, Entry], owner: object | None = None) -> LinearForm:
        kept = {e: x for e, x in sorted(terms.items()) if x != 0}
        self.__dict__.update(start=start, terms=kept, owner=owner)
        return self

    @classmethod
    def of_entries(cls, start: Entry, terms: Mapping[int, Entry], owner: object | None = None) -> LinearForm:
        """The form with these entries of a method as coefficients, which are not checked again.

        The forms of a builder have it as `owner`, so that forms of two builders cannot be mixed.
        """
        return cls.__new__(cls)._set(start, terms, owner)

    @property
    def _data(self) -> tuple[object, ...]:
        return self.start, tuple(self.terms.items())

    @property
    def entries(self) -> tuple[Entry, ...]:
        """All coefficients."""
        return self.start, *self.terms.values()

    def map(self, function: Callable[[Entry], Entry]) -> LinearForm:
        """The form with a function applied to every coefficient."""
        return self.of_entries(function(self.start), {e: function(x) for e, x in self.terms.items()}, self.owner)

    def times(self, entry: Entry) -> LinearForm:
        """The form times an entry of a method."""
        return self.map(lambda x: multiply_entries(x, entry))

    def substituted(self, evaluation: Callable[[int], LinearForm], start: LinearForm) -> LinearForm:
        """The form with `start` substituted for y and evaluation(e) for every k_e."""
        total = start.times(self.start) if self.start != 0 else LinearForm()
        for e, x in self.terms.items():
            total = total + evaluation(e).times(x)
        return total

    def __add__(self, other: object) -> LinearForm:
        if not isinstance(other, LinearForm):
            return NotImplemented
        if None not in (self.owner, other.owner) and self.owner is not other.owner:
            raise IntegratorError("forms must come from one builder to be added, but came from two")
        terms = dict(self.terms)
        for e, x in other.terms.items():
            terms[e] = sum_entries((terms[e], x)) if e in terms else x
        return self.of_entries(sum_entries((self.start, other.start)), terms, self.owner or other.owner)

    def __radd__(self, other: object) -> LinearForm:
        return self if other == 0 else NotImplemented  # the start of `sum`

    def __neg__(self) -> LinearForm:
        return self * -1

    def __sub__(self, other: object) -> LinearForm:
        return self + -other if isinstance(other, LinearForm) else NotImplemented

    def __mul__(self, number: object) -> LinearForm:
        return self.times(_number(number))

    __rmul__ = __mul__

    def __truediv__(self, number: object) -> LinearForm:
        divisor = _number(number)
        if divisor == 0:
            raise IntegratorError("number must not be zero to divide by")
        return self * (1 / divisor)

    __array_ufunc__ = None  # so that a NumPy number times a form is a form

    def text(self, show: Callable[[Entry], str] = format_number) -> str:
        """The form as text, with numbers written by `show`."""
        parts = [(self.start, "y"), *((x, f"k{e + 1}") for e, x in self.terms.items())]
        return " + ".join(_term(x, name, show) for x, name in parts if x != 0).replace("+ -", "- ") or "0"

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return f"<LinearForm {self}>"


def _number(number: object) -> Entry:
    if isinstance(number, LinearForm):
        raise IntegratorError("number must be a number, but was a linear form: only the field is nonlinear")
    return read_entry(number, "number")


def _term(x: Entry, name: str, show: Callable[[Entry], str]) -> str:
    if x in (1, -1):
        return name if x == 1 else f"-{name}"
    text = show(x)
    return f"({text})*{name}" if " " in text else f"{text}*{name}"


def check_form(form: object, argument: str, *, start: int) -> LinearForm:
    """Check that a form is a point (start = 1) or a vector (start = 0)."""
    kind = "a point, y plus evaluations," if start else "a vector, evaluations without y,"
    if not isinstance(form, LinearForm):
        raise IntegratorError(f"{argument} must be {kind} but was {shown(form)}")
    if form.start != start:
        raise IntegratorError(f"{argument} must be {kind} but was {shorten(str(form))}")
    return form


def combination(coefficients: Iterable[Entry], forms: Iterable[LinearForm]) -> LinearForm:
    """Σ x_j k_j without the zero coefficients."""
    return sum((k.times(x) for x, k in zip(coefficients, forms, strict=True) if x != 0), LinearForm())
