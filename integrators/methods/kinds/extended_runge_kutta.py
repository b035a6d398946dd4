"""Extensions of Runge–Kutta methods: second derivatives, continuous stages, stages for each part, Lawson methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

from integrators.core.arguments import items
from integrators.core.errors import IntegratorError, shown
from integrators.exact.entries import Entry, multiply_entries, sum_entries
from integrators.methods.programs.builder import ProgramBuilder, ProgramMethod, read_parts
from integrators.methods.programs.evaluations import LinearForm, combination
from integrators.methods.tableaux.runge_kutta import RungeKutta
from integrators.methods.tableaux.tableau_input import EntryRow, Matrix, in_color_order, read_matrix, read_row


class TwoDerivativeRungeKutta(ProgramMethod):
    """A two-derivative Runge–Kutta method.

    With g = f' f, the second derivative of solutions, the stages are
    Y_i = y + h Σ_j a_ij f(Y_j) + h² Σ_j â_ij g(Y_j), and y1 = y + h Σ_i b_i f(Y_i) + h² Σ_i b̂_i g(Y_i).

    Args:
        A: the matrix a_ij by rows.
        A_hat: the matrix â_ij by rows.
        b: the weights b_i.
        b_hat: the weights b̂_i.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: sizes that do not match, or an invalid entry.

    Example:
        Taylor's method of order 2:

        >>> print(TwoDerivativeRungeKutta([[0]], [[0]], [1], ["1/2"]))
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

    def __init__(
        self, A: Any, A_hat: Any, b: Any, b_hat: Any, *, parameters: Iterable[str] = (), name: str | None = None,
        reference: str | None = None, digits: int | None = None,
    ) -> None:  # fmt: skip
        symbols = tuple(parameters)
        weights = read_row(b, "b", symbols)
        stages = len(weights)
        coefficients = {
            "A": read_matrix(A, "A", symbols, rows=stages, columns=stages),
            "A_hat": read_matrix(A_hat, "A_hat", symbols, rows=stages, columns=stages),
            "b": weights,
            "b_hat": read_row(b_hat, "b_hat", symbols, count=stages),
        }
        self._set(coefficients, name=name, reference=reference, digits=digits)

    @property
    def stages(self) -> int:
        """The number of stages."""
        return len(self.b)

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

        >>> print(ContinuousStageRungeKutta([[0], [1]]))
        k1 = ∫ h f(y + θ (k1)) dθ
        y1 = y + k1

    References:
        E. Hairer, JNAIAM 5 (2010) 73–84 (energy-preserving variant of collocation methods);
        Y. Miyatake, J. C. Butcher, SIAM J. Numer. Anal. 54 (2016) 1993–2013, doi:10.1137/15M1020861.
    """

    M: Matrix
    B: EntryRow

    def __init__(
        self, M: Any, B: Any = None, *, parameters: Iterable[str] = (), name: str | None = None,
        reference: str | None = None, digits: int | None = None,
    ) -> None:  # fmt: skip
        symbols = tuple(parameters)
        rows = items(M, "M")
        columns = len(items(rows[0], "M[1]")) if rows else 0
        matrix = read_matrix(rows, "M", symbols, rows=max(len(rows), 1), columns=columns)
        weights = map(sum_entries, zip(*matrix, strict=True)) if B is None else read_row(B, "B", symbols, count=columns)
        self._set({"M": matrix, "B": tuple(weights)}, name=name, reference=reference, digits=digits)

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

        >>> verlet = GeneralizedAdditiveRungeKutta(
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
        self, A: Mapping[str, Mapping[str, Any]], b: Mapping[str, Any], *, parameters: Iterable[str] = (),
        name: str | None = None, reference: str | None = None, digits: int | None = None,
    ) -> None:  # fmt: skip
        if not isinstance(b, Mapping):
            raise IntegratorError(f"b must map names of parts to weights, but was {shown(b)}")
        parts, symbols = in_color_order(read_parts(list(b))), tuple(parameters)
        weights = tuple(read_row(b[part], f"b[{part}]", symbols) for part in parts)
        sizes = dict(zip(parts, map(len, weights), strict=True))
        _check_keys(A, "A", parts)
        for part, row in A.items():
            _check_keys(row, f"A[{part}]", parts)
        blocks = tuple(
            tuple(
                read_matrix(
                    A.get(part, {}).get(other, [[0] * sizes[other]] * sizes[part]),
                    f"A[{part}][{other}]",
                    symbols,
                    rows=sizes[part],
                    columns=sizes[other],
                )
                for other in parts
            )
            for part in parts
        )
        self._set({"A": blocks, "b": weights}, parts=parts, name=name, reference=reference, digits=digits)

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
        name: the name in messages.
        reference: the source.

    Raises:
        IntegratorError: `tableau` is not an explicit `RungeKutta`, or a name is invalid.

    Example:
        The Lawson–Euler method y1 = exp(hL) (y0 + h N(y0)):

        >>> print(LawsonMethod(RungeKutta([[0]], [1])))
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
        self._set({"tableau": tableau}, parts=read_parts(parts, count=2), **labels)

    @property
    def stages(self) -> int:
        """The number of stages."""
        return self.tableau.stages

    max_children = (1, 1, 1), (None, None, None)  # L y is linear

    def _lower(self, builder: ProgramBuilder) -> LinearForm:
        tableau = self.tableau
        propagator = _Propagator(builder, self.names[0])
        k: list[LinearForm] = []
        for row, c in zip(tableau.A, tableau.c, strict=True):
            k.append(builder.field(propagator.point(c, row, tableau.c, k), self.names[1]))
        return propagator.point(Fraction(1), tableau.b, tableau.c, k)


class _Propagator:
    """Propagation of points and vectors by the flow of the linear part."""

    def __init__(self, builder: ProgramBuilder, part: str) -> None:
        self._builder, self._part = builder, part
        self._known: dict[tuple[LinearForm, Entry], LinearForm] = {}

    def point(
        self, time: Entry, weights: Sequence[Entry], nodes: Sequence[Entry], k: Sequence[LinearForm]
    ) -> LinearForm:
        """exp(time·hL) y + Σ_j weights[j] exp((time − nodes[j])·hL) k_j, one flow for each node."""
        vectors: dict[Entry, LinearForm] = {}
        for x, node, vector in zip(weights, nodes, k, strict=False):
            if x != 0:
                vectors[node] = vectors.get(node, 0) + vector.times(x)
        y = self._builder.y
        total = self._flow(y + vectors.pop(Fraction(0), 0 * y), time)
        for node, vector in vectors.items():
            elapsed = sum_entries((time, multiply_entries(node, Fraction(-1))))
            # exp(tL) v = exp(tL) (y + v) − exp(tL) y, as L is linear
            total = total + self._flow(y + vector, elapsed) - self._flow(y, elapsed)
        return total

    def _flow(self, at: LinearForm, time: Any) -> LinearForm:
        """exp(time·hL) at."""
        if time == 0:
            return at
        if (at, time) not in self._known:
            self._known[at, time] = self._builder.flow(at, self._part, time=time)
        return at + self._known[at, time]
