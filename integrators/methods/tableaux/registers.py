"""Low-storage and Shu–Osher forms of explicit Runge–Kutta methods: steps as combinations of few vectors.

A form is kept as the values of a step, in order: value 0 is y_n, and each further one is a slope h f(v) or a
combination Σ x v of earlier values. From it follow the tableau, by linear forms in the slopes; the compiled step, which
overwrites values that are no longer needed; and the internal stability functions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple, Self, Unpack

from bseries_base.errors import shorten, shown
from integrators.core.arguments import check_digits, items
from integrators.core.errors import IntegratorError
from integrators.core.immutable import ImmutableValue
from integrators.exact import entries
from integrators.exact.entries import Entry, EntryRow, Matrix, multiply_entries, sum_entries
from integrators.exact.expressions import format_number
from integrators.methods.programs.builder import Labels, read_matrix, read_row
from integrators.methods.programs.evaluations import LinearForm

ONE, MINUS = Fraction(1), Fraction(-1)


class Slope(NamedTuple):
    """h f(v), where v is the value `at` of the step."""

    at: int


class Combination(NamedTuple):
    """Σ x v over pairs (v, x) of a value of the step and its coefficient."""

    terms: tuple[tuple[int, Entry], ...]


Coefficients = Mapping[str, EntryRow | Matrix]
Shapes = Mapping[str, tuple[int | str, ...]]


class RegisterForm(ImmutableValue):
    """A form in which a Runge–Kutta method is given: a step as slopes and combinations of earlier values.

    Attributes:
        kind: ``2N``, ``2R``, ``3S*`` or ``Shu-Osher``.
        coefficients: The coefficients of the form by name, as they were given.
        digits: The number of correct significant digits of published decimals; None if they are exact.
        values: The values of a step; the first, y_n, is None, and the last is y_{n+1}.

    Example:
        >>> import bseries as bs
        >>> form = bs.RungeKutta.from_2n([0, "-5/9", "-153/128"], ["1/3", "15/16", "8/15"]).form
        >>> form.kind, form.registers
        ('2N', 2)
    """

    kind: str
    coefficients: Coefficients
    digits: int | None
    values: tuple[Slope | Combination | None, ...]

    def __init__(
        self, kind: str, given: Mapping[str, object], names: Iterable[str] = (), digits: int | None = None
    ) -> None:
        check_digits(digits)
        coefficients = _read(KINDS[kind].shapes, given, tuple(names))
        if entries.find_domain(entries.flat_entries(tuple(coefficients.values()))) == "float":
            coefficients = _mapped(coefficients, lambda x, _: multiply_entries(1.0, x))
        self.__dict__.update(kind=kind, coefficients=coefficients, digits=digits)
        step = _Recorder(self.precision)
        step.combine((step.at(KINDS[kind].record(step, **coefficients)), ONE))
        self.__dict__["values"] = tuple(step.values)

    @property
    def _data(self) -> tuple[object, ...]:
        return self.kind, tuple(self.coefficients.items()), self.digits

    def __repr__(self) -> str:
        return f"<RegisterForm {self.kind}: {self.registers} registers>"

    def map(self, function: Callable[[Entry, str], Entry]) -> RegisterForm:
        """The form with a function of every coefficient and its label."""
        return RegisterForm(self.kind, _mapped(self.coefficients, function), digits=self.digits)

    @property
    def precision(self) -> Fraction | float:
        """The relative error of the coefficients: 0 if they are exact."""
        return entries.relative_error(
            entries.find_domain(entries.flat_entries(tuple(self.coefficients.values()))), self.digits
        )

    def to_dict(self, write: Callable[[EntryRow], object]) -> dict[str, Any]:
        """The form as plain data, with rows of coefficients written by a function."""
        return {"kind": self.kind} | {
            name: [write(row) for row in given] if len(KINDS[self.kind].shapes[name]) > 1 else write(given)  # type: ignore[arg-type]
            for name, given in self.coefficients.items()
        }

    @cached_property
    def steps(self) -> tuple[Slope | Combination | None, ...]:
        """The values without copies of others, which need no register of their own."""
        number: dict[int, int] = {}
        kept: list[Slope | Combination | None] = []
        for v, value in enumerate(self.values):
            if isinstance(value, Combination):
                terms = merged((number[u], x) for u, x in value.terms)
                is_copy = len(terms) == 1 and terms[0][1] == 1
                if is_copy and (v + 1 < len(self.values) or terms[0][0] == len(kept) - 1):
                    number[v] = terms[0][0]
                    continue
                kept.append(Combination(terms))
            else:
                kept.append(value and Slope(number[value.at]))
            number[v] = len(kept) - 1
        return tuple(kept)

    @cached_property
    def last_uses(self) -> tuple[int, ...]:
        """For each of the steps the last one that is computed from it, 0 if none is; for y_{n+1} a number beyond."""
        found = [0] * len(self.steps)
        for v, value in enumerate(self.steps):
            for used in operands_of(value):
                found[used] = v
        return (*found[:-1], len(found))

    @property
    def registers(self) -> int:
        """The most vectors that are needed at once, where a slope is added to a vector as soon as it is known."""
        last = self.last_uses
        combined = [v for v, value in enumerate(self.steps) if isinstance(value, Combination)]
        return max(sum(end > v for end in last[: v + 1]) for v in combined)

    def rows(self) -> Matrix:
        """The rows of A and, as the last one, the weights b: what multiplies the slopes in each stage and in y_{n+1}.

        Raises:
            IntegratorError: a stage is not y_n plus slopes, since its weight of y_n is not 1.
        """
        forms, slopes = [LinearForm.of_entries(ONE, {})], 0
        points: list[LinearForm] = []
        for value in self.values[1:]:
            if isinstance(value, Slope):
                points.append(forms[value.at])
                forms.append(LinearForm.of_entries(Fraction(0), {slopes: ONE}))
                slopes += 1
            elif value is not None:
                forms.append(sum((forms[v].times(x) for v, x in value.terms), LinearForm()))
        for i, point in enumerate([*points, forms[-1]], 1):
            if entries.cancels((point.start, MINUS), self.precision) is not True:
                what = f"stage {i}" if i <= slopes else "the result"
                raise IntegratorError(
                    f"{', '.join(self.coefficients)} must give stages with the weight 1 of y_n, but that of {what} was "
                    f"{shorten(format_number(point.start))}"
                )
        return tuple(tuple(form.terms.get(e, Fraction(0)) for e in range(slopes)) for form in (*points, forms[-1]))


def operands_of(value: Slope | Combination | None) -> list[int]:
    """The values from which a value is computed."""
    if value is None:
        return []
    return [value.at] if isinstance(value, Slope) else [v for v, _ in value.terms]


def merged(terms: Iterable[tuple[int, Entry]]) -> tuple[tuple[int, Entry], ...]:
    """Terms with equal values added and zeros left out."""
    total: dict[int, Entry] = {}
    for v, x in terms:
        total[v] = sum_entries((total[v], x)) if v in total else x
    return tuple((v, x) for v, x in total.items() if x != 0)


def _mapped(coefficients: Coefficients, function: Callable[[Entry, str], Entry]) -> dict[str, Any]:
    """The coefficients with a function of each and its label."""

    def mapped(x: Any, label: str) -> Any:
        if isinstance(x, tuple):
            return tuple(mapped(y, f"{label}[{j}]") for j, y in enumerate(x, 1))
        return function(x, label)

    return {name: mapped(given, name) for name, given in coefficients.items()}


class _Recorder:
    """Records the values of a step; None stands for the zero vector."""

    def __init__(self, precision: Fraction | float) -> None:
        self.precision = precision
        self.values: list[Slope | Combination | None] = [None]

    def at(self, value: int | None) -> int:
        """A stage or the result, which must not be zero."""
        if value is None:
            raise IntegratorError("coefficients must give stages with the weight 1 of y_n, but one stage was zero")
        return value

    def slope(self, value: int | None) -> int:
        """h f at a value."""
        self.values.append(Slope(self.at(value)))
        return len(self.values) - 1

    def combine(self, *terms: tuple[int | None, Entry]) -> int | None:
        """A combination of values."""
        kept = merged((v, x) for v, x in terms if v is not None)
        if not kept:
            return None
        self.values.append(Combination(kept))
        return len(self.values) - 1


def _record_2n(step: _Recorder, A: EntryRow, B: EntryRow) -> int | None:
    """dU ← A_i dU + h f(U), U ← U + B_i dU."""
    if A[0] != 0:
        raise IntegratorError(f"A[1] must be 0, since no slope is known before the first, but was {A[0]}")
    u: int | None = 0
    change: int | None = None
    for a, b in zip(A, B, strict=True):
        change = step.combine((change, a), (step.slope(u), ONE))
        u = step.combine((u, ONE), (change, b))
    return u


def _record_2r(step: _Recorder, b: EntryRow, a: EntryRow) -> int | None:
    """X ← X + b_i h f(U), U ← X + (a_{i+1,i} - b_i) h f(U): one vector holds f(U) and then U."""
    u, total = step.combine((0, ONE)), step.combine((0, ONE))
    for i, weight in enumerate(b):
        k = step.slope(u)
        total = step.combine((total, ONE), (k, weight))
        if i < len(a):
            u = step.combine((total, ONE), (k, sum_entries((a[i], multiply_entries(MINUS, weight)))))
    return total


def _record_3s(step: _Recorder, beta: EntryRow, gamma: Matrix, delta: EntryRow) -> int | None:
    """S2 ← S2 + δ_i S1, S1 ← γ_i1 S1 + γ_i2 S2 + γ_i3 S3 + β_i h f(S1) from S1 = S3 = y_n, S2 = 0."""
    first, third = step.combine((0, ONE)), step.combine((0, ONE))
    second: int | None = None
    for row, b, d in zip(gamma, beta, delta, strict=True):
        second = step.combine((second, ONE), (first, d))
        first = step.combine((first, row[0]), (second, row[1]), (third, row[2]), (step.slope(first), b))
    return first


def _record_shu_osher(step: _Recorder, alpha: Matrix, beta: Matrix) -> int | None:
    """Y_i = (1 - Σ α_ij) y_n + Σ (α_ij Y_j + β_ij h f(Y_j)); y_{n+1} is the last row."""
    stages: list[int | None] = []
    slopes: list[int | None] = []
    for name, rows in (("alpha", alpha), ("beta", beta)):
        implicit = [(i, j) for i, row in enumerate(rows) for j in range(i, len(row)) if row[j] != 0]
        for i, j in implicit[:1]:
            raise IntegratorError(f"{name}[{i + 1}][{j + 1}] must be 0 in an explicit method, but was {rows[i][j]}")
    for weights, factors in zip(alpha, beta, strict=True):
        rest = (ONE, *(multiply_entries(MINUS, x) for x in weights))
        start = [] if entries.cancels(rest, step.precision) else [(0, sum_entries(rest))]
        terms = [*zip(stages, weights, strict=False), *zip(slopes, factors, strict=False)]
        stages.append(step.combine(*start, *terms))
        if len(stages) < len(alpha):
            slopes.append(step.slope(stages[-1]))
    return stages[-1]


class Kind(NamedTuple):
    """A kind of form: the recorder of its step, and the shape of each coefficient.

    Shapes are numbers of rows and columns, or of entries, relative to the number of stages; text is an absolute number.
    """

    record: Callable[..., int | None]
    shapes: Shapes


KINDS = {
    "2N": Kind(_record_2n, {"A": (0,), "B": (0,)}),
    "2R": Kind(_record_2r, {"b": (0,), "a": (-1,)}),
    "3S*": Kind(_record_3s, {"beta": (0,), "gamma": (0, "3"), "delta": (0,)}),
    "Shu-Osher": Kind(_record_shu_osher, {"alpha": (1, 0), "beta": (1, 0)}),
}


def _read(shapes: Shapes, given: Mapping[str, Any], names: Iterable[str]) -> Coefficients:
    """The coefficients of a form, of which the first decides the number of stages."""
    (name, (more, *_)), *_ = shapes.items()
    stages = max(1, len(items(given[name], name)) - int(more))
    read: dict[str, EntryRow | Matrix] = {}
    for name, shape in shapes.items():
        count, *columns = (int(x) if isinstance(x, str) else stages + x for x in shape)
        if columns:
            read[name] = read_matrix(given[name], name, names, rows=count, columns=columns[0])
        else:
            read[name] = read_row(given[name], name, names, count=count) if count or items(given[name], name) else ()
    return read


def read_form(data: Any, names: Iterable[str] = (), digits: int | None = None) -> RegisterForm:
    """A form from the data of a file: its kind, and its coefficients by name."""
    given = dict(data) if isinstance(data, Mapping) else {}
    kind = given.pop("kind", None)
    if not isinstance(kind, str) or kind not in KINDS:
        raise IntegratorError(f"form.kind must be one of {', '.join(KINDS)}, but was {shown(kind)}")
    wanted = KINDS[kind].shapes
    if given.keys() != wanted.keys():
        has = shorten(", ".join(map(str, given)) or "none")
        raise IntegratorError(f"form must have the keys {', '.join(wanted)} besides kind, but had {has}")
    return RegisterForm(kind, given, names, digits)


class FormLabels(Labels, total=False):
    """The labels of a method given by a form."""

    warn: bool


class FromRegisters:
    """The constructors of Runge–Kutta methods from low-storage and Shu–Osher forms, which the method keeps."""

    form: RegisterForm | None = None

    @classmethod
    def from_form(cls, form: RegisterForm, **labels: Any) -> Self:
        """The method of a form, which it keeps for steps and files; `labels` are name, reference and warn."""
        *A, b = form.rows()
        method = cls(A, b, digits=form.digits, **labels)  # type: ignore[call-arg]
        method.__dict__["form"] = form
        return method

    @classmethod
    def _from_registers(cls, kind: str, labels: FormLabels, **given: object) -> Self:
        form = RegisterForm(kind, given, labels.pop("parameters", ()), labels.pop("digits", None))
        return cls.from_form(form, **labels)

    @classmethod
    def from_2n(cls, A: object, B: object, **labels: Unpack[FormLabels]) -> Self:
        """The method of Williamson's form in 2N storage: dU ← A_i dU + h f(U), U ← U + B_i dU for each stage i.

        Args:
            A, B: the coefficients; A_1 is 0.
            labels: parameters, name, reference, digits and warn, as for `RungeKutta`.

        Raises:
            IntegratorError: the sizes differ, A_1 is not 0, or an entry is no number or formula.

        Example:
            >>> import bseries as bs
            >>> bs.RungeKutta.from_2n([0, "-5/9", "-153/128"], ["1/3", "15/16", "8/15"]).b
            (Fraction(1, 6), Fraction(3, 10), Fraction(8, 15))

        References:
            J. H. Williamson, J. Comput. Phys. 35 (1980) 48–56, doi:10.1016/0021-9991(80)90033-9.
        """
        return cls._from_registers("2N", labels, A=A, B=B)

    @classmethod
    def from_2r(cls, a: object, b: object, **labels: Unpack[FormLabels]) -> Self:
        """The method in van der Houwen's form with two registers: a_ij = b_j for j < i − 1.

        Args:
            a: the entries a_21, a_32, … below the diagonal.
            b: the weights, one more.
            labels: parameters, name, reference, digits and warn, as for `RungeKutta`.

        Raises:
            IntegratorError: the sizes do not match, or an entry is no number or formula.

        Example:
            >>> import bseries as bs
            >>> bs.RungeKutta.from_2r(["1/2", "3/4"], ["1/4", 0, "3/4"]).A[2]
            (Fraction(1, 4), Fraction(3, 4), Fraction(0, 1))

        References:
            C. A. Kennedy, M. H. Carpenter, R. M. Lewis, Appl. Numer. Math. 35 (2000) 177–219,
            doi:10.1016/S0168-9274(99)00141-5.
        """
        return cls._from_registers("2R", labels, a=a, b=b)

    @classmethod
    def from_3s_star(cls, gamma: object, beta: object, delta: object, **labels: Unpack[FormLabels]) -> Self:
        """The method of Ketcheson's form 3S* with three registers S1 = S3 = y_n and S2 = 0.

        For each stage S2 ← S2 + δ_i S1, and then S1 ← γ_i1 S1 + γ_i2 S2 + γ_i3 S3 + β_i h f(S1).

        Args:
            gamma: for each stage the three factors γ_i1, γ_i2, γ_i3.
            beta, delta: one coefficient for each stage.
            labels: parameters, name, reference, digits and warn, as for `RungeKutta`.

        Raises:
            IntegratorError: the sizes do not match, a stage has not the weight 1 of y_n, or an entry is no number.

        Example:
            >>> import bseries as bs
            >>> heun = bs.RungeKutta.from_3s_star([[1, 0, 0], ["1/2", 0, "1/2"]], [1, "1/2"], [1, 0])
            >>> heun.b, heun.form.registers
            ((Fraction(1, 2), Fraction(1, 2)), 2)

        References:
            D. I. Ketcheson, J. Comput. Phys. 229 (2010) 1763–1773, doi:10.1016/j.jcp.2009.11.006.
        """
        return cls._from_registers("3S*", labels, gamma=gamma, beta=beta, delta=delta)

    @classmethod
    def from_shu_osher(cls, alpha: object, beta: object, **labels: Unpack[FormLabels]) -> Self:
        """The method of a Shu–Osher form Y_i = (1 − Σ_j α_ij) y_n + Σ_{j<i} (α_ij Y_j + β_ij h f(Y_j)).

        Args:
            alpha, beta: one row for each stage, of which the first is zero, and a last one for y_{n+1}.
            labels: parameters, name, reference, digits and warn, as for `RungeKutta`.

        Raises:
            IntegratorError: the sizes do not match, a stage is implicit, or an entry is no number or formula.

        Example:
            >>> import bseries as bs
            >>> alpha = [[0, 0, 0], [1, 0, 0], ["3/4", "1/4", 0], ["1/3", 0, "2/3"]]
            >>> beta = [[0, 0, 0], [1, 0, 0], [0, "1/4", 0], [0, 0, "2/3"]]
            >>> bs.RungeKutta.from_shu_osher(alpha, beta) == bs.method("ssprk33")
            True

        References:
            S. Gottlieb, D. Ketcheson, C.-W. Shu, *Strong Stability Preserving Runge–Kutta and Multistep Time
            Discretizations* (2011), chapter 3; S. Gottlieb, C.-W. Shu, E. Tadmor, SIAM Rev. 43 (2001) 89–112,
            doi:10.1137/S003614450036757X.
        """
        return cls._from_registers("Shu-Osher", labels, alpha=alpha, beta=beta)
