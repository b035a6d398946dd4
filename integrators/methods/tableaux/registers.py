"""Low-storage and Shu–Osher forms of explicit Runge–Kutta methods: steps as combinations of few vectors.

A form is kept as the values of a step, in order: value 0 is y_n, and each further one is a slope h f(v) or a combination
Σ x v of earlier values. From it follow the tableau, by linear forms in the slopes; the compiled step, which overwrites
values that are no longer needed; and the internal stability functions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self, Unpack

from bseries_base.errors import shorten, shown
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.core.immutable import ImmutableValue
from integrators.exact import entries
from integrators.exact.entries import Entry, EntryRow, Matrix, multiply_entries, sum_entries
from integrators.exact.expressions import format_number
from integrators.methods.programs.builder import Labels, entry_count, read_matrix, read_row
from integrators.methods.programs.evaluations import LinearForm

if TYPE_CHECKING:
    from integrators.methods.tableaux.runge_kutta import RungeKutta

ONE, MINUS = Fraction(1), Fraction(-1)


class Slope(NamedTuple):
    """h f(v), where v is the value `at` of the step."""

    at: int


class Combination(NamedTuple):
    """Σ x v over pairs (v, x) of a value of the step and its coefficient."""

    terms: tuple[tuple[int, Entry], ...]


Coefficients = Mapping[str, EntryRow | Matrix]


class RegisterForm(ImmutableValue):
    """A form in which a Runge–Kutta method is given: a step as slopes and combinations of earlier values.

    Attributes:
        kind: ``2N``, ``2R``, ``3S*`` or ``Shu-Osher``.
        coefficients: The coefficients of the form by name, as they were given.
        values: The values of a step; the first, y_n, is None, and the last is y_{n+1}.

    Example:
        >>> import bseries as bs
        >>> form = bs.RungeKutta.from_2n([0, "-5/9", "-153/128"], ["1/3", "15/16", "8/15"]).form
        >>> form.kind, form.registers
        ('2N', 2)
    """

    kind: str
    coefficients: Coefficients
    values: tuple[Slope | Combination | None, ...]

    def __init__(self, kind: str, given: Mapping[str, object], names: Iterable[str] = ()) -> None:
        read, record = FORMS[kind]
        coefficients: Coefficients = read(**given, names=tuple(names))
        if entries.find_domain(_flat(coefficients)) == "float":
            coefficients = _mapped(coefficients, lambda x, _: multiply_entries(1.0, x))
        recorder = _Recorder()
        record(recorder, **coefficients)
        self.__dict__.update(kind=kind, coefficients=coefficients, values=tuple(recorder.values))

    @property
    def _data(self) -> tuple[object, ...]:
        return self.kind, tuple(self.coefficients.items())

    def __repr__(self) -> str:
        return f"<RegisterForm {self.kind}: {self.registers} registers>"

    def map(self, function: Callable[[Entry, str], Entry]) -> RegisterForm:
        """The form with a function of every coefficient and its label."""
        return RegisterForm(self.kind, _mapped(self.coefficients, function))

    def to_dict(self, write: Callable[[Entry], object]) -> dict[str, Any]:
        """The form as plain data, with coefficients written by a function."""
        rows = {
            name: [list(map(write, x)) if isinstance(x, tuple) else write(x) for x in given]
            for name, given in self.coefficients.items()
        }
        return {"kind": self.kind, **rows}

    @cached_property
    def last_uses(self) -> tuple[int, ...]:
        """For each value the last one that is computed from it; for y_{n+1} a number beyond."""
        found = [0] * len(self.values)
        for v, value in enumerate(self.values):
            for used in operands_of(value):
                found[used] = v
        return (*found[:-1], len(found))

    @property
    def registers(self) -> int:
        """The most vectors that are needed at once, where a slope is added to a vector as soon as it is known."""
        last = self.last_uses
        combined = [v for v, value in enumerate(self.values) if isinstance(value, Combination)]
        return max(sum(end > v for end in last[: v + 1]) for v in combined)

    def rows(self, precision: Fraction | float) -> Matrix:
        """The rows of A and, as the last one, the weights b: what multiplies the slopes in each stage and in y_{n+1}.

        Raises:
            IntegratorError: a stage is not y_n plus slopes, since its weight of y_n is not 1 within the precision.
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
            if entries.cancels((point.start, MINUS), precision) is not True:
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


def _flat(coefficients: Coefficients) -> list[Entry]:
    rows = (row for given in coefficients.values() for row in given)
    return [x for row in rows for x in (row if isinstance(row, tuple) else (row,))]


def _mapped(coefficients: Coefficients, function: Callable[[Entry, str], Entry]) -> dict[str, Any]:
    """The coefficients with a function of each and its label."""

    def mapped(x: object, label: str) -> Any:
        return tuple(mapped(y, f"{label}[{j}]") for j, y in enumerate(x, 1)) if isinstance(x, tuple) else function(x, label)  # type: ignore[arg-type]

    return {name: mapped(given, name) for name, given in coefficients.items()}


class _Recorder:
    """Records the values of a step; None stands for the zero vector."""

    def __init__(self) -> None:
        self.values: list[Slope | Combination | None] = [None]

    def slope(self, at: int | None) -> int:
        """h f at a value."""
        if at is None:
            raise IntegratorError("coefficients must give stages with the weight 1 of y_n, but one stage was zero")
        self.values.append(Slope(at))
        return len(self.values) - 1

    def combine(self, *terms: tuple[int | None, Entry]) -> int | None:
        """A combination of values, which is a known value if it is 1 times that."""
        total: dict[int, Entry] = {}
        for v, x in terms:
            if v is not None:
                total[v] = sum_entries((total[v], x)) if v in total else x
        kept = tuple((v, x) for v, x in total.items() if x != 0)
        if not kept or (len(kept) == 1 and kept[0][1] == 1):
            return kept[0][0] if kept else None
        self.values.append(Combination(kept))
        return len(self.values) - 1


def _read_2n(A: object, B: object, names: tuple[str, ...]) -> Coefficients:
    first = read_row(A, "A", names)
    if first[0] != 0:
        raise IntegratorError(f"A[1] must be 0, since no slope is known before the first, but was {first[0]}")
    return {"A": first, "B": read_row(B, "B", names, count=len(first))}


def _record_2n(recorder: _Recorder, A: EntryRow, B: EntryRow) -> None:
    """dU ← A_i dU + h f(U), U ← U + B_i dU."""
    u: int | None = 0
    change: int | None = None
    for a, b in zip(A, B, strict=True):
        change = recorder.combine((change, a), (recorder.slope(u), ONE))
        u = recorder.combine((u, ONE), (change, b))


def _read_2r(a: object, b: object, names: tuple[str, ...]) -> Coefficients:
    weights = read_row(b, "b", names)
    given = items(a, "a")
    if len(given) != len(weights) - 1:
        raise IntegratorError(f"a must have {entry_count(len(weights) - 1)}, one fewer than b, but has {len(given)}")
    return {"a": read_row(given, "a", names) if given else (), "b": weights}


def _record_2r(recorder: _Recorder, a: EntryRow, b: EntryRow) -> None:
    """X ← X + b_i h f(U), U ← X + (a_{i+1,i} − b_i) h f(U): one vector holds f(U) and then U."""
    u: int | None = 0
    sums: int | None = 0
    for i, weight in enumerate(b):
        k = recorder.slope(u)
        sums = recorder.combine((sums, ONE), (k, weight))
        if i < len(a):
            u = recorder.combine((sums, ONE), (k, sum_entries((a[i], multiply_entries(MINUS, weight)))))


def _read_3s(gamma: object, beta: object, delta: object, names: tuple[str, ...]) -> Coefficients:
    weights = read_row(beta, "beta", names)
    matrix = read_matrix(gamma, "gamma", names, rows=len(weights), columns=3)
    return {"gamma": matrix, "beta": weights, "delta": read_row(delta, "delta", names, count=len(weights))}


def _record_3s(recorder: _Recorder, gamma: Matrix, beta: EntryRow, delta: EntryRow) -> None:
    """S2 ← S2 + δ_i S1, S1 ← γ_i1 S1 + γ_i2 S2 + γ_i3 S3 + β_i h f(S1) from S1 = S3 = y_n, S2 = 0."""
    first: int | None = 0
    second: int | None = None
    for row, b, d in zip(gamma, beta, delta, strict=True):
        second = recorder.combine((second, ONE), (first, d))
        first = recorder.combine((first, row[0]), (second, row[1]), (0, row[2]), (recorder.slope(first), b))


def _read_shu_osher(alpha: object, beta: object, names: tuple[str, ...]) -> Coefficients:
    rows = len(items(alpha, "alpha"))
    if rows < 2:
        raise IntegratorError(f"alpha must have one row for each stage and one for y_(n+1), but has {rows}")
    read: dict[str, Matrix] = {}
    for name, given in (("alpha", alpha), ("beta", beta)):
        read[name] = read_matrix(given, name, names, rows=rows, columns=rows - 1)
        for i, row in enumerate(read[name]):
            for j, x in enumerate(row[i:], i):
                if x != 0:
                    raise IntegratorError(
                        f"{name} must be zero in row i from column i on, but {name}[{i + 1}][{j + 1}] was {x}"
                    )
    return read


def _record_shu_osher(recorder: _Recorder, alpha: Matrix, beta: Matrix) -> None:
    """Y_i = (1 − Σ α_ij) y_n + Σ (α_ij Y_j + β_ij h f(Y_j)); y_{n+1} is the last row."""
    stages: list[int | None] = []
    slopes: list[int | None] = []
    domain = entries.find_domain(x for row in (*alpha, *beta) for x in row)
    for weights, factors in zip(alpha, beta, strict=True):
        rest = (ONE, *(multiply_entries(MINUS, x) for x in weights))
        of_start = Fraction(0) if entries.cancels(rest, entries.relative_error(domain, None)) else sum_entries(rest)
        terms = [*zip(stages, weights, strict=False), *zip(slopes, factors, strict=False)]
        stages.append(recorder.combine((0, of_start), *terms))
        if len(stages) < len(alpha):
            slopes.append(recorder.slope(stages[-1]))


FORMS: dict[str, tuple[Callable[..., Coefficients], Callable[..., None]]] = {
    "2N": (_read_2n, _record_2n),
    "2R": (_read_2r, _record_2r),
    "3S*": (_read_3s, _record_3s),
    "Shu-Osher": (_read_shu_osher, _record_shu_osher),
}
"""For each kind of form the reader of its coefficients and the recorder of its step."""


def read_form(data: Any, names: Iterable[str] = ()) -> RegisterForm:
    """A form from the data of a file: its kind, and its coefficients by name."""
    given = dict(data) if isinstance(data, Mapping) else {}
    kind = given.pop("kind", None)
    if kind not in FORMS:
        raise IntegratorError(f"form.kind must be one of {', '.join(FORMS)}, but was {shown(kind)}")
    wanted = FORMS[kind][1].__annotations__.keys() - {"recorder", "return"}
    if given.keys() != wanted:
        has = ", ".join(map(str, given)) or "none"
        raise IntegratorError(f"form must have the keys {', '.join(sorted(wanted))} besides kind, but had {shorten(has)}")
    return RegisterForm(kind, given, names)


class FromRegisters:
    """The constructors of Runge–Kutta methods from low-storage and Shu–Osher forms, which the method keeps."""

    form: RegisterForm | None = None

    @classmethod
    def from_form(cls, form: RegisterForm, **labels: Any) -> Self:
        """The method of a form, with the labels of a `RungeKutta`; the form is kept for stepping and for files."""
        domain = entries.find_domain(_flat(form.coefficients))
        *A, b = form.rows(entries.relative_error(domain, labels.get("digits")))
        method = cls(A, b, **labels)  # type: ignore[call-arg]
        method.__dict__["form"] = form
        return method

    @classmethod
    def _from_registers(cls, kind: str, labels: Labels, **given: object) -> Self:
        return cls.from_form(RegisterForm(kind, given, labels.get("parameters", ())), **labels)

    @classmethod
    def from_2n(cls, A: object, B: object, **labels: Unpack[Labels]) -> Self:
        """The method of Williamson's form in 2N storage: dU ← A_i dU + h f(U), U ← U + B_i dU for each stage i.

        Args:
            A, B: the coefficients; A_1 is 0.
            labels: parameters, name, reference and digits, as for `RungeKutta`.

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
    def from_2r(cls, a: object, b: object, **labels: Unpack[Labels]) -> Self:
        """The method in van der Houwen's form with two registers: a_ij = b_j for j < i − 1.

        Args:
            a: the entries a_21, a_32, … below the diagonal.
            b: the weights, one more.
            labels: parameters, name, reference and digits, as for `RungeKutta`.

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
    def from_3s_star(cls, gamma: object, beta: object, delta: object, **labels: Unpack[Labels]) -> Self:
        """The method of Ketcheson's form 3S* with three registers S1 = S3 = y_n and S2 = 0.

        For each stage S2 ← S2 + δ_i S1, and then S1 ← γ_i1 S1 + γ_i2 S2 + γ_i3 S3 + β_i h f(S1).

        Args:
            gamma: for each stage the three factors γ_i1, γ_i2, γ_i3.
            beta, delta: one coefficient for each stage.
            labels: parameters, name, reference and digits, as for `RungeKutta`.

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
    def from_shu_osher(cls, alpha: object, beta: object, **labels: Unpack[Labels]) -> Self:
        """The method of a Shu–Osher form Y_i = (1 − Σ_j α_ij) y_n + Σ_{j<i} (α_ij Y_j + β_ij h f(Y_j)).

        Args:
            alpha, beta: one row for each stage, of which the first is zero, and a last one for y_{n+1}.
            labels: parameters, name, reference and digits, as for `RungeKutta`.

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


def to_2n(method: RungeKutta) -> tuple[EntryRow, EntryRow]:
    """The coefficients A and B of Williamson's form in 2N storage, from which `RungeKutta.from_2n` makes the method.

    With rows a_i of the tableau, of which the last is b, the conditions are a_(i+1)j − a_ij = B_i A_i ⋯ A_(j+1).

    Args:
        method: an explicit Runge–Kutta method.

    Returns:
        The rows A and B.

    Raises:
        IntegratorError: the method is implicit, or does not satisfy a condition, which is named.

    Example:
        >>> import bseries as bs
        >>> A, B = bs.methods.to_2n(bs.method("williamson3"))
        >>> [str(a) for a in A], [str(b) for b in B]
        (['0', '-5/9', '-153/128'], ['1/3', '15/16', '8/15'])
        >>> bs.methods.to_2n(bs.method("rk4"))
        Traceback (most recent call last):
            ...
        bseries_base.errors.IntegratorError: method must satisfy a_(i+1)j - a_ij = B_i A_i ... A_(j+1), but for i = 3, j = 1 the left side was 0 and the right 1/2

    References:
        J. H. Williamson, J. Comput. Phys. 35 (1980) 48–56, doi:10.1016/0021-9991(80)90033-9.
    """
    if not getattr(method, "is_explicit", False) or not hasattr(method, "algebra"):
        raise IntegratorError(f"method must be an explicit RungeKutta, but was {shorten(repr(method))}")
    rows = (*method.A, method.b)
    A: list[Entry] = [Fraction(0)]
    B: list[Entry] = []
    for i in range(method.stages):
        B.append(rows[i + 1][i])
        if entries.cancels((B[i],), method.precision) is not False:
            row = f"a_{i + 2},{i + 1}" if i + 1 < method.stages else f"b_{i + 1}"
            raise IntegratorError(f"method must have B_{i + 1} = {row} other than 0 to be in 2N form, but it was {B[i]}")
        product = B[i]
        for j in reversed(range(i)):
            change = sum_entries((rows[i + 1][j], multiply_entries(MINUS, rows[i][j])))
            if j == i - 1:
                A.append(_quotient(change, B[i]))
            product = multiply_entries(product, A[j + 1])
            if entries.cancels((rows[i + 1][j], -rows[i][j], -product), method.precision) is not True:
                raise IntegratorError(
                    "method must satisfy a_(i+1)j - a_ij = B_i A_i ... A_(j+1), but for "
                    f"i = {i + 1}, j = {j + 1} the left side was {shorten(format_number(change))} and the right "
                    f"{shorten(format_number(product))}"
                )
    return tuple(A), tuple(B)


def _quotient(x: Entry, y: Entry) -> Entry:
    """x / y, in a normal form."""
    if not (entries.is_sympy(x) or entries.is_sympy(y)):
        return x / y
    import sympy

    return entries.read_entry(sympy.radsimp(sympy.cancel(sympy.sympify(x) / sympy.sympify(y))), "A", entries.symbol_names((x, y)))
