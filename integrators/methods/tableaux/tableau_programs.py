"""Butcher tableaux as programs: one evaluation of the field for each part and stage."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from integrators.methods.program.evaluations import LinearForm
from integrators.methods.program.program import ProgramBuilder

if TYPE_CHECKING:
    from integrators.exact.entries import Entry
    from integrators.methods.program.program import Program
    from integrators.methods.tableaux.tableau_input import Matrix, Row


def tableau_program(tableaux: Sequence[tuple[Matrix, Row]], names: Sequence[str], **labels: Any) -> Program:
    """k^ν_i = h f^ν(y + Σ_μ Σ_j a^μ_ij k^μ_j), y1 = y + Σ_ν Σ_i b^ν_i k^ν_i.

    Args:
        tableaux: the stage matrix and the weights of each part, with equally many stages.
        names: the names of the parts; that of a single part does not count.
        labels: name, reference and digits, as for `ProgramBuilder.program`.

    Returns:
        The program; stage by stage, and within a stage part by part.
    """
    count, stages = len(tableaux), len(tableaux[0][1])
    parts = tuple(names) if count > 1 else ()
    builder = ProgramBuilder(parts)
    registers = builder.unknowns(count * stages)
    increments = [registers[part::count] for part in range(count)]
    for i in range(stages):
        at = builder.y
        for (A, _), k in zip(tableaux, increments, strict=True):
            at = at + combination(A[i], k)
        for name, k in zip(parts or (None,), increments, strict=True):
            builder.field(at, name, into=k[i])
    result = builder.y
    for (_, b), k in zip(tableaux, increments, strict=True):
        result = result + combination(b, k)
    return builder.program(result, **labels)


def combination(coefficients: Iterable[Entry], forms: Iterable[LinearForm]) -> LinearForm:
    """Σ x_j k_j, the zeros left out."""
    return sum((k.times(x) for x, k in zip(coefficients, forms, strict=True) if x != 0), LinearForm())
