"""Audits of sources: claims, orders, and entries that were made wrong."""

from __future__ import annotations

import json
import random
from fractions import Fraction

import jsonschema
import pytest

import bseries as bs
from bseries.analysis.rounding import hidden_order
from bseries.auditing import claims_of, corrections
from bseries.auditing.corrections import reached
from bseries.auditing.written import as_written

NAMES = (
    *("explicit-midpoint", "heun2", "kutta3", "heun3", "ssprk33", "rk4", "rk38", "merson4", "bogacki-shampine32"),
    *("fehlberg45", "cash-karp45", "dormand-prince54", "verner65", "implicit-midpoint", "trapezoidal", "qin-zhang"),
    *("radau-iia2", "lobatto-iiic3", "lobatto-iiia3"),
)


def claimed(method):
    """The orders of a method and of its other weights."""
    embedded = [bs.order_of(bs.RungeKutta(method.A, b, warn=False)) for b in method.embedded]
    return bs.order_of(method), embedded


def mutated(method, rng):
    """The method with one entry changed: a sign, a digit, or dropped; and the place and the right value."""
    rows = [list(row) for row in (*method.A, method.b)]
    i, j = rng.choice([(i, j) for i, row in enumerate(rows) for j, x in enumerate(row) if x])
    right = rows[i][j]
    digits = list(str(abs(right.numerator)))
    at = rng.randrange(len(digits))
    digits[at] = str((int(digits[at]) + rng.randrange(1, 10)) % 10)
    rows[i][j] = rng.choice([-right, Fraction(0), Fraction(int("".join(digits)), right.denominator)])
    entry = f"b[{j + 1}]" if i == method.stages else f"a[{i + 1},{j + 1}]"
    return bs.RungeKutta(rows[:-1], rows[-1], method.c, embedded=method.embedded or None, warn=False), entry, right


def test_changed_entries_are_found():
    """Four changes of each method; without an entry there may be another method of the same order, such as Heun's."""
    missed = []
    for name in NAMES:
        method, rng = bs.method(name), random.Random(name)
        order, embedded = claimed(method)
        assert corrections(method, order, embedded) == ()  # nobody is accused
        for _ in range(4):
            wrong, entry, right = mutated(method, rng)
            found = corrections(wrong, order, embedded)
            singles = {x.entries[0]: x.should_be[0] for x in found if len(x.entries) == 1}
            if singles.get(entry) != right and (found or claimed(wrong) != (order, embedded)):
                missed.append((name, entry, right))
    assert len(missed) <= 0.05 * 4 * len(NAMES), missed


def test_no_correction_where_the_claim_is_beyond_the_method():
    assert corrections(bs.method("rk4"), 5) == ()


@pytest.mark.parametrize(
    ("said", "name", "wanted"),
    [
        ({"order": "4"}, "", (4, None)),
        ({"q": "4", "p": "3"}, "", (4, 3)),
        ({"o": "2"}, "", (2, None)),
        ({"p": "5"}, "", (5, None)),
        ({"call": "ExplicitRKTableau(A, c, α, 5, αEEst = αEEst, adaptiveorder = 4, fsal = true)"}, "", (5, 4)),
        ({"call": "TSRKRegister(TSRK3, 3, 4, &A[0][0], b, NULL)"}, "", (3, None)),
        ({"comment": "the classical fourth-order method"}, "", (4, None)),
        ({"comment": "A fifth order method with an embedded fourth order one"}, "", (5, 4)),
        ({"comment": "order of 6"}, "", (6, None)),
        ({"comment": "3rd-order SSP scheme"}, "", (3, None)),
        ({"comment": "Dormand-Prince 5(4)"}, "", (5, 4)),
        ({"comment": "Fehlberg 4(5)"}, "", (5, 4)),
        ({}, "RKF45", (5, 4)),
        ({}, "DormandPrince54", (5, 4)),
        ({}, "RK42", (None, None)),
        ({}, "SSPRK104", (None, None)),
        ({}, "ARK436L2SA", (None, None)),
        ({"comment": "second-order derivative of f"}, "", (None, None)),
        ({"comment": "first-order system, third-order method"}, "", (3, None)),
        ({"comment": "either order 3 or order 4"}, "", (None, None)),
        ({"comment": "order conditions"}, "", (None, None)),
        ({"comment": "see References: J. Order 15, 4 (1990)"}, "", (None, None)),
        ({"order": "p"}, "", (None, None)),
        ({"order": "400"}, "", (None, None)),
        ({"comment": "in ascending order, 3 rows"}, "", (None, None)),
        ({"description": "A method of tenth order"}, "", (10, None)),
        ({"comment": "order: 7"}, "", (7, None)),
        ({"comment": "order=3"}, "", (3, None)),
        ({"comment": "lower-order companion"}, "", (None, None)),
        ({}, "", (None, None)),
    ],
)
def test_claims(said, name, wanted):
    found = claims_of(said, name)
    assert (found.order, found.embedded) == wanted


WRONG = "# fourth-order method\nA = [[0,0,0,0],[0.5,0,0,0],[0,-0.5,0,0],[0,0,1,0]]\nb = [1/6, 1/3, 1/3, 1/6]\n"


def test_sources_are_audited_with_line_and_words_of_the_source():
    found = bs.audit({"rk4.py": WRONG, "right.py": WRONG.replace("-0.5", "0.5"), "data.py": "x = [1, 2"})
    wrong, right = found.methods
    assert (wrong.order, right.order, found.holds, right.findings) == (1, 4, False, ())
    assert str(wrong.findings[0]) == "order 4, but order 1: a[3,2] = 0.5 in place of -0.5 (line 2)"
    data = json.loads(json.dumps(found.to_dict()))
    jsonschema.validate(data, bs.json_schema("audit"))
    assert data["methods"][0]["findings"][0]["candidates"][0][0]["should_be"] == "0.5"
    assert "order 4, but order 1" in str(found)


def test_known_faults_come_out():
    """TableauRK42 of RungeKutta.jl 0.5.22 had 1 for 2; a Fehlberg pair had 3554 for 3544."""
    julia = (
        "function RK42()\n o = 4\n a = [0 0 0 0; 1//4 0 0 0; 0 1//2 0 0; 1 -2 1 0]\n b = [1//6, 0, 2//3, 1//6]\nend\n"
    )
    (found,) = bs.audit({"erk.jl": julia}).methods
    assert [x["should_be"] for x in found.findings[0].corrections[0]] == ["2"]
    assert found.findings[0].corrections[0][0]["entry"] == "a[4,3]"
    A = "[[0]*6,[1/4,0,0,0,0,0],[3/32,9/32,0,0,0,0],[1932/2197,-7200/2197,7296/2197,0,0,0],"
    A += "[439/216,-8,3680/513,-845/4104,0,0],[-8/27,2,-3554/2565,1859/4104,-11/40,0]]"
    text = f"order = 5\nA = {A.replace('[0]*6', '[0,0,0,0,0,0]')}\n"
    text += "b = [16/135, 0, 6656/12825, 28561/56430, -9/50, 2/55]\n"
    (found,) = bs.audit({"rkf.py": text}).methods
    assert found.findings[0].corrections == (
        ({"entry": "a[6,3]", "was": "-3554/2565", "should_be": "-3544/2565", "line": 2},),
    )


def test_rounded_numbers_are_right_to_their_digits():
    g = "0.292893218813452"
    text = f"order = 2\nA = [[{g}, 0], [0.707106781186548, {g}]]\nb = [0.707106781186548, {g}]\n"
    (found,) = bs.audit({"sdirk.py": text}).methods
    assert (found.order, found.findings, found.digits is None) == (2, (), True)
    (found,) = bs.audit({"sdirk.py": text.replace("order = 2", "order = 3")}).methods
    assert found.findings[0].found == "order 2"


def test_numbers_are_written_as_in_the_source():
    assert as_written(Fraction(2, 3), "4/6") == "4/6"
    assert as_written(Fraction(1, 3), "-0.333") == "0.333"
    assert as_written(Fraction(-1, 2), "0.50") == "-0.50"
    assert as_written(Fraction(1, 7), "1//2") == "1//7"
    assert as_written(Fraction(3, 4), "3./5") == as_written(Fraction(3, 4), "3./4") == "3./4"  # 3/4 is 0 in C
    assert as_written(Fraction(3, 5), "convert(T, 1 // 5)") == "convert(T, 3 // 5)"
    assert as_written(Fraction(-1, 4), "-convert(T, 0.50)") == "-convert(T, 0.25)"
    assert as_written(Fraction(1, 4), "-SUN_RCONST(0.50)") == "SUN_RCONST(0.25)"
    assert as_written(Fraction(1, 300), "3.4e-3_wp") == "3.3e-3_wp"
    assert as_written(Fraction(1, 3), "RC(0.3330)") == "RC(0.3333)"
    assert as_written(Fraction(1, 3), 'parse(BigFloat, "0.34")') == 'parse(BigFloat, "0.33")'
    assert as_written(Fraction(2), "RCONST(1.0)") == "RCONST(2.0)"
    assert as_written(Fraction(1, 2), "-RCONST(3.0)/RCONST(2.0)") == "RCONST(1.0)/RCONST(2.0)"
    assert as_written(Fraction(1, 2), "1 - sqrt(2)") == "1/2"


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: bs.audit("/no/such/file"), "sources must be files and folders that exist"),
        (lambda: bs.audit({"a.py": WRONG}, order=0), "order must be"),
        (lambda: corrections(bs.method("gauss2"), 4), "method must be a tableau with rational entries"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(bs.errors, match=message):
        call()


def test_what_cannot_be_read_is_said_and_the_rest_audited(tmp_path):
    (tmp_path / "binary.c").write_bytes(bytes(range(256)))
    (tmp_path / "rk4.py").write_text(WRONG)
    found = bs.audit(tmp_path)
    assert len(found.methods) == 1
    assert any("binary.c" in sentence for sentence in found.unread)


def test_of_equal_changes_every_row_is_named():
    """Each change leaves one row whose sum differs from its node; it does not matter which row that is."""

    def tableau(a43, a53):
        A = [[0] * 5, [1, 0, 0, 0, 0], ["4/9", "2/9", 0, 0, 0], ["1/4", 0, a43, 0, 0], ["1/4", 0, a53, 0, 0]]
        return bs.RungeKutta(A, ["1/4", 0, "3/4", "-1/2", "1/2"], warn=False)

    found = {x.entries[0]: x.should_be[0] for x in corrections(tableau("3/4", "3/5"), 3)}
    assert found == {"a[4,3]": Fraction(3, 5), "a[5,3]": Fraction(3, 4)}
    assert bs.order_of(tableau("3/5", "3/5")) == bs.order_of(tableau("3/4", "3/4")) == 3
    assert bs.order_of(tableau("3/4", "3/5")) == 1


def test_an_order_stays_where_the_next_one_nearly_holds():
    """Large weights of both signs: order 1 to 30 digits, and order 2 to 8, too few for numbers that have 60."""
    large = Fraction(10**34 // 3, 10**30)
    A = [[0, 0, 0], ["1/2", 0, 0], [Fraction(1, 2) - 1 / (2 * Fraction(10**4, 3)) - Fraction(1, 10**8), 0, 0]]
    method = bs.RungeKutta(A, [1, large, Fraction(1, 10**26) - large], digits=60, warn=False)
    assert (bs.order_of(method), hidden_order(method, 0, 2).digits) == (0, 8)
    assert reached(method, 1)[0] == reached(method, 2)[0] == 1
    assert reached(method, 2)[1] >= 26
