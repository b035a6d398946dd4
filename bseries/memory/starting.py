"""Starting values on the underlying one-step method, which leave no parasites but those of its truncation."""

from __future__ import annotations

import numpy as np

from bseries.analysis.memory_properties import linear_multistep
from bseries.fields.modified_fields import series_map
from integrators.exact.arguments import read_number, read_vector
from integrators.methods.programs.program import Method
from integrators.scenes.catalogue.registry import as_scene
from integrators.scenes.scene import Scene


def starting_values(
    method: Method | str, scene: Scene | str, h: float | str, order: int | None = None, *, y0: object = None
) -> np.ndarray:
    """Starting values y_0, Φ(y_0), …, Φ^{k−1}(y_0) on the underlying one-step method Φ of a multistep method.

    Started there, the numerical solution has no parasitic components; with Φ up to `order` nodes, those are of size
    h^{order+1}.

    Args:
        method: A linear multistep method, or its name.
        scene: A scene, or its name.
        h: The step size.
        order: The largest number of nodes of the trees in Φ, by default two more than the order of the method.
        y0: The first state, by default that of the scene.

    Returns:
        An array (k, variables), for the argument `start` of `integrate`.

    Raises:
        SeriesError: `method` is no linear multistep method.

    Example:
        >>> import bseries as bs
        >>> start = bs.memory.starting_values("ab2", "pendulum", 0.1)
        >>> run = bs.integrate("ab2", "pendulum", h=0.1, steps=10, start=start)
        >>> bool((run.y[:, :2].T == start).all())
        True

    References:
        HLW, section XV.2.
    """
    method, scene = linear_multistep(method), as_scene(scene)
    step, size = series_map(method, scene, order or method.order + 2), read_number(h, "h")
    states = [scene.y0 if y0 is None else read_vector(y0, "y0", scene.dimension)]
    while len(states) < method.steps:
        states.append(np.asarray(step(states[-1], size)))
    return np.array(states)
