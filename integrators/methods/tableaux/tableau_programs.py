"""Butcher tableaux as programs: one evaluation of the field for each part and stage."""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.methods.program.evaluations import LinearForm
from integrators.methods.program.program import ProgramBuilder

if TYPE_CHECKING:
    from collections.abc import Iterable

    from integrators.exact.entries import Entry
    from integrators.methods.program.program import Program
    from integrators.methods.tableaux.partitioned import PartitionedRungeKutta
    from integrators.methods.tableaux.runge_kutta import RungeKutta


def tableau_program(method: RungeKutta | PartitionedRungeKutta) -> Program:
    """k^ν_i = h f^ν(y + Σ_μ Σ_j a^μ_ij k^μ_j), y1 = y + Σ_ν Σ_i b^ν_i k^ν_i.

    Args:
        method: a Runge–Kutta method, partitioned or not.

    Returns:
        Its program; stage by stage, and within a stage part by part.
    """
    names = method.names if len(method.names) > 1 else ()
    builder = ProgramBuilder(names)
    count = len(method.partitions)
    registers = builder.unknowns(count * method.stages)
    increments = [registers[part::count] for part in range(count)]
    for i in range(method.stages):
        at = builder.y
        for tableau, k in zip(method.partitions, increments, strict=True):
            at = at + combination(tableau.A[i], k)
        for name, k in zip(names or (None,), increments, strict=True):
            builder.field(at, name, into=k[i])
    result = builder.y
    for tableau, k in zip(method.partitions, increments, strict=True):
        result = result + combination(tableau.b, k)
    return builder.program(result, name=method.name, reference=method.reference, digits=method.digits)


def combination(coefficients: Iterable[Entry], forms: Iterable[LinearForm]) -> LinearForm:
    """Σ x_j k_j, the zeros left out."""
    return sum((k.times(x) for x, k in zip(coefficients, forms, strict=True) if x != 0), LinearForm())
