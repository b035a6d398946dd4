"""`trace`: a step written in Python becomes a method.

The step runs once on values that record what is done with them. Each value is a linear form of evaluations times a
power of h, so that sums of terms of different powers, such as y + f(y), are refused.
"""

from __future__ import annotations

import linecache
import math
import operator
from collections.abc import Callable, Sequence
from fractions import Fraction
from inspect import currentframe
from traceback import walk_stack, walk_tb
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, Any, NoReturn

from bseries_base.errors import shorten, shown, warn_user
from integrators.core.arguments import FAILURES, check_partition_names, parameters_of, required, without_axes
from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry, multiply_entries, read_entry, sum_entries
from integrators.methods.programs.evaluations import Derivative, Evaluation, Field, Flow, LinearForm
from integrators.methods.programs.program import MAX_STAGES, Program, mapped

if TYPE_CHECKING:
    import numpy as np

UNKNOWN = 1_000_000
"""The number of the first unknown; unknowns are terms of forms until they are replaced by their equations."""
MOST_POWER = 100
"""The largest power of h in a step."""
LARGEST_DENOMINATOR = 1000
"""Floats are read as fractions with denominators up to this one, if they are their nearest doubles."""
USED = ("derivative", "flow", "solve")
UFUNCS = {"add": operator.add, "subtract": operator.sub, "multiply": operator.mul, "divide": operator.truediv}


def trace(
    step: Callable[..., object], *, parts: Sequence[str] = (), name: str | None = None, reference: str | None = None,
    max_children: object = None,
) -> Program:  # fmt: skip
    """The method that a step written in Python stands for.

    The step is called once as ``step(f, y, h)``, or ``step(f, t, y, h)`` for fields that depend on time. It may add and
    subtract values, multiply them by numbers and h, call f, loop a fixed number of times and use functions of its own;
    it must not look at values. Numbers stay exact: ``h/6``, ``Fraction(1, 6)``, ``sympy.sqrt(3)``. A float such as
    ``1/6`` is read as the fraction with a denominator up to 1,000 of which it is the nearest double, with a warning
    unless both are equal; other floats make the coefficients floats.

    Beside ``f(y)`` there are ``f.derivative(y, v)``, the derivative f′(y) v; ``f.flow(y, c*h)``, the exact solution a
    time c h after y; and ``f.solve(equation, like=y)``, the solution of ``Y = equation(Y)``, a value of the same kind
    as `like`, or of a system, if the function takes and returns several values. With `parts`, ``f.p`` is the part p of
    the field.

    Args:
        step: The function; it returns the end of the step.
        parts: The names of the parts of the field, for partitioned methods and splittings.
        name, reference: The name of the method, by default that of the function, and its publication.
        max_children: As for `ProgramBuilder.program`: bounds for methods for fields of a special form.

    Raises:
        IntegratorError: The step does something else with its values; the message quotes the line.

    Example:
        >>> import bseries as bs
        >>> def heun(f, y, h):
        ...     k1 = f(y)
        ...     k2 = f(y + h * k1)
        ...     return y + h / 2 * (k1 + k2)
        >>> print(bs.trace(heun).program)
        k1 = h f(y)
        k2 = h f(y + k1)
        y1 = y + 1/2*k1 + 1/2*k2
        >>> def verlet(f, y, h):
        ...     y = y + h / 2 * f.p(y)
        ...     y = y + h * f.q(y)
        ...     return y + h / 2 * f.p(y)
        >>> bs.trace(verlet, parts=["p", "q"])
        <Program verlet: 3 evaluations>
        >>> bs.trace(lambda f, y, h: f.solve(lambda end: y + h * f((y + end) / 2)), name="midpoint")
        <Program midpoint: 1 evaluation>

    References:
        HLW, section III.1 (methods and their B-series).
    """
    if not callable(step):
        raise IntegratorError(f"step must be a function such as step(f, y, h), but was {shown(step)}")
    if isinstance(parts, str) or not isinstance(parts, Sequence):
        raise IntegratorError(f"parts must be a sequence of names, but was {shown(parts)}")
    check_partition_names(parts)
    for part in parts:
        if part in USED:
            raise IntegratorError(f"parts must have other names than {', '.join(USED)}, but one was {part}")
    recorder = Recorder(getattr(step, "__code__", None), tuple(parts))
    end = recorder.run(step)
    label = getattr(step, "__name__", "").strip("<>")
    chosen = name if name is not None or not label.isidentifier() or label == "lambda" else label
    evaluations, result = recorder.resolved(end)
    if not evaluations:
        raise IntegratorError("step must call f, but did not")
    return Program(
        evaluations, result, parts=tuple(parts) or ("",), name=chosen, reference=reference, max_children=max_children
    )


class Recorder:
    """The evaluations of a step, in the order of its calls, and the equations of unknowns."""

    def __init__(self, code: CodeType | None, parts: tuple[str, ...]):
        self.code, self.parts = code, parts
        self.evaluations: list[Evaluation] = []
        self.known: dict[Evaluation, LinearForm] = {}
        self.equations: list[LinearForm | None] = []
        self.times: list[tuple[LinearForm, Entry, str]] = []

    def run(self, step: Callable[..., object]) -> LinearForm:
        """Call the step and return its end."""
        parameters = parameters_of(step)
        count = 3 if parameters is None else required(parameters)
        if count not in (3, 4):
            raise IntegratorError(f"step must take f, y, h or f, t, y, h, but took {count} arguments")
        if count == 4 and self.parts:
            raise IntegratorError("step must take f, y, h where parts are given, but took f, t, y, h")
        y, h = Value(LinearForm(1), 0, self), Value(Fraction(1), 1, self)
        arguments = (TracedField(self), y, h) if count == 3 else (TracedField(self), Time(Fraction(0), self), y, h)
        try:
            end = step(*arguments)
        except FAILURES as error:
            if isinstance(error, IntegratorError):
                raise
            raise IntegratorError(f"step must run on any state, but {self.place(error)} failed: {error}") from error
        end = without_axes(end)
        if not isinstance(end, Value) or end.recorder is not self or end.is_scalar:
            raise IntegratorError(f"step must return the end of the step, y + h …, but returned {shown(end)}")
        if (end.power, end.content.start) != (0, 1):
            raise IntegratorError(f"step must return y + h …, but returned {shorten(str(end))}")
        return end.content

    def record(self, evaluation: Evaluation) -> LinearForm:
        """The number of an evaluation as a form; equal evaluations are one."""
        if evaluation not in self.known:
            if len(self.evaluations) == MAX_STAGES:
                raise IntegratorError(f"step must have at most {MAX_STAGES} evaluations, but had more")
            self.known[evaluation] = LinearForm(0, {len(self.evaluations): 1})
            self.evaluations.append(evaluation)
        return self.known[evaluation]

    def resolved(self, end: LinearForm) -> tuple[tuple[Evaluation, ...], LinearForm]:
        """The evaluations and the end without unknowns, by their equations."""
        done: dict[int, LinearForm] = {}
        active: set[int] = set()

        def term(e: int) -> LinearForm:
            if e < UNKNOWN:
                return LinearForm(0, {e: 1})
            if e not in done:
                equation = self.equations[e - UNKNOWN]
                if equation is None or e in active:
                    raise IntegratorError("solve must take an equation with its unknowns inside f only, but did not")
                active.add(e)
                done[e] = form(equation)
            return done[e]

        def form(value: LinearForm) -> LinearForm:
            return value.substituted(term, LinearForm(1))

        evaluations = [mapped(evaluation, form) for evaluation in self.evaluations]
        for at, time, place in self.times:
            self._check_time(evaluations, form(at), time, place)
        return tuple(evaluations), form(end)

    def _check_time(self, evaluations: Sequence[Evaluation], at: LinearForm, time: Entry, place: str) -> None:
        """Refuse a time that differs from that of the point, where t′ = 1 is one of the equations."""
        used = [(evaluations[e], x) for e, x in at.terms.items() if isinstance(evaluations[e], Field | Flow)]
        own = sum_entries(multiply_entries(x, e.time) if isinstance(e, Flow) else x for e, x in used)
        gap = sum_entries((own, multiply_entries(time, Fraction(-1))))
        if not (abs(gap) < 1e-14 if isinstance(gap, float) else gap == 0):
            raise IntegratorError(
                f"f must be called at the time of its point, t + ({own})*h, but {place} calls it at t + ({time})*h"
            )

    def place(self, error: BaseException | None = None) -> str:
        """The line of the step that runs, or in which an error was raised, quoted."""
        steps = walk_stack(currentframe()) if error is None else walk_tb(error.__traceback__)
        lines = [line for frame, line in steps if frame.f_code is self.code]
        if not lines or self.code is None:
            return "it"
        text = linecache.getline(self.code.co_filename, lines[-1]).strip()
        return f"line {lines[-1]}" + (f" ({shorten(text)})" if text else "")

    def refuse(self, what: str) -> NoReturn:
        """Refuse what the present line of the step does."""
        raise IntegratorError(f"step must only add values, take multiples and call f, but {self.place()} {what}")

    def number(self, value: object) -> Entry | None:
        """A number as an entry; floats as the fractions that they stand for; None for what is no number."""
        if isinstance(value, float) and math.isfinite(value):
            near = Fraction(value).limit_denominator(LARGEST_DENOMINATOR)
            if float(near) != value:
                return float(value)
            if near != Fraction(value):
                warn_user(f"{value!r} is read as {near}; Fraction({str(near)!r}) says so", UserWarning)
            return near
        if isinstance(value, str | bool) or value is None:
            return None
        try:
            return read_entry(value, "number")
        except IntegratorError:
            return None


class Value:
    """A value of a traced step: a number or a linear form, times a power of h."""

    __slots__ = ("content", "power", "recorder")

    def __init__(self, content: Any, power: int, recorder: Recorder):
        self.content, self.power, self.recorder = content, power, recorder

    @property
    def is_scalar(self) -> bool:
        """Whether this is a multiple of a power of h."""
        return not isinstance(self.content, LinearForm)

    @property
    def is_zero(self) -> bool:
        """Whether this is zero, at any power of h."""
        return self.content == 0 if self.is_scalar else not any(self.content.entries)

    @property
    def shape(self) -> tuple[()]:
        """That of an array without axes, so that ``np.zeros(y.shape)`` is zero."""
        return ()

    def copy(self) -> Value:
        """The value itself, which never changes."""
        return self

    def _other(self, other: object) -> Value | None:
        if isinstance(other, Value):
            if other.recorder is not self.recorder:
                self.recorder.refuse("uses a value of another step")
            return other
        number = self.recorder.number(other)
        return None if number is None else Value(number, 0, self.recorder)

    def __add__(self, other: object) -> Any:
        if isinstance(other, Time):
            return other + self
        found = self._other(other)
        if found is None:
            return NotImplemented
        for zero, rest in ((found, self), (self, found)):  # sums may start from zero
            if zero.is_zero and (zero.is_scalar or not rest.is_scalar):
                return rest
        if found.is_scalar != self.is_scalar:
            self.recorder.refuse(f"adds a number to a state ({self} and {found})")
        if found.power != self.power:
            self.recorder.refuse(f"adds different powers of h ({self} and {found})")
        both = self.content, found.content
        return Value(sum_entries(both) if self.is_scalar else both[0] + both[1], self.power, self.recorder)

    __radd__ = __add__

    def __neg__(self) -> Value:
        return self * -1

    def __pos__(self) -> Value:
        return self

    def __sub__(self, other: object) -> Any:
        found = self._other(other)
        return NotImplemented if found is None else self + -found

    def __rsub__(self, other: object) -> Any:
        return -self + other

    def __mul__(self, other: object) -> Any:
        found = self._other(other)
        if found is None:
            return NotImplemented
        if not self.is_scalar and not found.is_scalar:
            self.recorder.refuse("multiplies two states")
        scalar, value = (self, found) if self.is_scalar else (found, self)
        content = (
            multiply_entries(scalar.content, value.content) if value.is_scalar else value.content.times(scalar.content)
        )
        return Value(content, self.power + found.power, self.recorder)

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> Any:
        found = self._other(other)
        if found is None:
            return NotImplemented
        if not found.is_scalar:
            self.recorder.refuse("divides by a state")
        if found.content == 0:
            self.recorder.refuse("divides by zero")
        return self * Value(1 / found.content, -found.power, self.recorder)

    def __rtruediv__(self, other: object) -> Any:
        found = self._other(other)
        return NotImplemented if found is None else found / self

    def __pow__(self, exponent: object) -> Any:
        if not isinstance(exponent, int) or not self.is_scalar or exponent < 0:
            self.recorder.refuse(
                "takes a power of a state" if not self.is_scalar else f"takes the power {exponent!r} of h"
            )
        if exponent > MOST_POWER:
            self.recorder.refuse(f"takes the power {exponent} of h, beyond {MOST_POWER}")
        total = Value(Fraction(1), 0, self.recorder)
        for _ in range(exponent):
            total = total * self
        return total

    def _look(self, *_: object) -> NoReturn:
        self.recorder.refuse("looks at a value, on which the method must not depend")

    __bool__ = __lt__ = __le__ = __gt__ = __ge__ = __eq__ = __ne__ = __abs__ = _look  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: object, **options: Any) -> Any:
        in_place = options.keys() == {"out"} and options["out"][0] is inputs[0]  # acc += h*f(y), where acc is an array
        if method != "__call__" or ufunc.__name__ not in UFUNCS or (options and not in_place):
            self.recorder.refuse(f"calls np.{ufunc.__name__} on a value")
        if any(getattr(x, "shape", ()) for x in inputs):
            self.recorder.refuse("combines an array with a value, which stands for a whole state")
        return UFUNCS[ufunc.__name__](*map(without_axes, inputs))

    def __array_function__(
        self, function: FunctionType, types: object, arguments: Sequence[object], options: object
    ) -> Value:
        if function.__name__ != "zeros_like" or len(arguments) != 1 or options:
            self.recorder.refuse(f"calls np.{function.__name__} on a value")
        return self * 0

    def __str__(self) -> str:
        h = {0: "", 1: "h "}.get(self.power, f"h^{self.power} ")
        # An evaluation k is h f, so that a form times h^-1 is written in values of f.
        text = str(self.content)
        return f"{h}({text})" if h and " " in text else f"{h}{text}"

    def __repr__(self) -> str:
        return f"<{self}>"


class Time:
    """The time t + c h in a traced step."""

    def __init__(self, c: Entry, recorder: Recorder):
        self.c, self.recorder = c, recorder

    def __add__(self, other: object) -> Time:
        if isinstance(other, int | float) and other == 0:
            return self
        if not isinstance(other, Value) or not other.is_scalar or other.power != 1:
            self.recorder.refuse("adds something else than a multiple of h to t")
        return Time(sum_entries((self.c, other.content)), self.recorder)

    __radd__ = __add__

    def __sub__(self, other: Value) -> Time:
        return self + -other

    def _look(self, *_: object) -> NoReturn:
        self.recorder.refuse("uses t other than as an argument of f")

    __bool__ = __mul__ = __rmul__ = __truediv__ = __lt__ = __le__ = __gt__ = __ge__ = _look  # type: ignore[assignment]
    __eq__ = __ne__ = _look  # type: ignore[assignment]
    __hash__ = None  # type: ignore[assignment]


class TracedField:
    """The field f of a traced step, or one of its parts."""

    def __init__(self, recorder: Recorder, part: int | None = None):
        self._recorder, self._index = recorder, part

    def __getattr__(self, name: str) -> TracedField:
        parts = self._recorder.parts
        if self._index is None and name in parts:
            return TracedField(self._recorder, parts.index(name))
        known = ", ".join([*USED, *(parts if self._index is None else ())])
        raise IntegratorError(f"f has {known}, but {self._recorder.place()} uses f.{name}")

    @property
    def _part(self) -> int | None:
        return self._index if self._recorder.parts else 0

    def __call__(self, at: Any, *rest: Any) -> Value:
        """The field at a point, or at a time and a point."""
        arguments = (at, *rest)
        recorder = self._recorder
        if len(arguments) > 2 or (len(arguments) == 2) != isinstance(arguments[0], Time):
            recorder.refuse("calls f with something else than a state, or t and a state")
        form = self._form(arguments[-1], 1)
        if rest:
            recorder.times.append((form, at.c, recorder.place()))
        return Value(recorder.record(Field(self._part, form)), -1, recorder)

    def derivative(self, at: object, along: Value) -> Value:
        """f′(at) · along."""
        form = self._form(along, 0)
        evaluation = Derivative(self._part, self._form(at, 1), form)
        return Value(self._recorder.record(evaluation), along.power - 1, self._recorder)

    def flow(self, at: object, time: object) -> Value:
        """The exact solution after a time c h from a point."""
        if not isinstance(time, Value) or not time.is_scalar or time.power != 1:
            self._recorder.refuse("takes a flow over something else than a multiple of h")
        start = self._form(at, 1)
        return Value(start + self._recorder.record(Flow(self._part, start, time.content)), 0, self._recorder)

    def solve(self, equation: Callable[..., object], like: object = None) -> Value | tuple[Value, ...]:
        """The solution of Y = equation(Y), or of a system of several."""
        recorder = self._recorder
        parameters = parameters_of(equation)
        count = 1 if parameters is None else len(parameters)
        model = Value(LinearForm(1), 0, recorder) if like is None else like
        if not isinstance(model, Value) or model.is_scalar:
            recorder.refuse("solves for something else than states")
        first = len(recorder.equations)
        recorder.equations += [None] * count
        start = LinearForm(model.content.start)
        unknowns = [Value(start + LinearForm(0, {UNKNOWN + first + i: 1}), model.power, recorder) for i in range(count)]
        found = equation(*unknowns)
        ends = [found] if count == 1 and isinstance(found, Value) else found
        if not isinstance(ends, list | tuple) or len(ends) != count or not all(isinstance(x, Value) for x in ends):
            recorder.refuse(f"solves for {count} unknowns with another number of equations")
        for i, end in enumerate(ends):
            if end.is_scalar or (end.power, end.content.start) != (model.power, model.content.start):
                recorder.refuse(f"solves for a value like {model} with the equation {end}")
            recorder.equations[first + i] = end.content - start
        return unknowns[0] if count == 1 else tuple(unknowns)

    def _form(self, value: object, start: int) -> LinearForm:
        """A point (start = 1) or a vector (start = 0) as a form; derivatives may be along any power of h."""
        recorder = self._recorder
        value = without_axes(value)
        if not isinstance(value, Value) or value.is_scalar or value.recorder is not recorder:
            recorder.refuse("calls f with something else than a state")
        if value.content.start != start or (start and value.power != 0):
            kind = "y + h …" if start else "without y"
            recorder.refuse(f"calls f where a value must be {kind}, but is {value}")
        return value.content
