"""Splitting methods for y' = f^a(y) + f^b(y)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .entry import MethodEntry

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..splitting import Splitting

SUZUKI = "M. Suzuki, Phys. Lett. A 146 (1990) 319–323, doi:10.1016/0375-9601(90)90962-N"
YOSHIDA = "H. Yoshida, Phys. Lett. A 150 (1990) 262–268, doi:10.1016/0375-9601(90)90092-3"
HLW = "Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), §II.5, doi:10.1007/3-540-30666-8"
MCLACHLAN = "R. I. McLachlan, SIAM J. Sci. Comput. 16 (1995) 151–168, doi:10.1137/0916010"


def _lie_trotter(*, name: str, reference: str) -> Splitting:
    from ..splitting import Splitting

    return Splitting([("a", 1), ("b", 1)], name=name, reference=reference)


def _strang(*, name: str, reference: str) -> Splitting:
    return _alternating(["1/2"], ["1"], name=name, reference=reference)


def _alternating(a: list[str], b: list[str], *, name: str, reference: str, digits: int | None = None) -> Splitting:
    """a_1, b_1, a_2, b_2, … and back: the last one in the middle of the step, once."""
    from ..splitting import Splitting

    flows = [(part, x) for pair in zip(a, b, strict=False) for part, x in zip("ab", pair, strict=True)]
    flows += [("a", a[-1])] * (len(a) > len(b))
    return Splitting([*flows, *flows[-2::-1]], name=name, reference=reference, digits=digits)


def _composed(scheme: str) -> Callable[..., Splitting]:
    """The builder of a composition of Strang's splitting."""

    def build(*, name: str, reference: str) -> Splitting:
        from .. import composition_schemes
        from ..splitting import Splitting, strang

        composed = getattr(composition_schemes, scheme)(strang(), 2)
        assert isinstance(composed, Splitting)
        return Splitting(composed.flows, name=name, reference=reference)

    return build


def _yoshida6(*, name: str, reference: str) -> Splitting:
    """A symmetric composition of seven Strang steps."""
    from ..compositions import composition
    from ..splitting import Splitting, strang

    outer = ["0.78451361047755726381949763", "0.23557321335935813368479318", "-1.17767998417887100694641568"]
    fractions = [*outer, "1.31518632068391121888424973", *outer[::-1]]
    composed = composition([(strang(), x) for x in fractions])
    assert isinstance(composed, Splitting)
    return Splitting(composed.flows, name=name, reference=reference, digits=26)


def _mclachlan4(*, name: str, reference: str) -> Splitting:
    """Lie–Trotter steps Φ and their adjoints in turn: Φ_(α5 h) ∘ Φ*_(β5 h) ∘ … ∘ Φ_(α1 h) ∘ Φ*_(β1 h)."""
    from ..splitting import Splitting

    beta = ["(14-sqrt(19))/108", "(-23-20*sqrt(19))/270", "1/5", "(-2+10*sqrt(19))/135", "(146+5*sqrt(19))/540"]
    flows = [flow for x, y in zip(beta, beta[::-1], strict=True) for flow in (("b", x), ("a", x), ("a", y), ("b", y))]
    return Splitting(flows, parts=("a", "b"), name=name, reference=reference)


def _blanes_moan4(*, name: str, reference: str) -> Splitting:
    a = ["0.0792036964311957", "0.353172906049774", "-0.0420650803577195"]
    b = ["0.209515106613362", "-0.143851773179818"]
    a.append(f"1-2*({a[0]}+{a[1]}{a[2]})")
    b.append(f"1/2-({b[0]}{b[1]})")
    return _alternating(a, b, name=name, reference=reference, digits=15)


METHODS = (
    MethodEntry("lie-trotter", "splitting", 2, 1, "a step of a, then a step of b", HLW, _lie_trotter),
    MethodEntry(
        "strang",
        "splitting",
        3,
        2,
        "half a step of a, a step of b, half a step of a",
        f"G. Strang, SIAM J. Numer. Anal. 5 (1968) 506–517, doi:10.1137/0705041; {HLW}",
        _strang,
        ("strang-splitting", "marchuk"),
    ),
    MethodEntry(
        "triple-jump4",
        "splitting",
        7,
        4,
        "three Strang steps with 1/(2 - 2^(1/3)); Forest and Ruth's method",
        f"E. Forest, R. D. Ruth, Physica D 43 (1990) 105–117, doi:10.1016/0167-2789(90)90019-L; {SUZUKI}; {YOSHIDA}",
        _composed("triple_jump"),
        ("triple-jump", "forest-ruth", "yoshida4"),
    ),
    MethodEntry(
        "suzuki4",
        "splitting",
        11,
        4,
        "five Strang steps with 1/(4 - 4^(1/3))",
        SUZUKI,
        _composed("suzuki_fractal"),
        ("suzuki-fractal4",),
    ),
    MethodEntry(
        "mclachlan4",
        "splitting",
        11,
        4,
        "ten Lie-Trotter steps, every other one adjoint, with small errors",
        MCLACHLAN,
        _mclachlan4,
    ),
    MethodEntry(
        "blanes-moan4",
        "splitting",
        13,
        4,
        "six stages with very small errors, as 15-digit decimals",
        "S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313–330, doi:10.1016/S0377-0427(01)00492-7",
        _blanes_moan4,
    ),
    MethodEntry(
        "yoshida6",
        "splitting",
        15,
        6,
        "seven Strang steps, as 26-digit decimals",
        f"{YOSHIDA}; Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), formula (V.3.11)",
        _yoshida6,
    ),
)
