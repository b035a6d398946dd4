"""The numbers of figures, with less work, for tests that look at pictures: computed once."""

from __future__ import annotations

from functools import cache
from typing import Any

from bseries.figures.registry import compute, figure_file

QUICK = {
    "area-patch": {"steps": 4},
    "chaos-onset": {"span": 50},
    "large-steps": {"steps": 200},
    "lennard-jones-drift": {"members": 4, "span": 20, "h": 0.02},
    "linear-error-growth": {"h": 0.05},
    "optimal-truncation": {"terms": 9},
    "takahashi-imada-drift": {"span": 100},
}


@cache
def numbers_of(name: str) -> Any:
    return compute(figure_file(name), QUICK.get(name, {}))
