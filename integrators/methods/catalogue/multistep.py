"""Linear multistep methods: families of Adams, BDF, Nyström and Milne–Simpson, named with their number of steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from integrators.methods.catalogue.registry import MethodEntry
from integrators.methods.kinds import multistep_families as families

HNW = "E. Hairer, S. P. Nørsett, G. Wanner, Solving Ordinary Differential Equations I, section III.1"


def _built(family: Callable[..., Any], *, name: str, reference: str, stages: int = 1) -> Any:
    """The member of a family with some steps."""
    return family(stages, name=name, reference=reference)


METHODS = (
    MethodEntry("ab", "multistep", None, "s", "explicit Adams methods with s steps", HNW,
        partial(_built, families.adams_bashforth), ("adams-bashforth",), title="Adams–Bashforth"),
    MethodEntry("am", "multistep", None, "s+1", "implicit Adams methods with s steps; one is the trapezoidal rule", HNW,
        partial(_built, families.adams_moulton), ("adams-moulton",), title="Adams–Moulton"),
    MethodEntry("bdf", "multistep", None, "s", "backward differentiation formulas, zero-stable for s ≤ 6", HNW,
        partial(_built, families.bdf), title="BDF"),
    MethodEntry("nystrom-multistep", "multistep", None, "s", "explicit: y(n+s) = y(n+s-2) + ...; two steps: leapfrog",
        HNW, partial(_built, families.nystrom), least_stages=2, title="Nyström multistep"),
    MethodEntry("milne-simpson", "multistep", None, "s+1", "implicit: y(n+s) = y(n+s-2) + ...; two steps: order 4",
        HNW, partial(_built, families.milne_simpson), ("milne",), least_stages=2, title="Milne–Simpson"),
)  # fmt: skip
