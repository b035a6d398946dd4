"""Force-gradient methods for q'' = g(q): kicks with the force and its derivative."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from integrators.methods.catalogue.entry import MethodEntry

if TYPE_CHECKING:
    from collections.abc import Callable

    from integrators.methods.kinds.force_gradient import ForceGradient
    from integrators.methods.kinds.takahashi_imada import TakahashiImada

TAKAHASHI_IMADA = "M. Takahashi, M. Imada, J. Phys. Soc. Japan 53 (1984) 3765–3769, doi:10.1143/JPSJ.53.3765"
SIMPLIFIED = "E. Hairer, R. I. McLachlan, R. D. Skeel, ESAIM: M2AN 43 (2009) 631–644, doi:10.1051/m2an/2009019"
CHIN = "S. A. Chin, Phys. Lett. A 226 (1997) 344–348, doi:10.1016/S0375-9601(97)00003-0"


def _takahashi_imada(*, simplified: bool) -> Callable[..., TakahashiImada]:
    def build(*, name: str, reference: str, alpha: Any = "1/12") -> TakahashiImada:
        from integrators.methods.kinds.takahashi_imada import TakahashiImada

        return TakahashiImada(alpha, simplified=simplified, name=name, reference=reference)

    return build


def _force_gradient(drifts: str, kicks: str, gradients: str) -> Callable[..., ForceGradient]:
    def build(*, name: str, reference: str) -> ForceGradient:
        from integrators.methods.kinds.force_gradient import ForceGradient

        return ForceGradient(drifts.split(), kicks.split(), gradients.split(), name=name, reference=reference)

    return build


METHODS = (
    MethodEntry(
        "takahashi-imada",
        "force gradient",
        2,
        2,
        "Störmer-Verlet with the force f + alpha h^2 f' f, alpha = 1/12: symplectic, conjugate to a method of order 4",
        TAKAHASHI_IMADA,
        _takahashi_imada(simplified=False),
        options=("alpha",),
    ),
    MethodEntry(
        "simplified-takahashi-imada",
        "force gradient",
        2,
        2,
        "Störmer-Verlet with the force f(q + alpha h^2 f(q)), alpha = 1/12: preserves volume, not symplectic",
        SIMPLIFIED,
        _takahashi_imada(simplified=True),
        options=("alpha",),
    ),
    MethodEntry(
        "chin4a",
        "force gradient",
        3,
        4,
        "kicks h/6, 2h/3, h/6, the one in the middle with its gradient; no step backwards in time",
        CHIN,
        _force_gradient("0 1/2 1/2 0", "1/6 2/3 1/6", "0 1/36 0"),
    ),
    MethodEntry(
        "chin4b",
        "force gradient",
        2,
        4,
        "two kicks h/2 with gradients; no step backwards in time",
        CHIN,
        _force_gradient("1/2-sqrt(3)/6 sqrt(3)/3 1/2-sqrt(3)/6", "1/2 1/2", "1/12-sqrt(3)/24 1/12-sqrt(3)/24"),
    ),
    MethodEntry(
        "chin4c",
        "force gradient",
        3,
        4,
        "kicks 3h/8, h/4, 3h/8, the one in the middle with its gradient; no step backwards in time, small errors",
        CHIN,
        _force_gradient("1/6 1/3 1/3 1/6", "3/8 1/4 3/8", "0 1/96 0"),
    ),
)
