"""Modifying integrators as scenes: the modifying field with the step size as one more variable."""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.scenes.base import Scene

from ..evaluation import modifying_field
from ..exceptions import SeriesError

if TYPE_CHECKING:
    from ..coefficients import Method

MOST_VARIABLES = 8
MOST_MONOMIALS = 2000
"""Longer formulas cost more than they gain."""


def modifying_scene(method: Method, scene: Scene, order: int) -> Scene:
    """The modifying field f + h f_2 + … + h^(N−1) f_N as a scene whose last variable is h, with h' = 0.

    So one compiled code serves every step size. The method applied to it with the step h has order N on the scene.
    What the scene calls its energy is observable under that name.

    Args:
        method: The basic method, which treats the whole field alike.
        scene: The scene.
        order: The order N.

    Raises:
        SeriesError: The method treats parts of the field differently, or the formulas are too long.

    Example:
        >>> import bseries as bs
        >>> modifying_scene(bs.method("implicit-midpoint"), bs.scene("riccati"), 3).field
        (-h**2*y**4/4 + y**2, 0)

    References:
        P. Chartier, E. Hairer, G. Vilmart, *Numerical integrators based on modified differential equations*,
        Math. Comp. 76 (2007), doi:10.1090/S0025-5718-07-01967-9.
    """
    import sympy

    if len(method.names) > 1:
        raise SeriesError(f"method must treat the whole field alike, but {method.name} has {', '.join(method.names)}")
    if scene.dimension > MOST_VARIABLES:
        raise SeriesError(f"scene must have at most {MOST_VARIABLES} variables, but {scene.name} has {scene.dimension}")
    series = modifying_field(method, scene, order).written(limit=MOST_MONOMIALS)
    name = _free_name(scene)
    h = sympy.Symbol(name)
    terms = [series.term(k) for k in range(1, order + 1)]
    field = [sympy.Add(*(h**k * term[i] for k, term in enumerate(terms))) for i in range(scene.dimension)]
    blocks = {block.name: list(scene.variables[block.offset : block.end]) for block in scene.blocks}
    return Scene(
        {**blocks, name: 1},
        field=dict(zip(scene.variables, field, strict=True)) | {name: 0},
        invariants={"energy": scene.hamiltonian} if scene.hamiltonian is not None else None,
        positive=scene.positive,
        name=f"{scene.name} modified for {method.name}, order {order}",
    )


def _free_name(scene: Scene) -> str:
    """A name for the step size that the scene does not use."""
    taken = {*scene.variables, *scene.parameters, *(block.name for block in scene.blocks)}
    return next(name for name in ("h", *(f"h_{k}" for k in range(len(taken) + 1))) if name not in taken)
