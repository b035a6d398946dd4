"""The Baker–Campbell–Hausdorff series in the Lyndon basis, against words, matrices and known counts."""

from fractions import Fraction
from functools import cache
from itertools import product

import pytest

import bseries as bs
from bseries.exceptions import SeriesError
from bseries.hamiltonians.brackets import lyndon_basis
from bseries.hamiltonians.brackets.campbell_hausdorff import bch
from trees.lyndon_words import lyndon_words

HALF, ONE = Fraction(1, 2), Fraction(1)
NONZERO = [2, 1, 2, 1, 6, 5, 18, 17, 55, 55, 186, 185, 630, 629, 2181]  # OEIS counts of Lyndon words, less the zeros
SUMS = ["2", "1/2", "1/6", "1/24", "7/360", "1/144", "5/2016", "17/24192"]


def factors(word):
    cut = min(range(1, len(word)), key=lambda start: word[start:])
    return word[:cut], word[cut:]


@cache
def in_words(word):
    """The bracket of a Lyndon word as a sum of words."""
    if len(word) == 1:
        return {word: 1}
    found = {}
    first, second = map(in_words, factors(word))
    for (u, a), (v, b) in product(first.items(), second.items()):
        found[u + v] = found.get(u + v, 0) + a * b
        found[v + u] = found.get(v + u, 0) - a * b
    return found


def log_of_exponentials(letters, order):
    """log(exp(c_1 x_1) exp(c_2 x_2) …) as a sum of words, by the power series of exp and log."""

    def times(x, y):
        found = {}
        for (u, a), (v, b) in product(x.items(), y.items()):
            if len(u) + len(v) <= order:
                found[u + v] = found.get(u + v, 0) + a * b
        return found

    x = {(): ONE}
    for letter, c in letters:
        exponential = {(): ONE}
        for n in range(1, order + 1):
            exponential[(letter,) * n] = exponential[(letter,) * (n - 1)] * c / n
        x = times(x, exponential)
    del x[()]
    total, power = {}, {(): ONE}
    for n in range(1, order + 1):
        power = times(power, x)
        for word, value in power.items():
            total[word] = total.get(word, 0) + Fraction((-1) ** (n + 1), n) * value
    return {word: value for word, value in total.items() if value}


@pytest.mark.parametrize("symmetric", [False, True])
def test_words_of_the_logarithm(symmetric):
    letters = [("A", HALF), ("B", ONE), ("A", HALF)] if symmetric else [("A", ONE), ("B", ONE)]
    found = {}
    for word, value in bch(8, basis="lyndon", symmetric=symmetric).items():
        for letters_of_word, x in in_words(word).items():
            found[letters_of_word] = found.get(letters_of_word, 0) + value * x
    found = {word: value for word, value in found.items() if value}
    assert found == log_of_exponentials(letters, 8)
    assert found != log_of_exponentials([*letters[:-1], (letters[-1][0], ONE + Fraction(1, 10**6))], 8)


def test_known_counts_and_sums():
    series = bch(15, basis="lyndon")
    assert [len(series.term(k)) for k in range(15)] == NONZERO
    assert [str(sum(series.term(k).values())) for k in range(8)] == SUMS
    assert set(series) == {tuple("AB"[x] for x in word) for word in lyndon_words(15, 2)}


def superdiagonal(n):
    return [Fraction((3 * i + 1) % 7 - 3) for i in range(n)], [Fraction((5 * i + 2) % 11 - 5) for i in range(n)]


def corner_of_logarithm(n):
    """The entry (0, n) of log(exp A exp B) for superdiagonal matrices, with matrices of fractions."""
    import sympy

    a, b = superdiagonal(n)
    matrices = [sympy.zeros(n + 1, n + 1) for _ in range(2)]
    for i in range(n):
        matrices[0][i, i + 1], matrices[1][i, i + 1] = sympy.Rational(a[i]), sympy.Rational(b[i])
    exponentials = []
    for matrix in matrices:
        total = term = sympy.eye(n + 1)
        for k in range(1, n + 1):
            term = term * matrix / k
            total += term
        exponentials.append(total)
    x = exponentials[0] * exponentials[1] - sympy.eye(n + 1)
    total, power = sympy.zeros(n + 1, n + 1), sympy.eye(n + 1)
    for k in range(1, n + 1):
        power = power * x
        total += sympy.Rational((-1) ** (k + 1), k) * power
    return Fraction(str(total[0, n]))


@pytest.mark.parametrize("n", [6, 13, 14])
def test_corner_entries_of_nilpotent_matrices(n):
    entries = dict(zip("AB", superdiagonal(n), strict=True))

    @cache
    def corner(word, first):
        if len(word) == 1:
            return entries[word[0]][first]
        u, v = factors(word)
        return corner(u, first) * corner(v, first + len(u)) - corner(v, first) * corner(u, first + len(v))

    terms = bch(n, basis="lyndon").term(n - 1)
    assert sum(value * corner(word, 0) for word, value in terms.items()) == corner_of_logarithm(n)


def test_the_corner_published():
    assert corner_of_logarithm(6) == Fraction(-17, 120)


def test_access_and_refusals():
    series = bs.bch(4, ("X", "A"), basis="lyndon")
    assert series["[X,[[X,A],A]]"] == series["X", "X", "A", "A"] == Fraction(1, 24)
    assert series.to_dict()["basis"] == "lyndon"
    assert series.to_latex().endswith("\\frac{1}{24} [X,[[X,A],A]]\\right)")
    assert bs.bch(1, basis="lyndon").term(0) == {("A",): 1, ("B",): 1}
    with pytest.raises(SeriesError, match="basis must be nested, or lyndon for two letters, but was 'hall' for 2"):
        bch(3, basis="hall")
    with pytest.raises(SeriesError, match="basis must be nested, or lyndon for two letters, but was 'lyndon' for 3"):
        bch(3, ("A", "B", "C"), basis="lyndon")
    with pytest.raises(SeriesError, match="order must be at most 20 in the Lyndon basis, but was 21"):
        bch(21, basis="lyndon")


def test_numbers_beyond_64_bits_are_refused(monkeypatch):
    true = lyndon_basis.goldberg_coefficients
    prime = 2**36 + 31  # for degree 15 the coefficients of words still fit into 64 bits, but the coordinates do not
    monkeypatch.setattr(lyndon_basis, "goldberg_coefficients", lambda n: ((w, x * prime) for w, x in true(n)))
    with pytest.raises(ArithmeticError, match="do not fit"):
        bch(15, basis="lyndon")
