"""Symmetric compositions of a symmetric method of order 2: the published schemes, and what they make of Strang's.

The steps are γ_1 h, …, γ_s h with γ_(s+1−i) = γ_i. Order 6 takes 7 of them, order 8 takes 15, order 10 takes 31.
More steps go less far backwards and forwards, which makes the errors smaller by more than these steps cost.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.methods.catalogue.entry import MethodEntry
from integrators.methods.kinds.composition_schemes import FOREST_RUTH, SCHEMES, SUZUKI, YOSHIDA, Scheme

if TYPE_CHECKING:
    from collections.abc import Callable

    from integrators.methods.kinds.splitting import Splitting


def _composed(scheme: str) -> Callable[..., Splitting]:
    """The builder of a composition of Strang's splitting."""

    def build(*, name: str, reference: str) -> Splitting:
        from integrators.methods.kinds.composition_schemes import symmetric_composition
        from integrators.methods.kinds.splitting import Splitting, strang

        composed = symmetric_composition(strang(), scheme)
        assert isinstance(composed, Splitting)
        return Splitting(composed.flows, name=name, reference=reference, digits=composed.digits)

    return build


def _entry(name: str, scheme: Scheme) -> MethodEntry:
    about = f"{scheme.steps} Strang steps, {scheme.about}"
    flows = 2 * scheme.steps + 1
    return MethodEntry(name, "splitting", flows, scheme.order, about, scheme.reference, _composed(name))


METHODS = (
    MethodEntry(
        "triple-jump4",
        "splitting",
        7,
        4,
        "three Strang steps with 1/(2 - 2^(1/3)); Forest and Ruth's method",
        f"{FOREST_RUTH}; {SUZUKI}; {YOSHIDA}",
        _composed("triple-jump4"),
        ("triple-jump", "forest-ruth", "yoshida4"),
    ),
    MethodEntry(
        "suzuki4",
        "splitting",
        11,
        4,
        "five Strang steps with 1/(4 - 4^(1/3)); recommended to compose for order 4",
        SUZUKI,
        _composed("suzuki4"),
        ("suzuki-fractal4",),
    ),
    *(_entry(name, scheme) for name, scheme in SCHEMES.items()),
)
