"""Splitting methods for y' = f^a(y) + f^b(y); compositions of Strang's are in `symmetric_compositions`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from integrators.methods.catalogue.entry import MethodEntry

if TYPE_CHECKING:
    from collections.abc import Callable
    from fractions import Fraction

    from integrators.methods.kinds.splitting import Splitting

HLW = "Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), §II.5, doi:10.1007/3-540-30666-8"
MCLACHLAN = "R. I. McLachlan, SIAM J. Sci. Comput. 16 (1995) 151–168, doi:10.1137/0916010"
BLANES_MOAN = "S. Blanes, P. C. Moan, J. Comput. Appl. Math. 142 (2002) 313–330, doi:10.1016/S0377-0427(01)00492-7"


def symmetric_flows(first: str, second: str, x: str, y: str) -> list[tuple[str, Fraction]]:
    """x_1, y_1, x_2, y_2, … and back, the last one in the middle of the step, once.

    Args:
        first: the part that begins, with the coefficients x.
        second: the other part, with the coefficients y.
        x: the numbers x_i but the last one, which follows, as their sum over the step is 1.
        y: likewise the y_i.

    Returns:
        The flows of the whole step.

    Example:
        >>> [(part, str(time)) for part, time in symmetric_flows("a", "b", "1/8", "")]
        [('a', '1/8'), ('b', '1/2'), ('a', '3/4'), ('b', '1/2'), ('a', '1/8')]
    """
    from fractions import Fraction
    from itertools import zip_longest

    outer, inner = ([Fraction(number) for number in text.split()] for text in (x, y))
    single, paired = (outer, inner) if len(outer) > len(inner) else (inner, outer)
    single.append(1 - 2 * sum(single, Fraction(0)))
    paired.append(Fraction(1, 2) - sum(paired))
    pairs = zip_longest(((first, time) for time in outer), ((second, time) for time in inner))
    there = [flow for pair in pairs for flow in pair if flow is not None]
    return [*there, *there[-2::-1]]


def _given(*flows: tuple[str, str]) -> Callable[..., Splitting]:
    """The builder of a method from all its flows."""

    def build(*, name: str, reference: str) -> Splitting:
        from integrators.methods.kinds.splitting import Splitting

        return Splitting(flows, name=name, reference=reference)

    return build


def _symmetric(first: str, second: str, x: str, y: str, *, digits: int) -> Callable[..., Splitting]:
    """The builder of a method with palindromic decimals."""

    def build(*, name: str, reference: str) -> Splitting:
        from integrators.methods.kinds.splitting import Splitting

        flows = symmetric_flows(first, second, x, y)
        return Splitting(flows, parts=("a", "b"), name=name, reference=reference, digits=digits)

    return build


def _mclachlan4(*, name: str, reference: str) -> Splitting:
    """Lie–Trotter steps Φ and their adjoints in turn: Φ_(α5 h) ∘ Φ*_(β5 h) ∘ … ∘ Φ_(α1 h) ∘ Φ*_(β1 h)."""
    from integrators.methods.kinds.splitting import Splitting

    beta = ["(14-sqrt(19))/108", "(-23-20*sqrt(19))/270", "1/5", "(-2+10*sqrt(19))/135", "(146+5*sqrt(19))/540"]
    flows = [flow for x, y in zip(beta, beta[::-1], strict=True) for flow in (("b", x), ("a", x), ("a", y), ("b", y))]
    return Splitting(flows, parts=("a", "b"), name=name, reference=reference)


METHODS = (
    MethodEntry("lie-trotter", "splitting", 2, 1, "a step of a, then a step of b", HLW, _given(("a", "1"), ("b", "1"))),
    MethodEntry(
        "strang",
        "splitting",
        3,
        2,
        "half a step of a, a step of b, half a step of a",
        f"G. Strang, SIAM J. Numer. Anal. 5 (1968) 506–517, doi:10.1137/0705041; {HLW}",
        _given(("a", "1/2"), ("b", "1"), ("a", "1/2")),
        ("strang-splitting", "marchuk"),
    ),
    MethodEntry(
        "ruth3",
        "splitting",
        6,
        3,
        "three steps of each part, with rational coefficients",
        "R. D. Ruth, IEEE Trans. Nucl. Sci. 30 (1983) 2669–2671, doi:10.1109/TNS.1983.4332919",
        _given(("a", "7/24"), ("b", "2/3"), ("a", "3/4"), ("b", "-2/3"), ("a", "-1/24"), ("b", "1")),
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
        "pefrl4",
        "splitting",
        9,
        4,
        "Forest and Ruth's method with one more stage and smaller errors, as 16-digit decimals",
        "I. P. Omelyan, I. M. Mryglod, R. Folk, Comput. Phys. Commun. 146 (2002) 188–202, "
        "doi:10.1016/S0010-4655(02)00451-4",
        _symmetric("b", "a", "0.1786178958448091 -0.06626458266981849", "0.7123418310626054", digits=15),
        ("pefrl", "omelyan4"),
    ),
    MethodEntry(
        "blanes-moan4",
        "splitting",
        13,
        4,
        "six stages with very small errors, as 15-digit decimals; recommended for order 4",
        BLANES_MOAN,
        _symmetric(
            "a",
            "b",
            "0.0792036964311957 0.353172906049774 -0.0420650803577195",
            "0.209515106613362 -0.143851773179818",
            digits=15,
        ),
    ),
    # Printed with 15 digits. The order conditions leave one parameter, taken to be the second number as printed; the
    # others are the solution of the conditions next to the printed ones.
    MethodEntry(
        "blanes-moan6",
        "splitting",
        21,
        6,
        "ten stages, as 15-digit decimals refined to 32; recommended for order 6",
        BLANES_MOAN,
        _symmetric(
            "a",
            "b",
            "0.0502627644003926658937494455486448 0.413514300428344 0.0450798897943980363898651731542663 "
            "-0.1880548538195690771124424466686314 0.5419606784507802019155816322331577",
            "0.1488164479010432053333931406648383 -0.1323858657677835879043958615671915 "
            "0.0673076046921844904199612816920070 0.4326664025781735350222165239488431",
            digits=32,
        ),
        ("blanes-moan-s10",),
    ),
)
