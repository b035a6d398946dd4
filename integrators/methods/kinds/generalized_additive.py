"""Generalised additive Runge–Kutta methods, with separate stages for each part of the field."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from integrators.core.errors import IntegratorError, shorten
from integrators.methods.program.evaluations import combination
from integrators.methods.program.program_method import ProgramMethod, read_parts
from integrators.methods.tableaux.tableau_input import in_color_order, read_matrix, read_row

if TYPE_CHECKING:
    from integrators.methods.program.evaluations import LinearForm
    from integrators.methods.program.program import ProgramBuilder
    from integrators.methods.tableaux.tableau_input import EntryRow, Matrix


class GeneralizedAdditiveRungeKutta(ProgramMethod):
    """A generalised additive Runge–Kutta (GARK) method for y' = Σ_ν f^ν(y).

    Part ν has s_ν stages Y^ν_i = y + h Σ_μ Σ_j a^νμ_ij f^μ(Y^μ_j), and y1 = y + h Σ_ν Σ_i b^ν_i f^ν(Y^ν_i). With equal
    numbers of stages and A^νμ = A^μ for all ν it is an additive method, a `PartitionedRungeKutta`.

    Args:
        A: the blocks A[ν][μ] with s_ν rows of s_μ entries; omitted blocks are zero.
        b: the weights b[ν] with s_ν entries. The order of its names is that of the colours 0, 1, …, with p before q.
        parameters: the symbols allowed in formulas.
        name: the name in messages.
        reference: the source.
        digits: the number of correct significant digits of decimal coefficients.

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
        self,
        A: Mapping[str, Mapping[str, Any]],
        b: Mapping[str, Any],
        *,
        parameters: Iterable[str] = (),
        name: str | None = None,
        reference: str | None = None,
        digits: int | None = None,
    ) -> None:
        if not isinstance(b, Mapping):
            raise IntegratorError(f"b must map names of parts to weights, but was {shorten(repr(b))}")
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
        raise IntegratorError(f"{argument} must map names of parts to blocks, but was {shorten(repr(blocks))}")
    for key in blocks:
        if key not in parts:
            raise IntegratorError(f"{argument} must be given for {', '.join(parts)}, but one was {shorten(repr(key))}")
