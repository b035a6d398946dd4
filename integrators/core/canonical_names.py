"""Names that tell momenta from positions, for blocks of variables, parts of methods and formulas alike."""

from __future__ import annotations

from collections.abc import Iterable

MOMENTA = frozenset({"p", "P", "v", "omega", "a", "I", "J", "L"})
POSITIONS = frozenset({"q", "Q", "x", "r", "theta", "phi"})
"""Names of momenta (velocities, actions) and of positions (angles)."""


def canonical_names(names: Iterable[str]) -> tuple[str, str] | None:
    """The names of momenta and of positions: p and q, or the only pair of other such names; None if names do not tell.

    Example:
        >>> canonical_names(["x", "v"]), canonical_names(["v", "q", "p"]), canonical_names(["x", "y"])
        (('v', 'x'), ('p', 'q'), None)
    """
    given = tuple(names)
    for groups in (({"p"}, {"q"}), (MOMENTA, POSITIONS)):
        momenta, positions = ([name for name in given if name in group] for group in groups)
        if len(momenta) == len(positions) == 1:
            return momenta[0], positions[0]
    return None
