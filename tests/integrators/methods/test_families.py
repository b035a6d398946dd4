"""Gauss, Radau and Lobatto methods: the conditions that define them, their orders, and the printed tableaux."""

from __future__ import annotations

from fractions import Fraction

import order_oracle as oracle
import pytest
import sympy

from integrators.methods.catalogue.registry import method

# family: (fewest stages, p − 2s, s − q of C(q), s − r of D(r), symplectic, symmetric).
# HW IV.5, Table 5.13; L. O. Jay, Lobatto methods (2015).
THEORY = {
    "gauss": (1, 0, 0, 0, True, True),
    "radau-ia": (1, -1, 1, 0, False, False),
    "radau-iia": (1, -1, 0, 1, False, False),
    "lobatto-iiia": (2, -2, 0, 2, False, True),
    "lobatto-iiib": (2, -2, 2, 0, False, True),
    "lobatto-iiic": (2, -2, 1, 1, False, False),
    "lobatto-iiid": (2, -2, 1, 1, True, True),
    "lobatto-iiie": (2, -2, 2, 2, True, True),
}
CASES = [(name, stages) for name, theory in THEORY.items() for stages in range(theory[0], 7)]


class Stages:
    """Functions on the nodes, as polynomials modulo the node polynomial, with A, b and 1 − x acting on them."""

    def __init__(self, name: str) -> None:
        algebra = method(name).algebra
        self.size = len(algebra.A)
        self.b = algebra.b
        self.quotient = oracle.Quotient(algebra.polynomial, (algebra.A, algebra.b))
        x = (Fraction(0), Fraction(1), *[Fraction(0)] * (self.size - 2))
        # With one stage x is a number, the only node.
        self.x = x if self.size > 1 else (-algebra.polynomial[0],)
        self.powers = [self.quotient.one]

    def power(self, exponent: int) -> tuple:
        while len(self.powers) <= exponent:
            self.powers.append(self.quotient.times(self.powers[-1], self.x))
        return self.powers[exponent]

    def image(self, values: tuple) -> tuple:
        return self.quotient.image(0, values)

    def weigh(self, first: tuple, *second: tuple) -> Fraction:
        return self.quotient.weigh(0, self.quotient.times(first, *second) if second else first)

    def satisfies_b(self, k: int) -> bool:
        return self.weigh(self.power(k - 1)) == Fraction(1, k)

    def satisfies_c(self, k: int) -> bool:
        return self.image(self.power(k - 1)) == tuple(value / k for value in self.power(k))

    def satisfies_d(self, k: int) -> bool:
        return all(
            k * self.weigh(self.power(k - 1), self.image(self.power(m)))
            == self.weigh(self.power(m)) - self.weigh(self.power(k + m))
            for m in range(self.size)
        )

    def reflect(self, values: tuple) -> tuple:
        """f(1 − x), by Horner's rule."""
        mirrored = tuple(one - x for one, x in zip(self.quotient.one, self.x, strict=True))
        total = tuple(Fraction(0) for _ in values)
        for value in reversed(values):
            product = self.quotient.times(total, mirrored)
            total = tuple(p + value * one for p, one in zip(product, self.quotient.one, strict=True))
        return total

    def defect_of_symplecticity(self, partner: Stages) -> set[Fraction]:
        """Values of b_i a_ij + b_j â_ji − b_i b_j on products of powers."""
        powers = [self.power(k) for k in range(self.size)]
        return {
            self.weigh(f, self.image(g)) + self.weigh(partner.image(f), g) - self.weigh(f) * self.weigh(g)
            for f in powers
            for g in powers
        }

    def is_symmetric(self) -> bool:
        """a_{s+1−i,s+1−j} + a_ij = b_j, on powers."""
        return all(
            tuple(map(sum, zip(self.reflect(self.image(self.reflect(f))), self.image(f), strict=True)))
            == tuple(self.weigh(f) * one for one in self.quotient.one)
            for f in map(self.power, range(self.size))
        )


def largest(condition, limit: int) -> int:
    """The largest k such that the condition holds for 1 … k; k + 1 fails."""
    return next(k for k in range(limit + 2) if not condition(k + 1))


@pytest.mark.parametrize(("name", "stages"), CASES)
def test_simplifying_assumptions_hold_and_no_higher_ones(name: str, stages: int) -> None:
    _, order, c, d, _, _ = THEORY[name]
    found = Stages(f"{name}{stages}")
    assert largest(found.satisfies_b, 2 * stages) == 2 * stages + order
    assert largest(found.satisfies_c, 2 * stages) == stages - c
    assert largest(found.satisfies_d, 2 * stages) == stages - d


@pytest.mark.parametrize(("name", "stages"), CASES)
def test_symplectic_and_symmetric_as_the_theory_says(name: str, stages: int) -> None:
    *_, symplectic, symmetric = THEORY[name]
    found = Stages(f"{name}{stages}")
    assert (found.defect_of_symplecticity(found) == {0}) is symplectic
    assert found.is_symmetric() is symmetric


@pytest.mark.parametrize(("name", "stages"), [case for case in CASES if case[1] <= 3])
def test_methods_know_their_structure(name: str, stages: int) -> None:
    *_, symplectic, symmetric = THEORY[name]
    assert method(f"{name}{stages}").is_symplectic is symplectic
    assert method(f"{name}{stages}").is_symmetric is symmetric


@pytest.mark.parametrize(("name", "stages"), [case for case in CASES if case[1] <= 3])
def test_order_from_all_trees(name: str, stages: int) -> None:
    # Lobatto IIIB and IIIE with two stages too: their rows do not add up to the nodes, and the order is still 2.
    assert oracle.order_of(Stages(f"{name}{stages}").quotient) == 2 * stages + THEORY[name][1]


@pytest.mark.parametrize(("name", "stages"), [("radau-iia", 4), ("lobatto-iiic", 4), ("lobatto-iiid", 4)])
def test_order_from_all_trees_with_four_stages(name: str, stages: int) -> None:
    assert oracle.order_of(Stages(f"{name}{stages}").quotient) == 2 * stages + THEORY[name][1]


@pytest.mark.parametrize("stages", [2, 3, 4, 5])
@pytest.mark.parametrize(
    ("p", "q", "symplectic"),
    [
        ("lobatto-iiib", "lobatto-iiia", True),
        ("gauss", "gauss", True),
        ("lobatto-iiia", "lobatto-iiia", False),
        ("lobatto-iiic", "lobatto-iiia", False),
    ],
)
def test_symplectic_pairs(p: str, q: str, symplectic: bool, stages: int) -> None:
    p_part, q_part = Stages(f"{p}{stages}"), Stages(f"{q}{stages}")
    assert (p_part.defect_of_symplecticity(q_part) == {0}) is symplectic


def test_many_stages_need_no_roots() -> None:
    found = Stages("gauss20")
    assert found.weigh(found.power(39)) == Fraction(1, 40)
    assert found.weigh(found.power(40)) != Fraction(1, 41)


R6, R15, R3, R5 = map(sympy.sqrt, (6, 15, 3, 5))


def exact(rows: str) -> list[list[sympy.Expr]]:
    """A printed tableau: rows on lines, entries separated by spaces, r6 for √6."""
    names = {"r3": R3, "r5": R5, "r6": R6, "r15": R15}
    return [[sympy.sympify(entry, locals=names, rational=True) for entry in row.split()] for row in rows.split("\n")]


# The last row is b, the first column c. HLW Tables II.1.1–1.2; HW Tables IV.5.2–5.12; Jay (2015).
PRINTED = {
    "gauss1": "1/2 1/2\n0 1",
    "gauss2": "1/2-r3/6 1/4 1/4-r3/6\n1/2+r3/6 1/4+r3/6 1/4\n0 1/2 1/2",
    "gauss3": "1/2-r15/10 5/36 2/9-r15/15 5/36-r15/30\n1/2 5/36+r15/24 2/9 5/36-r15/24\n"
    "1/2+r15/10 5/36+r15/30 2/9+r15/15 5/36\n0 5/18 4/9 5/18",
    "radau-ia1": "0 1\n0 1",
    "radau-ia2": "0 1/4 -1/4\n2/3 1/4 5/12\n0 1/4 3/4",
    "radau-ia3": "0 1/9 (-1-r6)/18 (-1+r6)/18\n(6-r6)/10 1/9 (88+7*r6)/360 (88-43*r6)/360\n"
    "(6+r6)/10 1/9 (88+43*r6)/360 (88-7*r6)/360\n0 1/9 (16+r6)/36 (16-r6)/36",
    "radau-iia1": "1 1\n0 1",
    "radau-iia2": "1/3 5/12 -1/12\n1 3/4 1/4\n0 3/4 1/4",
    "radau-iia3": "(4-r6)/10 (88-7*r6)/360 (296-169*r6)/1800 (-2+3*r6)/225\n"
    "(4+r6)/10 (296+169*r6)/1800 (88+7*r6)/360 (-2-3*r6)/225\n1 (16-r6)/36 (16+r6)/36 1/9\n"
    "0 (16-r6)/36 (16+r6)/36 1/9",
    "lobatto-iiia2": "0 0 0\n1 1/2 1/2\n0 1/2 1/2",
    "lobatto-iiia3": "0 0 0 0\n1/2 5/24 1/3 -1/24\n1 1/6 2/3 1/6\n0 1/6 2/3 1/6",
    "lobatto-iiia4": "0 0 0 0 0\n(5-r5)/10 (11+r5)/120 (25-r5)/120 (25-13*r5)/120 (-1+r5)/120\n"
    "(5+r5)/10 (11-r5)/120 (25+13*r5)/120 (25+r5)/120 (-1-r5)/120\n1 1/12 5/12 5/12 1/12\n0 1/12 5/12 5/12 1/12",
    "lobatto-iiib2": "0 1/2 0\n1 1/2 0\n0 1/2 1/2",
    "lobatto-iiib3": "0 1/6 -1/6 0\n1/2 1/6 1/3 0\n1 1/6 5/6 0\n0 1/6 2/3 1/6",
    "lobatto-iiib4": "0 1/12 (-1-r5)/24 (-1+r5)/24 0\n(5-r5)/10 1/12 (25+r5)/120 (25-13*r5)/120 0\n"
    "(5+r5)/10 1/12 (25+13*r5)/120 (25-r5)/120 0\n1 1/12 (11-r5)/24 (11+r5)/24 0\n0 1/12 5/12 5/12 1/12",
    "lobatto-iiic2": "0 1/2 -1/2\n1 1/2 1/2\n0 1/2 1/2",
    "lobatto-iiic3": "0 1/6 -1/3 1/6\n1/2 1/6 5/12 -1/12\n1 1/6 2/3 1/6\n0 1/6 2/3 1/6",
    "lobatto-iiic4": "0 1/12 -r5/12 r5/12 -1/12\n(5-r5)/10 1/12 1/4 (10-7*r5)/60 r5/60\n"
    "(5+r5)/10 1/12 (10+7*r5)/60 1/4 -r5/60\n1 1/12 5/12 5/12 1/12\n0 1/12 5/12 5/12 1/12",
    "lobatto-iiid2": "0 1/4 -1/4\n1 3/4 1/4\n0 1/2 1/2",
    "lobatto-iiid3": "0 1/12 -1/6 1/12\n1/2 5/24 1/3 -1/24\n1 1/12 5/6 1/12\n0 1/6 2/3 1/6",
    "lobatto-iiie2": "0 1/4 0\n1 1/2 1/4\n0 1/2 1/2",
    "lobatto-iiie3": "0 1/12 -1/12 0\n1/2 3/16 1/3 -1/48\n1 1/6 3/4 1/12\n0 1/6 2/3 1/6",
}


@pytest.mark.parametrize("name", PRINTED)
def test_printed_tableaux(name: str) -> None:
    """The matrix in powers of x does at the printed nodes what the printed matrix does."""
    algebra = method(name).algebra
    *rows, (_, *weights) = exact(PRINTED[name])
    nodes = [row[0] for row in rows]
    powers = range(len(nodes))
    assert [sympy.expand(sum(p * c**k for k, p in enumerate(algebra.polynomial))) for c in nodes] == [0] * len(nodes)
    for degree in powers:
        moments = [c**degree for c in nodes]
        assert sympy.expand(sum(b * m for b, m in zip(weights, moments, strict=True)) - algebra.b[degree]) == 0
        for node, *row in rows:
            printed = sum(a * m for a, m in zip(row, moments, strict=True))
            computed = sum(algebra.A[k][degree] * node**k for k in powers)
            assert sympy.expand(printed - computed) == 0
