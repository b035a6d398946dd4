"""Truncated modified equations as scenes of their own, to be solved like any other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import bseries as bs

if TYPE_CHECKING:
    from integrators import Scene


def truncated_scene(method: str, scene: Scene, terms: int, h: float) -> Scene:
    """y' = f(y) + h f_2(y) + … + h^(N−1) f_N(y), with the numbers of the step size in it.

    Args:
        method: The name of the method.
        scene: The scene that the method is applied to.
        terms: How many terms N.
        h: The step size, which stands for the decimal that it prints as.

    Example:
        >>> truncated_scene("explicit-euler", bs.scene("riccati"), 3, 0.1).field
        (3*y**4/200 - y**3/10 + y**2,)
    """
    import sympy

    f, step = bs.modified_field(bs.method(method), scene, terms), sympy.Symbol("h")
    field = [sum(step**k * f.symbolic(k)[i] for k in range(terms)) for i in range(scene.dimension)]
    name = f"{method} on {scene.name}, {terms} terms"
    return bs.Scene(
        dict.fromkeys(scene.variables, 1),
        field=dict(zip(scene.variables, field, strict=True)),
        parameters={"h": h},
        name=name,
    )
