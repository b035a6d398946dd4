"""The underlying one-step method of a method with memory, and the starting values on it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, cast

from bseries.algebra.bseries import BSeries
from bseries.algebra.general_linear import GeneralLinearInputs
from bseries.algebra.modified import series, table_of
from bseries.algebra.stages import inputs_of
from bseries.analysis.memory_properties import linear_multistep, with_memory
from integrators.exact.arguments import read_number, read_vector
from integrators.methods.kinds.memory import LinearMultistep
from integrators.methods.programs.program import Method
from trees.table import TreeTable

if TYPE_CHECKING:
    import numpy as np

    from integrators.scenes.scene import Scene


def underlying_one_step(method: Method | str, order: int | TreeTable) -> BSeries:
    """The one-step method Φ that a method with memory is, once it starts on it: the same as `series`.

    For a linear multistep method Σ α_j Φ^j = h Σ β_j f∘Φ^j; for a general linear one GLM∘S = S∘Φ.

    Args:
        method: A method with memory, or its name.
        order: Largest number of nodes, or a table of trees.

    Raises:
        SeriesError: `method` has no memory.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is.

    Example:
        >>> import bseries as bs
        >>> phi = bs.underlying_one_step("bdf2", 4)
        >>> phi["[τ,τ]"], bs.order_of(phi)
        (Fraction(1, 1), 2)

    References:
        U. Kirchgraber, Numer. Math. 48 (1986) 85–90; HLW, sections XV.2 and XV.8.
    """
    return series(with_memory(method), order)


def starting_procedure(method: Method | str, order: int | TreeTable) -> tuple[BSeries, ...]:
    """The series of the inputs of a step that start a method on its underlying one-step method Φ, without parasites.

    Args:
        method: A method with memory, or its name.
        order: Largest number of nodes, or a table of trees.

    Returns:
        For a linear multistep method with k steps the powers Φ^0, …, Φ^(k−1), the series of y_0, …, y_{k−1}; for a
        general linear method S_1, …, S_r, with the coefficients u_i at the empty tree.

    Raises:
        SeriesError: `method` has no memory.
        TreeError: `order` is not a whole number ≥ 1, or needs more memory than there is.

    Example:
        >>> import bseries as bs
        >>> first, second = bs.memory.starting_procedure("bdf2", 3)
        >>> bs.compose(first, second) == bs.underlying_one_step("bdf2", 3)
        True

    References:
        HLW, theorem XV.8.1.
    """
    checked = with_memory(method)
    table = table_of(checked, order, None)
    if isinstance(checked, LinearMultistep):
        phi = series(checked, table)
        powers: list[Any] = [phi**0]
        while len(powers) < checked.steps:
            powers.append(phi ** len(powers))
        return tuple(powers)
    inputs = cast(GeneralLinearInputs, inputs_of(checked, table.max_order))
    pairs: Any = zip(inputs.starting(table), cast(Any, checked).u, strict=True)
    return tuple(BSeries(table, values, u, names=checked.names, label=checked.name) for values, u in pairs)


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
    import numpy as np

    from bseries.fields.modified_fields import series_map
    from integrators.scenes.catalogue.registry import as_scene

    method, scene = linear_multistep(method), as_scene(scene)
    step, size = series_map(method, scene, order or method.order + 2), read_number(h, "h")
    states = [scene.y0 if y0 is None else read_vector(y0, "y0", scene.dimension)]
    while len(states) < method.steps:
        states.append(np.asarray(step(states[-1], size)))
    return np.array(states)
