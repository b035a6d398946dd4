"""Audits of splitting, Nyström and Rosenbrock methods, and of compositions of a method and its adjoint."""

from __future__ import annotations

from fractions import Fraction
from math import sqrt

import pytest

import bseries as bs

RUTH = """
table->q = 3;
table->a[0] = 2.0 / 3.0; table->a[1] = -2.0 / 3.0; table->a[2] = 1.0;
table->ahat[0] = 7.0 / 24.0; table->ahat[1] = 3.0 / 4.0; table->ahat[2] = -1.0 / 24.0;
"""

FOURTH = """
function coefficients(::Mine)
    a = Array{T}(@big [ (146 + 5*√19)/540, (-2 + 10*√19)/135, 1/5, (-23 - 20*√19)/270, (14 - √19)/108 ])
    SplittingCoefficientsNonSymmetric(:Mine, 4, ROWS)
end
"""


def audited(text, name):
    (method,) = bs.audit({name: text}).methods
    return method


def test_splitting_methods_are_proved_and_the_wrong_time_is_named():
    right = audited(RUTH, "ruth.c")
    assert (right.kind, right.order, right.findings) == ("splitting", 3, ())
    wrong = audited(RUTH.replace("-1.0 / 24.0", "1.0 / 24.0"), "ruth.c")
    assert wrong.order < 3
    (finding,) = wrong.findings
    assert [[(x["entry"], x["should_be"], x["line"]) for x in change] for change in finding.corrections] == [
        [("ahat[3]", "-1.0 / 24.0", 4)]
    ]
    assert bs.audit({"ruth.c": RUTH.replace("-2.0 / 3.0", "2.0 / 3.0")}).methods[0].findings[0].corrections


def test_exchanged_rows_of_a_composition_are_named():
    """McLachlan's method of order 4 applies the adjoint first (SIAM J. Sci. Comput. 16, 1995, table 2)."""
    right = audited(FOURTH.replace("ROWS", "a[end:-1:1], a"), "mine.jl")
    assert (right.name, right.kind, right.order, right.findings) == ("Mine", "composition", 4, ())
    wrong = audited(FOURTH.replace("ROWS", "a, a[end:-1:1]"), "mine.jl")
    assert wrong.order == 2
    ((first, second),) = wrong.findings[0].corrections
    assert (first["entry"], first["should_be"]) == (second["should_be"], second["entry"]) == ("method", "adjoint")


def test_the_composition_is_that_of_its_flows():
    """The second method: the flows written out."""
    root = sqrt(19)
    a = [(146 + 5 * root) / 540, (-2 + 10 * root) / 135, 1 / 5, (-23 - 20 * root) / 270, (14 - root) / 108]
    orders = []
    for one, two in ((a[::-1], a), (a, a[::-1])):
        times = [t for pair in zip(one, two, strict=True) for x in pair for t in (x, x)]
        orders.append(bs.order_of(bs.Splitting(zip("pqqp" * 5, times, strict=True))))
    assert orders == [4, 2]


def test_an_order_for_second_order_equations_only_is_said():
    """The method of McLachlan and Atela with four stages has order 4 where the kinetic energy is quadratic."""
    a = ["0.515352837431122936", "-0.085782019412973646", "0.441583023616466524", "0.128846158365384185"]
    b = ["0.134496199277431089", "-0.224819803079420806", "0.756320000515668291", "0.33400360328632142"]
    lines = [f"table->{n}[{i}] = {x};" for n, row in (("a", a), ("ahat", b)) for i, x in enumerate(row)]
    found = audited("\n".join(["table->q = 4;", *lines]), "four.c")
    assert (found.order, found.findings) == (3, ())
    assert found.notes == ("order 4 for second-order equations q'' = g(q) only",)


@pytest.mark.parametrize("sign", ["", "-"])
def test_rosenbrock_methods_are_proved(sign):
    """ROS2 of Verwer et al. (1999): order 2 for every γ; with the other sign of γ₂₁ order 1."""
    text = f"""
const double A[2][2] = {{{{0, 0}}, {{1, 0}}}};
const double Gamma[2][2] = {{{{0.25, 0}}, {{{"-" if not sign else ""}0.5, 0.25}}}};
const double b[2] = {{0.5, 0.5}};
TSRosWRegister(ROS2, 2, 2, &A[0][0], &Gamma[0][0], b, NULL, 0, NULL);
"""
    found = audited(text, "ros.c")
    assert (found.kind, found.order) == ("rosenbrock", 1 if sign else 2)
    assert bool(found.findings) == bool(sign)


def test_nystrom_methods_are_proved():
    """Nyström's method with three stages has order 4; with another weight it has not."""
    text = """
function MineTableau(T)
    a = [0 0 0; 1//8 0 0; 0 1//2 0]
    b = [1//6, 1//3, 0]
    bp = [1//6, 2//3, WEIGHT]
    c = [0, 1//2, 1]
end
"""
    assert audited(text.replace("WEIGHT", "1//6"), "n.jl").order == 4
    assert audited(text.replace("WEIGHT", "1//5"), "n.jl").order == 0


def test_exact_numbers_without_a_claim_have_their_exact_order():
    """A weight that is wrong by 1e-8: order 4 to 8 digits only where order 4 is claimed."""
    wrong = Fraction(1, 6) + Fraction(1, 10**8)
    weights = f"{wrong.numerator}//{wrong.denominator}, 1//3, 1//3, 1//6"
    text = f"A = [0 0 0 0; 1//2 0 0 0; 0 1//2 0 0; 0 0 1 0]\nb = [{weights}]\n"
    assert audited(text, "rk.jl").order == 0
    claimed = audited("order = 4\n" + text, "rk.jl")
    assert (claimed.order, claimed.findings) == (4, ())
    assert claimed.digits == 8


SOURCES = {
    "williamson.jl": ("williamson3", "A = [0, -5//9, -153//128]\nB = [1//3, 15//16, 8//15]\n"),
    "ssprk.py": (
        "ssprk33",
        "alpha = [[0, 0, 0], [1, 0, 0], [3/4, 1/4, 0], [1/3, 0, 2/3]]\n"
        "beta = [[0, 0, 0], [1, 0, 0], [0, 1/4, 0], [0, 0, 2/3]]\n",
    ),
    "short.py": (
        "ssprk33",
        "alpha10 = 1\nalpha20 = 3/4\nalpha21 = 1/4\nalpha30 = 1/3\nalpha32 = 2/3\n"
        "beta10 = 1\nbeta21 = 1/4\nbeta32 = 2/3\n",
    ),
}


@pytest.mark.parametrize("name", SOURCES)
def test_forms_in_few_registers_are_proved(name):
    method, text = SOURCES[name]
    found = audited(text, name)
    assert found.order == bs.order_of(method) == 3
    wrong = audited(text.replace("8//15", "7//15").replace("2/3", "3/5"), name)
    assert wrong.order < 3


ILL_FITTING = {
    "composition.jl": "a = [1]\nb = [0, 1//4]\nSplittingCoefficientsNonSymmetric(:x, 2, a, b)\n",
    "three.py": "gamma1 = [0, 1]\ngamma2 = [1]\ngamma3 = [0, 0]\nbeta = [1, 1]\ndelta = [1, 0]\n",
}


@pytest.mark.parametrize("name", ILL_FITTING)
def test_rows_that_do_not_fit_are_said(name):
    found = bs.audit({name: ILL_FITTING[name]})
    assert found.methods == ()
    assert "rows must have equally many entries, but had 1 and 2" in found.unread[0]


def test_rows_named_alpha_and_beta_are_times_of_two_flows():
    found = audited("alpha = [[0, 1/2, 1]]\nbeta = [[1, 0]]\norder = 2\n", "flows.py")
    assert (found.kind, found.order) == ("splitting", 0)
