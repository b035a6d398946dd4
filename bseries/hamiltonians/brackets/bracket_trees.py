"""Which trees tell the brackets of a method's parts apart, and which of the parts is T.

For chains of flows these are tall trees, words in the names of the parts, so that nothing is known of the parts. Other
methods are read on the trees of separable systems T(p) + U(q). Where T is quadratic trees are those of Nyström systems.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from bseries.algebra.flow_chains import FlowChain
from bseries.algebra.stages import auxiliary_colors, inputs_of, own_trees
from bseries.analysis.structure_conditions import SEPARABLE
from bseries.exceptions import SeriesError
from bseries.hamiltonians.brackets.lie_algebra import TALL
from trees.counting import check_order, normal_limits
from trees.lyndon_words import count_lyndon_words
from trees.table import tree_table

if TYPE_CHECKING:
    from integrators.methods.program.program import Method
    from trees.table import TreeTable

MOST_BRACKETS = 800
"""So many brackets take a minute or two to be told apart: two parts to order 12."""

HAMILTONIAN_NAMES = {"p": "U", "q": "T"}
"""The flow of U(q) changes momenta, that of T(p) positions."""


def is_chain(method: Method) -> bool:
    """Whether a method is a chain of flows."""
    return isinstance(inputs_of(method, 1), FlowChain)


def bracket_table(method: Method, order: int | None, kinetic: int | None) -> TreeTable:
    """The trees on which the brackets of a method's parts are told apart."""
    if order is None:
        raise SeriesError("order must be given for a method, but was None")
    if auxiliary_colors(method):
        raise SeriesError(f"method must treat parts of the field, but {method.name} has an auxiliary matrix as a part")
    colors = len(method.names)
    brackets = sum(count_lyndon_words(min(check_order(order), 40), colors))
    if brackets > MOST_BRACKETS:
        raise SeriesError(f"order must be smaller: there are {brackets} brackets to order {order}")
    own = own_trees(method)
    if kinetic is not None:
        bounds: Any = _nystrom_bounds(colors, kinetic)
    elif is_chain(method):
        bounds = TALL
    elif own is not None:
        raise SeriesError(f"quadratic_kinetic must not be False for {method.name}, which is made for quadratic T")
    elif colors == 2:
        bounds = SEPARABLE
    else:
        raise SeriesError(f"method must be made of flows where it has {colors} parts, but {method.name} is not")
    return tree_table(order, colors, bounds)


def _nystrom_bounds(colors: int, kinetic: int) -> list[list[int | None]]:
    """How often the parts of the field can be differentiated in each other if one is T and the others depend on q."""
    return [
        [*(int(other != kinetic) for other in range(colors)), 1]
        if color == kinetic
        else [*(None if other == kinetic else 0 for other in range(colors)), None]
        for color in range(colors)
    ]


def kinetic_of(bounds: Any, colors: int) -> int | None:
    """The part T if these bounds on children are those of fields with quadratic T; None if not."""
    limits = normal_limits(colors, bounds)
    for color, row in enumerate(limits):
        others = [other for other in range(colors) if other != color]
        depends_on_others = any(limits[one][other] for one in others for other in others)
        if row[color] == 0 and min(sum(row[:-1]), row[-1]) == 1 and not depends_on_others:
            return color
    return None


def read_kinetic(given: Any, names: Sequence[str]) -> int | None:
    """The colour of T as users say it."""
    shown = shown_names(names)
    if given is True and len(names) == 2:
        return next((names.index(name) for name in ("q", "a") if name in names), 0)
    if isinstance(given, str) and given in shown:
        return shown.index(given)
    if given is False:
        return None
    raise SeriesError(
        f"quadratic_kinetic must be {'' if len(names) > 2 else 'True, '}False or one of {', '.join(shown)}, "
        f"but was {given!r:.60}"
    )


def shown_names(names: Sequence[str]) -> list[str]:
    """The names of the parts of a Hamiltonian, by colour."""
    return [HAMILTONIAN_NAMES[name] for name in names] if set(names) == set(HAMILTONIAN_NAMES) else list(names)
