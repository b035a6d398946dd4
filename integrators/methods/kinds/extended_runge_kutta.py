"""Extensions of Runge–Kutta methods: second derivatives, continuous stages, own stages of parts, Lawson, Rosenbrock."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any, Self, Unpack

from bseries_base.errors import shown
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.exact.entries import Entry, EntryRow, Matrix, multiply_entries, read_entry, sum_entries
from integrators.methods.programs import builder as read
from integrators.methods.programs.builder import Labels, ProgramBuilder, ProgramMethod
from integrators.methods.programs.evaluations import LinearForm, combination
from integrators.methods.tableaux.runge_kutta import RungeKutta


class TwoDerivativeRungeKutta(ProgramMethod):
    """A two-derivative Runge–Kutta method.

    With g = f' f, the second derivative of solutions, the stages are
    Y_i = y + h Σ_j a_ij f(Y_j) + h² Σ_j â_ij g(Y_j), and y1 = y + h Σ_i b_i f(Y_i) + h² Σ_i b̂_i g(Y_i).

    Args:
        A, A_hat: the matrices a_ij and â_ij, by rows.
        b, b_hat: the weights b_i and b̂_i.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: sizes that do not match, or an invalid entry.

    Example:
        Taylor's method of order 2:

        >>> import bseries as bs
        >>> print(bs.methods.TwoDerivativeRungeKutta([[0]], [[0]], [1], ["1/2"]))
        k1 = h f(y)
        k2 = h f'(y) (k1)
        y1 = y + k1 + 1/2*k2

    References:
        R. P. K. Chan, A. Y. J. Tsai, Numer. Algorithms 53 (2010) 171–194, doi:10.1007/s11075-009-9349-1.
    """

    A: Matrix
    A_hat: Matrix
    b: EntryRow
    b_hat: EntryRow

    def __init__(self, A: object, A_hat: object, b: object, b_hat: object, **labels: Unpack[Labels]) -> None:
        self._set(read.read_stages({"b": b, "b_hat": b_hat}, {"A": A, "A_hat": A_hat}, labels), **labels)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        registers = builder.unknowns(2 * self.stages)
        first, second = registers[::2], registers[1::2]
        for i, (k, derivative) in enumerate(zip(first, second, strict=True)):
            at = builder.y + combination(self.A[i], first) + combination(self.A_hat[i], second)
            builder.field(at, into=k)
            builder.derivative(at, k, into=derivative)
        return builder.y + combination(self.b, first) + combination(self.b_hat, second)


class ContinuousStageRungeKutta(ProgramMethod):
    """A Runge–Kutta method with a stage for every τ in [0, 1], given by polynomials.

    The stages are Y_τ = y0 + h ∫₀¹ A_τσ f(Y_σ) dσ with A_τσ = Σ_ij M[i][j] τ^i σ^j, and y1 = y0 + h ∫₀¹ B_σ f(Y_σ) dσ
    with B_σ = Σ_j B[j] σ^j. By default y1 = Y_1, so B_σ = A_1σ.

    Args:
        M: the coefficients of A_τσ: rows are powers of τ, columns powers of σ, both from 0.
        B: the coefficients of B_σ; the column sums of M if None.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: sizes that do not match, or an invalid entry.

    Example:
        The averaged vector field method, y1 = y0 + h ∫ f((1−θ) y0 + θ y1) dθ, has A_τσ = τ:

        >>> import bseries as bs
        >>> print(bs.methods.ContinuousStageRungeKutta([[0], [1]]))
        k1 = ∫ h f(y + θ (k1)) dθ
        y1 = y + k1

    References:
        E. Hairer, JNAIAM 5 (2010) 73–84 (energy-preserving variant of collocation methods);
        Y. Miyatake, J. C. Butcher, SIAM J. Numer. Anal. 54 (2016) 1993–2013, doi:10.1137/15M1020861.
    """

    M: Matrix
    B: EntryRow

    def __init__(self, M: object, B: object = None, **labels: Unpack[Labels]) -> None:
        symbols, rows = tuple(labels.get("parameters", ())), items(M, "M")
        columns = len(items(rows[0], "M[1]")) if rows else 0
        matrix = read.read_matrix(rows, "M", symbols, rows=max(len(rows), 1), columns=columns)
        sums = map(sum_entries, zip(*matrix, strict=True))
        weights = sums if B is None else read.read_row(B, "B", symbols, count=columns)
        self._set({"B": tuple(weights), "M": matrix}, **labels)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        averages = builder.unknowns(len(self.B))
        start, *path = (combination(row, averages) for row in self.M)
        for power, average in enumerate(averages):
            builder.average([builder.y + start, *path], power=power, into=average)
        return builder.y + combination(self.B, averages)


class GeneralizedAdditiveRungeKutta(ProgramMethod):
    """A generalised additive Runge–Kutta (GARK) method for y' = Σ_ν f^ν(y).

    Part ν has s_ν stages Y^ν_i = y + h Σ_μ Σ_j a^νμ_ij f^μ(Y^μ_j), and y1 = y + h Σ_ν Σ_i b^ν_i f^ν(Y^ν_i). With equal
    numbers of stages and A^νμ = A^μ for all ν it is an additive method, a `PartitionedRungeKutta`.

    Args:
        A: the blocks A[ν][μ] with s_ν rows of s_μ entries; omitted blocks are zero.
        b: the weights b[ν] with s_ν entries. The order of its names is that of the colours 0, 1, …, with p before q.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: fewer than two parts, a bad name, sizes that do not match, or an invalid entry.

    Example:
        Part p at both ends of the step, part q in the middle:

        >>> import bseries as bs
        >>> verlet = bs.methods.GeneralizedAdditiveRungeKutta(
        ...     {"p": {"q": [[0], [1]]}, "q": {"p": [["1/2", 0]]}}, {"p": ["1/2", "1/2"], "q": [1]}
        ... )
        >>> print(verlet)
        k1 = h f_p(y)
        k2 = h f_p(y + k3)
        k3 = h f_q(y + 1/2*k1)
        y1 = y + 1/2*k1 + 1/2*k2 + k3

    References:
        A. Sandu, M. Günther, SIAM J. Numer. Anal. 53 (2015) 17–42, doi:10.1137/130943224.
    """

    A: tuple[tuple[Matrix, ...], ...]
    b: tuple[EntryRow, ...]

    def __init__(
        self, A: Mapping[str, Mapping[str, object]], b: Mapping[str, object], **labels: Unpack[Labels]
    ) -> None:  # fmt: skip
        if not isinstance(b, Mapping):
            raise IntegratorError(f"b must map names of parts to weights, but was {shown(b)}")
        parts, symbols = read.in_color_order(read.read_parts(list(b))), tuple(labels.get("parameters", ()))
        weights = {part: read.read_row(b[part], f"b[{part}]", symbols) for part in parts}
        _check_keys(A, "A", parts)
        for part, row in A.items():
            _check_keys(row, f"A[{part}]", parts)

        def block(part: str, other: str) -> Matrix:
            rows, columns = len(weights[part]), len(weights[other])
            given = A.get(part, {}).get(other, [[0] * columns] * rows)
            return read.read_matrix(given, f"A[{part}][{other}]", symbols, rows=rows, columns=columns)

        blocks = tuple(tuple(block(part, other) for other in parts) for part in parts)
        self._set({"A": blocks, "b": tuple(weights.values())}, parts=parts, **labels)

    @property
    def stages(self) -> int:
        """The number of stages of all parts."""
        return sum(map(len, self.b))

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        k = [builder.unknowns(len(weights)) for weights in self.b]
        end = builder.y
        for part, increments, blocks, weights in zip(self.names, k, self.A, self.b, strict=True):
            for i, increment in enumerate(increments):
                at = sum((combination(block[i], other) for block, other in zip(blocks, k, strict=True)), builder.y)
                builder.field(at, part, into=increment)
            end = end + combination(weights, increments)
        return end


def _check_keys(blocks: object, argument: str, parts: Iterable[str]) -> None:
    if not isinstance(blocks, Mapping):
        raise IntegratorError(f"{argument} must map names of parts to blocks, but was {shown(blocks)}")
    for key in blocks:
        if key not in parts:
            raise IntegratorError(f"{argument} must be given for {', '.join(parts)}, but one was {shown(key)}")


class LawsonMethod(ProgramMethod):
    """A Lawson method (integrating factor method) for y' = L y + N(y).

    It applies a Runge–Kutta method to v(t) = exp(−tL) y(t). In terms of y:
    Y_i = exp(c_i h L) y0 + h Σ_j a_ij exp((c_i − c_j) h L) N(Y_j), and
    y1 = exp(h L) y0 + h Σ_j b_j exp((1 − c_j) h L) N(Y_j).

    The first part of the field must be linear: its nodes in trees have at most one child.

    Args:
        tableau: an explicit Runge–Kutta method.
        parts: the names of the linear and of the nonlinear part.
        name, reference: as for `Splitting`.

    Raises:
        IntegratorError: `tableau` is not an explicit `RungeKutta`, or a name is invalid.

    Example:
        The Lawson–Euler method y1 = exp(hL) (y0 + h N(y0)):

        >>> import bseries as bs
        >>> print(bs.methods.LawsonMethod(bs.RungeKutta([[0]], [1])))
        k1 = h f_N(y)
        k2 = z(1) - z(0), z' = h f_L(z), z(0) = y + k1
        y1 = y + k1 + k2

    References:
        J. D. Lawson, SIAM J. Numer. Anal. 4 (1967) 372–380, doi:10.1137/0704033; M. Hochbruck, A. Ostermann,
        Acta Numerica 19 (2010) 209–286, doi:10.1017/S0962492910000048.
    """

    tableau: RungeKutta

    def __init__(
        self, tableau: RungeKutta, *, parts: Sequence[str] = ("L", "N"), name: str | None = None,
        reference: str | None = None,
    ) -> None:  # fmt: skip
        if not isinstance(tableau, RungeKutta) or not tableau.is_explicit:
            raise IntegratorError(f"tableau must be an explicit RungeKutta, but was {shown(tableau)}")
        labels = {"name": name, "reference": reference, "digits": tableau.digits}
        self._set({"tableau": tableau}, parts=read.read_parts(parts, count=2), **labels)

    @property
    def stages(self) -> int:
        """The number of stages."""
        return self.tableau.stages

    max_children = (1, 1, 1), (None, None, None)  # L y is linear

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        tableau, y = self.tableau, builder.y
        known: dict[tuple[LinearForm, Entry], LinearForm] = {}
        k: list[LinearForm] = []

        def flow(at: LinearForm, time: Entry) -> LinearForm:
            """exp(time·hL) at."""
            if time == 0:
                return at
            if (at, time) not in known:
                known[at, time] = builder.flow(at, self.names[0], time=time)
            return at + known[at, time]

        def point(time: Entry, weights: Sequence[Entry]) -> LinearForm:
            """exp(time·hL) y + Σ_j weights[j] exp((time − c_j)·hL) k_j, one flow for each node."""
            vectors: dict[Entry, LinearForm] = {}
            for x, node, vector in zip(weights, tableau.c, k, strict=False):
                if x != 0:
                    vectors[node] = vectors.get(node, 0) + vector.times(x)
            total = flow(y + vectors.pop(Fraction(0), 0 * y), time)
            for node, vector in vectors.items():
                elapsed = sum_entries((time, multiply_entries(node, Fraction(-1))))
                # exp(tL) v = exp(tL) (y + v) − exp(tL) y, as L is linear
                total = total + flow(y + vector, elapsed) - flow(y, elapsed)
            return total

        for row, c in zip(tableau.A, tableau.c, strict=True):
            k.append(builder.field(point(c, row), self.names[1]))
        return point(Fraction(1), tableau.b)


class Rosenbrock(ProgramMethod):
    """A Rosenbrock method with the exact Jacobian J = f'(y0).

    The stages are k_i = h f(y0 + Σ_{j<i} α_ij k_j) + h J Σ_{j≤i} γ_ij k_j, and y1 = y0 + Σ_i b_i k_i.

    Args:
        alpha, gamma: the matrices α_ij, strictly lower triangular, and γ_ij, lower triangular, by rows.
        b: the weights b_i.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: sizes that do not match, an invalid entry, or a nonzero entry above the diagonal.

    Example:
        The linearly implicit Euler method:

        >>> import bseries as bs
        >>> print(bs.methods.Rosenbrock([[0]], [[1]], [1]))
        k1 = h f(y)
        k2 = h f'(y) (k1 + k2)
        y1 = y + k1 + k2

    References:
        E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, IV.7, formula (7.4).
    """

    alpha: Matrix
    gamma: Matrix
    b: EntryRow

    _parts: tuple[str | None, str | None] = (None, None)
    """The part of the field and the part of the Jacobian."""

    def __init__(self, alpha: object, gamma: object, b: object, **labels: Unpack[Labels]) -> None:
        self._set(self._read(alpha, gamma, b, labels), **labels)

    @staticmethod
    def _read(alpha: object, gamma: object, b: object, labels: Labels) -> dict[str, Any]:
        coefficients = read.read_stages({"b": b}, {"alpha": alpha, "gamma": gamma}, labels)
        _check_triangular(coefficients, "alpha", strictly=True)
        _check_triangular(coefficients, "gamma", strictly=False)
        return coefficients

    @classmethod
    def from_transformed(cls, a: object, c: object, m: object, gamma: object, **labels: Any) -> Self:
        """The method from the transformed coefficients of implementations that avoid products with the Jacobian.

        With u_i = Σ_j γ_ij k_j, and γ_ii = γ, the stages are
        (1/(hγ) I − J) u_i = f(y0 + Σ_{j<i} a_ij u_j) + Σ_{j<i} (c_ij/h) u_j, and y1 = y0 + Σ_i m_i u_i.

        Args:
            a: the strictly lower triangular matrix a_ij = (α Γ⁻¹)_ij, by rows.
            c: the matrix c_ij below the diagonal: Γ⁻¹ = I/γ − (c_ij).
            m: the weights m = b Γ⁻¹.
            gamma: the number γ.
            labels: further arguments of the class, by name.

        Example:
            >>> import bseries as bs
            >>> rodas3 = bs.methods.Rosenbrock.from_transformed(
            ...     [[0, 0, 0, 0], [0, 0, 0, 0], [2, 0, 0, 0], [2, 0, 1, 0]],
            ...     [[0, 0, 0, 0], [4, 0, 0, 0], [1, -1, 0, 0], [1, -1, "-8/3", 0]], [2, 0, 1, 1], "1/2")
            >>> [str(b) for b in rodas3.b]
            ['5/6', '-1/6', '-1/6', '1/2']

        References:
            E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, IV.7, formula (7.25).
        """
        labels["parameters"] = tuple(labels.get("parameters", ()))
        given = read.read_stages({"m": m}, {"a": a, "c": c}, labels)  # type: ignore[arg-type]
        _check_triangular(given, "a", strictly=True)
        _check_triangular(given, "c", strictly=True)
        number = read_entry(gamma, "gamma", labels["parameters"])
        inverse: list[list[Entry]] = []  # Γ, row by row, from (I/γ − C) Γ = I
        for i, row in enumerate(given["c"]):
            unit = [Fraction(int(i == j)) for j in range(len(given["m"]))]
            inverse.append([multiply_entries(number, x) for x in _row_times((1, *row), (unit, *inverse))])
        alpha = [_row_times(row, inverse) for row in given["a"]]
        return cls(alpha, inverse, _row_times(given["m"], inverse), **labels)

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        part, jacobian = self._parts
        registers = builder.unknowns(2 * self.stages)
        k = [field + product for field, product in zip(registers[::2], registers[1::2], strict=True)]
        for i in range(self.stages):
            builder.field(builder.y + combination(self.alpha[i], k), part, into=registers[2 * i])
            builder.derivative(builder.y, combination(self.gamma[i], k), jacobian, into=registers[2 * i + 1])
        return builder.y + combination(self.b, k)


class WMethod(Rosenbrock):
    """A W-method: a Rosenbrock method with an arbitrary matrix W in place of the Jacobian.

    The stages are k_i = h f(y0 + Σ_{j<i} α_ij k_j) + h W Σ_{j≤i} γ_ij k_j, and y1 = y0 + Σ_i b_i k_i. W is the
    Jacobian of an auxiliary linear part W y, whose nodes in trees have one child each. The method has order p for every
    W if, up to order p, the coefficients of trees without such nodes are those of the exact flow, and those of all
    other trees vanish.

    Args:
        alpha, gamma, b: as for `Rosenbrock`.
        parts: the names of the field and of the auxiliary part.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: sizes that do not match, an invalid entry, or a nonzero entry above the diagonal.

    Example:
        >>> import bseries as bs
        >>> print(bs.methods.WMethod([[0]], [[1]], [1]))
        k1 = h f_f(y)
        k2 = h f_W'(y) (k1 + k2)
        y1 = y + k1 + k2

    References:
        T. Steihaug, A. Wolfbrandt, Math. Comp. 33 (1979) 521–534, doi:10.1090/S0025-5718-1979-0521273-8;
        E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, IV.7.
    """

    def __init__(
        self, alpha: object, gamma: object, b: object, *, parts: Sequence[str] = ("f", "W"), **labels: Unpack[Labels]
    ) -> None:  # fmt: skip
        names = read.read_parts(parts, count=2)
        self._set(self._read(alpha, gamma, b, labels), parts=names, **labels)
        self.__dict__.update(_parts=names, _auxiliary=names[1:])

    max_children = (None, None, None), (1, 1, 1)  # W y is linear


def _check_triangular(coefficients: Mapping[str, Matrix], key: str, *, strictly: bool) -> None:
    """Refuse nonzero entries above the diagonal, or on and above it if `strictly`."""
    for i, row in enumerate(coefficients[key]):
        for j in range(i + (not strictly), len(row)):
            if row[j] != 0:
                shape = f"{'strictly ' * strictly}lower triangular"
                raise IntegratorError(f"{key} must be {shape}, but {key}[{i + 1}][{j + 1}] was {row[j]!s:.60}")


def _row_times(row: Sequence[Entry], matrix: Sequence[Sequence[Entry]]) -> list[Entry]:
    """A row vector times a matrix; entries beyond the last row of the matrix are ignored."""
    columns = zip(*matrix, strict=True)
    return [sum_entries(multiply_entries(x, y) for x, y in zip(row, column, strict=False)) for column in columns]
