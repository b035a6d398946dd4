"""Bodies that attract each other by gravity."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from ..errors import IntegratorError
from ..tableau_input import items
from .base import Scene
from .options import read_positive, read_rows
from .particles import kinetic_energy, squared_distance, symmetry_integrals
from .terms import Term

SUMMARY = "bodies that attract each other by gravity; by default, three that follow each other along a figure eight"
REFERENCE = (
    "A. Chenciner, R. Montgomery, Annals of Mathematics 152 (2000) 881–901, doi:10.2307/2661357; HLW, section I.2"
)
EFFECTS = {"softening": "sqrt(r² + epsilon²) in place of the distance r, so that forces stay finite"}

# The digits are C. Simó's, as printed by Chenciner and Montgomery; with G = 1 the period is 6.32591398.
FIGURE_EIGHT = (("0.97000436", "-0.24308753"), ("-0.97000436", "0.24308753"), (0, 0))
FIGURE_EIGHT_VELOCITIES = (("0.466203685", "0.43236573"),) * 2 + (("-0.93240737", "-0.86473146"),)


def n_body(
    *,
    masses: Any = (1, 1, 1),
    positions: Any = FIGURE_EIGHT,
    velocities: Any = FIGURE_EIGHT_VELOCITIES,
    effects: Collection[str] = (),
) -> Scene:
    """H = Σ |p_i|²/(2m_i) − Σ_{i<j} G m_i m_j / r_ij, with p_i = m_i v_i; G = 1 is a parameter.

    Args:
        masses: A number for each body.
        positions: A row of 2 or 3 numbers for each body.
        velocities: Rows like those of the positions.
        effects: With ``softening`` the distance is sqrt(r² + epsilon²), and epsilon = 1/10 is a parameter.

    Raises:
        IntegratorError: A mass is not positive, rows do not fit, or two bodies are at the same place.

    Example:
        >>> n_body(masses=[2, 1], positions=[[0, 0], [1, 0]], velocities=[[0, 0], [0, "1/2"]]).hamiltonian
        px1**2/4 + px2**2/2 + py1**2/4 + py2**2/2 - 2/sqrt((qx1 - qx2)**2 + (qy1 - qy2)**2)
    """
    return gravity(masses, positions, velocities, softened="softening" in effects)


def gravity(
    masses: Any,
    positions: Any,
    velocities: Any,
    *,
    constant: Any = 1,
    softened: bool = False,
    name: str = "n-body",
    summary: str | None = None,
    reference: str = REFERENCE,
) -> Scene:
    """The scene of bodies with these masses, positions and velocities; `constant` is that of gravitation.

    Raises:
        IntegratorError: A mass is not positive, rows do not fit, or two bodies are at the same place.
    """
    m = [read_positive(mass, f"masses[{k}]") for k, mass in enumerate(items(masses, "masses"), 1)]
    q = read_rows(positions, "positions", len(m))
    v = read_rows(velocities, "velocities", len(m))
    dimension = _dimension(q, v)
    square = squared_distance(dimension) + " + epsilon^2" * softened
    return Scene(
        {"p": [len(m), dimension], "q": [len(m), dimension]},
        terms=[
            kinetic_energy(dimension, "m_i"),
            Term(over="pairs", hamiltonian=f"-G*m_i*m_j/sqrt({square})"),
        ],
        parameters={"G": constant, "m": m, **({"epsilon": "1/10"} if softened else {})},
        invariants=symmetry_integrals(len(m), dimension),
        start={"p": [[mass * x for x in row] for mass, row in zip(m, v, strict=True)], "q": q},
        name=name,
        summary=summary or f"gravity among {len(m)} bodies{', softened' * softened}",
        reference=reference,
    )


def _dimension(positions: Sequence[Sequence[Any]], velocities: Sequence[Sequence[Any]]) -> int:
    lengths = [{len(row) for row in rows} for rows in (positions, velocities)]
    if lengths not in ([{2}, {2}], [{3}, {3}]):
        found = [" and ".join(map(str, sorted(n))) or "none" for n in lengths]
        raise IntegratorError(
            "positions and velocities must be rows of 2 numbers, or rows of 3, "
            f"but had rows of {found[0]} and of {found[1]}"
        )
    return lengths[0].pop()


SCENES = (("n-body", n_body, SUMMARY, REFERENCE, (), EFFECTS),)
