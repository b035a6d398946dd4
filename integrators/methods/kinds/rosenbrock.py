"""Rosenbrock methods and W-methods: linearly implicit methods with one linear system per stage."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any, Self

from integrators.exact.entries import Entry, multiply_entries, read_entry, sum_entries
from integrators.methods.programs.builder import ProgramBuilder, ProgramMethod, read_parts
from integrators.methods.programs.evaluations import LinearForm, combination
from integrators.methods.tableaux.tableau_input import EntryRow, Matrix, check_triangular, read_matrix, read_row


class Rosenbrock(ProgramMethod):
    """A Rosenbrock method with the exact Jacobian J = f'(y0).

    The stages are k_i = h f(y0 + Σ_{j<i} α_ij k_j) + h J Σ_{j≤i} γ_ij k_j, and y1 = y0 + Σ_i b_i k_i.

    Args:
        alpha: the strictly lower triangular matrix α_ij, by rows.
        gamma: the lower triangular matrix γ_ij, by rows.
        b: the weights b_i.
        parameters, name, reference, digits: as for `Splitting`.

    Raises:
        IntegratorError: sizes that do not match, an invalid entry, or a nonzero entry above the diagonal.

    Example:
        The linearly implicit Euler method:

        >>> print(Rosenbrock([[0]], [[1]], [1]))
        k1 = h f(y)
        k2 = h f'(y) (k1 + k2)
        y1 = y + k1 + k2

    References:
        E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, IV.7, formula (7.4).
    """

    alpha: Matrix
    gamma: Matrix
    b: EntryRow

    def __init__(
        self, alpha: Any, gamma: Any, b: Any, *, parameters: Iterable[str] = (), name: str | None = None,
        reference: str | None = None, digits: int | None = None,
    ) -> None:  # fmt: skip
        coefficients = _read_coefficients(alpha, gamma, b, parameters)
        self._set(coefficients, name=name, reference=reference, digits=digits)

    @classmethod
    def from_transformed(cls, a: Any, c: Any, m: Any, gamma: Any, **labels: Any) -> Self:
        """The method from the transformed coefficients of implementations that avoid products with the Jacobian.

        With u_i = Σ_j γ_ij k_j, and γ_ii = γ, the stages are
        (1/(hγ) I − J) u_i = f(y0 + Σ_{j<i} a_ij u_j) + Σ_{j<i} (c_ij/h) u_j, and y1 = y0 + Σ_i m_i u_i.

        Args:
            a: the strictly lower triangular matrix a_ij = (α Γ⁻¹)_ij, by rows.
            c: the matrix c_ij below the diagonal: Γ⁻¹ = I/γ − (c_ij).
            m: the weights m = b Γ⁻¹.
            gamma: the number γ.
            labels: further arguments of the class, by name.

        Returns:
            The method.

        Raises:
            IntegratorError: as for the class.

        Example:
            >>> rodas3 = Rosenbrock.from_transformed(
            ...     [[0, 0, 0, 0], [0, 0, 0, 0], [2, 0, 0, 0], [2, 0, 1, 0]],
            ...     [[0, 0, 0, 0], [4, 0, 0, 0], [1, -1, 0, 0], [1, -1, "-8/3", 0]], [2, 0, 1, 1], "1/2")
            >>> [str(b) for b in rodas3.b]
            ['5/6', '-1/6', '-1/6', '1/2']

        References:
            E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, IV.7, formula (7.25).
        """
        symbols = tuple(labels.get("parameters", ()))
        weights = read_row(m, "m", symbols)
        shape = {"rows": len(weights), "columns": len(weights)}
        matrix, lower = read_matrix(a, "a", symbols, **shape), read_matrix(c, "c", symbols, **shape)
        check_triangular(matrix, "a", strictly=True)
        check_triangular(lower, "c", strictly=True)
        number = read_entry(gamma, "gamma", symbols)
        inverse: list[list[Entry]] = []  # Γ, row by row, from (I/γ − C) Γ = I
        for i, row in enumerate(lower):
            unit = [Fraction(int(i == j)) for j in range(len(weights))]
            inverse.append([multiply_entries(number, x) for x in _row_times((1, *row), (unit, *inverse))])
        alpha = [_row_times(row, inverse) for row in matrix]
        return cls(alpha, inverse, _row_times(weights, inverse), **labels)

    @property
    def stages(self) -> int:
        """The number of stages."""
        return len(self.b)

    @property
    def _parts(self) -> tuple[str | None, str | None]:
        """The part of the field and the part of the Jacobian."""
        return None, None

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
        >>> print(WMethod([[0]], [[1]], [1]))
        k1 = h f_f(y)
        k2 = h f_W'(y) (k1 + k2)
        y1 = y + k1 + k2

    References:
        T. Steihaug, A. Wolfbrandt, Math. Comp. 33 (1979) 521–534, doi:10.1090/S0025-5718-1979-0521273-8;
        E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, IV.7.
    """

    def __init__(
        self, alpha: Any, gamma: Any, b: Any, *, parts: Sequence[str] = ("f", "W"), parameters: Iterable[str] = (),
        name: str | None = None, reference: str | None = None, digits: int | None = None,
    ) -> None:  # fmt: skip
        coefficients = _read_coefficients(alpha, gamma, b, parameters)
        self._set(coefficients, parts=read_parts(parts, count=2), name=name, reference=reference, digits=digits)

    max_children = (None, None, None), (1, 1, 1)  # W y is linear

    @property
    def _auxiliary(self) -> tuple[str, ...]:
        return self.names[1:]

    @property
    def _parts(self) -> tuple[str | None, str | None]:
        return self.names[0], self.names[1]


def _read_coefficients(alpha: Any, gamma: Any, b: Any, parameters: Iterable[str]) -> dict[str, Any]:
    symbols = tuple(parameters)
    weights = read_row(b, "b", symbols)
    shape = {"rows": len(weights), "columns": len(weights)}
    stages, jacobian = read_matrix(alpha, "alpha", symbols, **shape), read_matrix(gamma, "gamma", symbols, **shape)
    check_triangular(stages, "alpha", strictly=True)
    check_triangular(jacobian, "gamma", strictly=False)
    return {"alpha": stages, "gamma": jacobian, "b": weights}


def _row_times(row: Sequence[Any], matrix: Sequence[Sequence[Entry]]) -> list[Entry]:
    """A row vector times a matrix; entries beyond the last row of the matrix are ignored."""
    columns = zip(*matrix, strict=True)
    return [sum_entries(multiply_entries(x, y) for x, y in zip(row, column, strict=False)) for column in columns]
