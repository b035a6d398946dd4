"""Methods with memory: linear multistep, general linear and two-step Runge–Kutta methods, with exact coefficients.

They are no one-step methods and have no program; `bseries` reads the underlying one-step method from the coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cached_property
from math import factorial
from typing import Any, ClassVar, Unpack, cast

from bseries_base.errors import shorten, shown
from bseries_base.table import Column, Document, Table
from integrators.core.arguments import items
from integrators.core.errors import IntegratorError
from integrators.exact import polynomials
from integrators.exact.arithmetic import in_sympy, simplest
from integrators.exact.entries import (
    Entry,
    EntryRow,
    Matrix,
    certainly_differs,
    divide_entries,
    find_domain,
    flat_entries,
    multiply_entries,
    sum_entries,
    symbol_names,
)
from integrators.exact.expressions import format_number
from integrators.methods.kinds import root_conditions
from integrators.methods.kinds.root_conditions import ParasiticMode
from integrators.methods.programs.builder import Labels, ProgramMethod, read_matrix, read_row
from integrators.methods.programs.program import Program

ZERO, ONE = Fraction(0), Fraction(1)


class MethodWithMemory(ProgramMethod):
    """A method whose step reads several numbers of its past: the base class of the kinds in this file.

    Series, verdicts on structure and modified equations are those of its underlying one-step method.
    """

    kind: ClassVar[str]

    def _set_exactly(self, coefficients: dict[str, Any], labels: Labels) -> None:
        entries = flat_entries(tuple(coefficients.values()))
        for x in entries:
            if isinstance(x, float):
                raise IntegratorError(f"coefficients must be exact, fractions or text, but one was {x}")
        if (digits := labels.get("digits")) is not None:
            raise IntegratorError(f"digits must be left out for a method with memory, but was {shown(digits)}")
        self._set(coefficients, **labels)
        self.__dict__.update(domain=find_domain(entries), parameters=symbol_names(entries), max_children=None)

    @property
    def program(self) -> Program:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Refused: a step needs more than one number of the past."""
        raise IntegratorError(
            f"method must be a one-step method here, but {self.name} has memory; series, check and memory read its "
            "underlying one-step method"
        )

    @cached_property
    def coefficients(self) -> dict[str, Any]:
        """The coefficients by name, as in files."""
        raise NotImplementedError

    def to_dict(self) -> Document:
        """The method as plain data, from which `load_method` reads an equal one."""

        def text(value: Any) -> Any:
            return [text(x) for x in value] if isinstance(value, tuple) else format_number(value)

        data: dict[str, Any] = {"schema": 1, "kind": self.kind, "name": self.name}
        data |= {key: text(value) for key, value in self.coefficients.items()}
        if self.parameters:
            data["parameters"] = list(self.parameters)
        return data if self.reference is None else data | {"reference": self.reference}

    def to_table(self) -> Table:
        """The coefficients, row by row."""
        rows = []
        for key, value in self.coefficients.items():
            row = value if isinstance(value, tuple) else (value,)
            nested = row if isinstance(row[0], tuple) else (row,)
            rows += [(key if i == 0 else "", ", ".join(map(format_number, row))) for i, row in enumerate(nested)]
        return Table(self.name, [Column("name"), Column("coefficients")], rows, self.remarks, data=self.to_dict)

    def __str__(self) -> str:
        return self.to_table().to_text()

    issues: tuple[str, ...] = ()  # type: ignore[assignment]  # contradictions are refused


class LinearMultistep(MethodWithMemory):
    """A linear multistep method Σ_j α_j y_{n+j} = h Σ_j β_j f(y_{n+j}), j = 0 … k.

    ρ(ζ) = Σ α_j ζ^j and σ(ζ) = Σ β_j ζ^j are its generating polynomials.

    Args:
        alpha, beta: The coefficients, k + 1 each, ascending in j.
        rescaled: Allow ρ'(1) ≠ σ(1). The method then solves y' = σ(1)/ρ'(1) f(y): the coefficient of the single node is
            that factor, and order and stability are those of the method for this field.
        parameters, name, reference: As for `Splitting`.

    Raises:
        IntegratorError: A coefficient is invalid, ρ(1) ≠ 0, ρ'(1) = 0, or ρ'(1) ≠ σ(1) where no rescaling is asked for.

    Example:
        >>> import bseries as bs
        >>> leapfrog = bs.LinearMultistep([-1, 0, 1], [0, 2, 0], name="leapfrog")
        >>> leapfrog.order, leapfrog.error_constant, leapfrog.zero_stable
        (2, Fraction(1, 6), True)
        >>> [(mode.root, mode.growth) for mode in leapfrog.growth_parameters]
        [((-1+0j), (-1+0j))]

    References:
        Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I*, chapter III; HLW, chapter XV.
    """

    kind = "linear-multistep"
    alpha: EntryRow
    beta: EntryRow
    rescaled: bool

    def __init__(self, alpha: object, beta: object, *, rescaled: bool = False, **labels: Unpack[Labels]) -> None:
        symbols = labels["parameters"] = tuple(labels.get("parameters", ()))
        alpha = read_row(alpha, "alpha", symbols)
        beta = read_row(beta, "beta", symbols, count=len(alpha))
        if not isinstance(rescaled, bool):
            raise IntegratorError(f"rescaled must be True or False, but was {shown(rescaled)}")
        if len(alpha) < 2 or alpha[-1] == 0:
            raise IntegratorError(f"alpha must have at least two entries, the last not zero, but was {_text(alpha)}")
        self._set_exactly({"alpha": alpha, "beta": beta, "rescaled": rescaled}, labels)
        total, slope, sigma = sum_entries(alpha), self._derivative_at_one, sum_entries(beta)
        if certainly_differs(total, 0, 0):
            raise IntegratorError(f"alpha must sum to 0, so that ρ(1) = 0, but sums to {_text([total])}")
        if slope == 0 or sigma == 0:
            raise IntegratorError(
                f"alpha and beta must have ρ'(1) and σ(1) different from 0, but have {_text([slope, sigma])}"
            )
        if not rescaled and certainly_differs(sum_entries([slope, -sigma]), 0, 0):
            raise IntegratorError(
                f"alpha and beta must satisfy ρ'(1) = σ(1) unless rescaled=True, but have {_text([slope, sigma])}"
            )

    @cached_property
    def coefficients(self) -> dict[str, Any]:
        """The coefficients by name, as in files."""
        return {"alpha": self.alpha, "beta": self.beta}

    def to_dict(self) -> Document:
        """The method as plain data, from which `load_method` reads an equal one."""
        return super().to_dict() | ({"rescaled": True} if self.rescaled else {})

    @property
    def steps(self) -> int:
        """The number k of steps."""
        return len(self.alpha) - 1

    @property
    def stages(self) -> int:
        """The number of evaluations of the field in a step: one, as earlier ones are kept."""
        return 1

    @property
    def is_explicit(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether β_k = 0."""
        return self.beta[-1] == 0

    @cached_property
    def _derivative_at_one(self) -> Entry:
        return sum_entries(multiply_entries(Fraction(j), a) for j, a in enumerate(self.alpha))

    @cached_property
    def rescaling(self) -> Entry:
        """The factor σ(1)/ρ'(1) of the field that the method solves; 1 unless it is `rescaled`."""
        return divide_entries(sum_entries(self.beta), self._derivative_at_one) if self.rescaled else ONE

    @cached_property
    def _order_and_constant(self) -> tuple[int, Entry]:
        beta = [divide_entries(b, self.rescaling) for b in self.beta]
        sigma = sum_entries(beta)
        for q in range(2, 2 * self.steps + 3):  # a method with k steps has at most order 2k
            terms = [multiply_entries(Fraction(j**q), a) for j, a in enumerate(self.alpha)]
            terms += [multiply_entries(Fraction(-q * j ** (q - 1)), b) for j, b in enumerate(beta)]
            total = sum_entries(terms)
            if certainly_differs(total, 0, 0):
                return q - 1, divide_entries(total, multiply_entries(Fraction(factorial(q)), sigma))
        raise IntegratorError(f"alpha and beta must have no common factor, but those of {self.name} have")

    @property
    def order(self) -> int:
        """The order p: Σ α_j j^q = q Σ β_j j^(q−1) for q ≤ p."""
        return self._order_and_constant[0]

    @property
    def error_constant(self) -> Entry:
        """C = (Σ α_j j^(p+1) − (p+1) Σ β_j j^p) / ((p+1)! σ(1)), which does not change if α and β are multiplied."""
        return self._order_and_constant[1]

    @property
    def is_symmetric(self) -> bool:
        """Whether α_{k−j} = −α_j and β_{k−j} = β_j: then the underlying one-step method is symmetric."""
        pairs = zip((*self.alpha, *self.beta), (*(-a for a in self.alpha[::-1]), *self.beta[::-1]), strict=True)
        return not any(certainly_differs(sum_entries([x, -y]), 0, 0) for x, y in pairs)

    @cached_property
    def roots(self) -> tuple[complex, ...]:
        """The roots of ρ, each as often as its multiplicity; largest first, 1 before the others of modulus 1."""
        return root_conditions.roots(self.alpha)

    @cached_property
    def zero_stable(self) -> bool:
        """Whether all roots of ρ have modulus at most 1, and those of modulus 1 are simple; decided exactly."""
        return root_conditions.satisfies_root_condition(self.alpha)

    @cached_property
    def growth_parameters(self) -> tuple[ParasiticMode, ...]:
        """The parasitic modes: the simple roots ζ ≠ 1 of ρ of modulus 1, with μ = σ(ζ)/(ζ ρ'(ζ))."""
        return root_conditions.parasitic_modes(self.alpha, [divide_entries(b, self.rescaling) for b in self.beta])

    @cached_property
    def stability_angle(self) -> float | None:
        """The largest α, in degrees, for which the method is A(α)-stable; None if there is none.

        Raises:
            IntegratorError: The coefficients are not rational.

        Example:
            >>> import bseries as bs
            >>> round(bs.memory.bdf(3).stability_angle, 10)
            86.0323668602
        """
        return root_conditions.stability_angle(self.alpha, self.beta)

    def to_general_linear(self) -> GeneralLinear:
        """The method with the inputs y_{n+k−1}, …, y_n and those of h f_{n+k−1}, …, h f_n that it needs.

        Example:
            >>> import bseries as bs
            >>> bs.series(bs.memory.bdf(2).to_general_linear(), 5) == bs.series("bdf2", 5)
            True
        """
        k, last = self.steps, self.alpha[-1]
        kept = next((k - j for j in range(k) if self.beta[j] != 0), 0)  # slopes of the past
        own = divide_entries(self.beta[-1], last)
        U = [divide_entries(-self.alpha[k - 1 - j], last) for j in range(k)]
        U += [divide_entries(self.beta[k - 1 - j], last) for j in range(kept)]
        V, B = [U], [[own]]
        for row in range(1, k + kept):
            V.append([ONE if column == row - 1 and row != k else ZERO for column in range(k + kept)])
            B.append([ONE if row == k else ZERO])
        finishing = [ONE, *[ZERO] * (k + kept - 1)]
        return GeneralLinear([[own]], [U], B, V, finishing=finishing, **_labels(self))


class GeneralLinear(MethodWithMemory):
    """A general linear method Y = h A f(Y) + U x, x⁺ = h B f(Y) + V x, with the finishing procedure y = d · x.

    The vector u with V u = u and d · u = 1 says how much of y each input holds; U u must be 1. Different finishing
    vectors give conjugate one-step methods.

    Args:
        A, U, B, V: The matrices by rows: s × s, s × r, r × s and r × r.
        finishing: The r entries of d; by default the first input.
        parameters, name, reference: As for `Splitting`.

    Raises:
        IntegratorError: 1 is no simple eigenvalue of V, d · u or a component of U u is not 1, or sizes do not match.

    Example:
        Butcher's DIMSIM of type 1 with two stages and order 2:

        >>> import bseries as bs
        >>> half = [["1/2", "1/2"], ["1/2", "1/2"]]
        >>> dimsim = bs.GeneralLinear([[0, 0], [2, 0]], [[1, 0], [0, 1]], [["5/4", "1/4"], ["3/4", "-1/4"]], half)
        >>> bs.order_of(dimsim), dimsim.zero_stable
        (2, True)

    References:
        J. C. Butcher, *Numerical Methods for Ordinary Differential Equations*, chapter 5; HLW, section XV.8.
    """

    kind = "general-linear"
    A: Matrix
    U: Matrix
    B: Matrix
    V: Matrix
    finishing: EntryRow
    u: EntryRow
    solver: Matrix

    def __init__(
        self, A: object, U: object, B: object, V: object, *, finishing: object = None, **labels: Unpack[Labels]
    ) -> None:
        symbols = labels["parameters"] = tuple(labels.get("parameters", ()))
        s, r = len(items(A, "A")), len(items(V, "V"))
        self._set_exactly(
            {
                "A": read_matrix(A, "A", symbols, rows=s, columns=s),
                "U": read_matrix(U, "U", symbols, rows=s, columns=r),
                "B": read_matrix(B, "B", symbols, rows=r, columns=s),
                "V": read_matrix(V, "V", symbols, rows=r, columns=r),
                "finishing": (ONE, *[ZERO] * (r - 1))
                if finishing is None
                else read_row(finishing, "finishing", symbols, count=r),
            },
            labels,
        )
        self.__dict__["u"], self.__dict__["solver"] = self._bordered()

    def _bordered(self) -> tuple[EntryRow, Matrix]:
        """The u with V u = u and d · u = 1, and the inverse of the matrix with the rows (V − I, −u) and (d, 0)."""
        fixed = [[sum_entries([x, -ONE]) if i == j else x for j, x in enumerate(row)] for i, row in enumerate(self.V)]
        vectors = null_space(fixed)
        if len(vectors) != 1:
            raise IntegratorError(f"V must have 1 as a simple eigenvalue, but has {len(vectors)} eigenvectors for it")
        (v,) = vectors
        scale = dot(self.finishing, v)
        if scale == 0:
            raise IntegratorError(
                f"finishing must have d·u ≠ 0 for the u with V u = u, but was {_text(self.finishing)}"
            )
        u = tuple(divide_entries(x, scale) for x in v)
        solver = inverse([*([*row, -x] for row, x in zip(fixed, u, strict=True)), [*self.finishing, ZERO]])
        if solver is None:
            raise IntegratorError("V must have 1 as a simple eigenvalue, but has it as a multiple one")
        for i, row in enumerate(self.U, 1):
            if certainly_differs(total := dot(row, u), 1, 0):
                raise IntegratorError(
                    f"U and finishing must satisfy U u = 1 for the u with V u = u and d·u = 1, but component {i} "
                    f"of U u was {_text([total])}"
                )
        return u, solver

    @cached_property
    def coefficients(self) -> dict[str, Any]:
        """The coefficients by name, as in files."""
        return {key: getattr(self, key) for key in ("A", "U", "B", "V", "finishing")}

    @property
    def inputs(self) -> int:
        """The number r of inputs."""
        return len(self.V)

    @property
    def is_explicit(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether A is strictly lower triangular."""
        return all(x == 0 for i, row in enumerate(self.A) for x in row[i:])

    @cached_property
    def zero_stable(self) -> bool:
        """Whether the powers of V are bounded: its minimal polynomial satisfies the root condition; decided exactly.

        Raises:
            IntegratorError: The coefficients are not rational.
        """
        if find_domain(flat_entries(self.V)) != "QQ":
            raise IntegratorError(f"V must be rational for zero-stability, but was {self.domain}")
        matrix = polynomials.to_flint_matrix(cast(Any, self.V))
        return root_conditions.satisfies_root_condition([polynomials.from_flint(x) for x in matrix.minpoly().coeffs()])


class TwoStepRungeKutta(GeneralLinear):
    """A two-step Runge–Kutta method, which uses the last two steps and the stages of the last step.

    Y_i^n = (1 − d_i) y_n + d_i y_{n−1} + h Σ_j (a_ij f(Y_j^n) + â_ij f(Y_j^{n−1})),
    y_{n+1} = (1 − θ) y_n + θ y_{n−1} + h Σ_j (b_j f(Y_j^n) + b̂_j f(Y_j^{n−1})).

    It is a general linear method with the inputs y_n, y_{n−1} and h f(Y^{n−1}).

    Args:
        d, theta: The weights of y_{n−1} in the stages and in the result.
        A, b: The coefficients of the new stages.
        Ahat, bhat: Those of the stages of the last step.
        parameters, name, reference: As for `Splitting`.

    Raises:
        IntegratorError: Sizes do not match, a coefficient is invalid, or θ = −1.

    Example:
        The Adams–Bashforth method with two steps:

        >>> import bseries as bs
        >>> method = bs.TwoStepRungeKutta([0], 0, [[0]], ["3/2"], [[0]], ["-1/2"])
        >>> bs.series(method, 5) == bs.series("ab2", 5)
        True

    References:
        Z. Jackiewicz, S. Tracogna, SIAM J. Numer. Anal. 32 (1995) 1390–1427; in this notation D. I. Ketcheson,
        S. Gottlieb, C. B. Macdonald, SIAM J. Numer. Anal. 49 (2011) 2618–2639.
    """

    kind = "two-step-runge-kutta"

    def __init__(
        self, d: object, theta: object, A: object, b: object, Ahat: object, bhat: object, **labels: Unpack[Labels]
    ) -> None:
        symbols = labels["parameters"] = tuple(labels.get("parameters", ()))
        weights = read_row(b, "b", symbols)
        s = len(weights)
        shares, (share,) = read_row(d, "d", symbols, count=s), read_row([theta], "theta", symbols)
        past = read_matrix(Ahat, "Ahat", symbols, rows=s, columns=s)
        U = [[sum_entries([ONE, -x]), x, *row] for x, row in zip(shares, past, strict=True)]
        V = [[sum_entries([ONE, -share]), share, *read_row(bhat, "bhat", symbols, count=s)], [ONE, *[ZERO] * (s + 1)]]
        V += [[ZERO] * (s + 2)] * s
        B = [list(weights), [ZERO] * s, *([Fraction(i == j) for j in range(s)] for i in range(s))]
        super().__init__(A, U, B, V, **labels)
        given = {"d": shares, "theta": share, "A": self.A, "b": weights, "Ahat": past, "bhat": self.V[0][2:]}
        self.__dict__["coefficients"] = given


def dot(x: Sequence[Entry], y: Sequence[Entry]) -> Entry:
    """Σ x_j y_j."""
    return sum_entries(multiply_entries(a, b) for a, b in zip(x, y, strict=True))


def null_space(rows: Sequence[Sequence[Entry]]) -> list[EntryRow]:
    """A basis of the vectors that an exact matrix maps to zero."""
    found = _echelon(rows)
    leading = [next(j for j, x in enumerate(row) if x != 0) for row in found]
    vectors = []
    for j in range(len(rows[0])):
        if j not in leading:
            vector: list[Entry] = [Fraction(i == j) for i in range(len(rows[0]))]
            for row, at in zip(found, leading, strict=True):
                vector[at] = -row[j]
            vectors.append(tuple(vector))
    return vectors


def inverse(rows: Sequence[Sequence[Entry]]) -> Matrix | None:
    """The inverse of an exact matrix; None if it has none."""
    size = len(rows)
    found = _echelon([[*row, *(Fraction(i == j) for j in range(size))] for i, row in enumerate(rows)])
    is_regular = all(row[i] != 0 for i, row in enumerate(found))
    return tuple(row[size:] for row in found) if is_regular else None


def _echelon(rows: Sequence[Sequence[Entry]]) -> list[EntryRow]:
    """The nonzero rows of the reduced echelon form."""
    if all(isinstance(x, Fraction) for row in rows for x in row):
        echelon, rank = polynomials.to_flint_matrix(cast(Any, rows)).rref()
        return list(polynomials.matrix_rows(echelon)[:rank])
    import sympy
    from sympy.polys.matrices import DomainMatrix

    matrix = DomainMatrix.from_Matrix(sympy.Matrix([list(map(in_sympy, row)) for row in rows]), extension=True)
    echelon, pivots = matrix.to_field().rref()
    return [tuple(map(simplest, row)) for row in echelon.to_Matrix().tolist()[: len(pivots)]]


def _labels(method: MethodWithMemory) -> Labels:
    return {"parameters": method.parameters, "name": method.name, "reference": method.reference}


def _text(entries: Iterable[Entry]) -> str:
    return shorten(", ".join(map(format_number, entries)))
