"""How soon a motion has turned once: what was seen of less than that does not tell how it goes on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .distances import largest_size
from .growth import EVEN, goes_on

if TYPE_CHECKING:
    import numpy as np

SWING = 1 / 3
"""A variable has turned back when it went so much of its range in the other direction."""
REVERSALS = 2
"""At a turn's end a variable has turned back so often; it may do so once in half a turn, as sin t for t < π."""
STILL = 1e-9
"""Variables that move by a smaller part of the largest state do not move."""
AT_REST = 1e-2
"""Variables that move by less in the second half of the time than this part of their range have come to rest."""


def first_turn(y: np.ndarray) -> float:
    """The part of the time in which every variable turned once, 0 if none has to, and inf if there was too little.

    Those with bounds have to go to and fro; those that go on and on, as angles do, have to do so in their pace.
    Those that stay, come to rest, or go on evenly have no turns.

    Args:
        y: States (variables, n) without the time, at equidistant times from 0 on.

    Example:
        >>> import numpy as np
        >>> t = np.linspace(0, 4 * np.pi, 401)
        >>> y = np.array([np.sin(t), np.cos(t), 7 * t, 7 * t - np.sin(t)])
        >>> round(first_turn(y), 2), first_turn(y[:, :210]), first_turn(y[2:3])
        (0.6, inf, 0.0)
    """
    import numpy as np

    still = STILL * largest_size(y)
    return max((_first_turn(row) for row in y if np.ptp(row) > still), default=0.0)


def _first_turn(row: np.ndarray) -> float:
    """The part of the time that a variable takes."""
    import numpy as np

    if goes_on(row):
        row = np.diff(row)
        if np.ptp(row) <= (EVEN - 1) * abs(row.mean()):
            return 0.0
    elif np.ptp(row[len(row) // 2 :]) <= AT_REST * np.ptp(row):
        return 0.0
    return _reversed(row) / (len(row) - 1)


def _reversed(row: np.ndarray) -> float:
    """The index where a variable has turned back often enough; inf if it never has."""
    import numpy as np

    swing, reversals, direction = SWING * float(np.ptp(row)), 0, 0
    low = high = row[0]
    for k, value in enumerate(row):
        low, high = min(low, value), max(high, value)
        falls, rises = direction >= 0 and value <= high - swing, direction <= 0 and value >= low + swing
        if falls or rises:
            reversals += direction != 0
            direction = -1 if falls else 1
            low = high = value
        if reversals == REVERSALS:
            return k
    return math.inf
