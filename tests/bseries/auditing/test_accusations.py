"""Entries and rows that must not be accused: equals are all named, pairs decide for both parts, digits are enough."""

from __future__ import annotations

from fractions import Fraction

import bseries as bs
from bseries.analysis.rounding import hidden_order
from bseries.auditing import corrections
from bseries.auditing.corrections import reached

BPR = """
/* third order ARK IMEX scheme */
const double A[5][5] = {{0,0,0,0,0},{1,0,0,0,0},{4./9,2./9,0,0,0},{1./4,0,3./4,0,0},{1./4,0,3./5,0,0}};
const double At[5][5] = {
  {0,0,0,0,0},{.5,.5,0,0,0},{5./18,-1./9,.5,0,0},{.5,0,0,.5,0},{.25,0,.75,-.5,.5}};
TSARKIMEXRegister(MINE, 3, 5, &At[0][0], NULL, NULL, &A[0][0], NULL, NULL, NULL, NULL, 0, NULL, NULL);
"""


def explicit_part(a43="3/4", a53="3/5"):
    A = [[0] * 5, [1, 0, 0, 0, 0], ["4/9", "2/9", 0, 0, 0], ["1/4", 0, a43, 0, 0], ["1/4", 0, a53, 0, 0]]
    return bs.RungeKutta(A, ["1/4", 0, "3/4", "-1/2", "1/2"], warn=False)


def test_of_equal_changes_the_later_row_is_named_too():
    """Both changes leave one row whose sum differs from the nodes; it does not matter which row that is."""
    found = {x.entries[0]: x.should_be[0] for x in corrections(explicit_part(), 3)}
    assert found == {"a[4,3]": Fraction(3, 5), "a[5,3]": Fraction(3, 4)}
    assert {bs.order_of(explicit_part("3/5", "3/5")), bs.order_of(explicit_part("3/4", "3/4"))} == {3}


def test_both_parts_of_a_pair_decide_which_entry_is_wrong():
    """With a[4,3] = 3/5 the explicit part has order 3, but its nodes are not those of the implicit part."""
    (method,) = bs.audit({"arkimex.c": BPR}).methods
    (finding,) = method.findings
    assert (method.order, method.kind) == (1, "additive")
    ((change,),) = finding.corrections
    assert (change["entry"], change["should_be"]) == ("a[5,3]", "3./4")
    right = bs.audit({"arkimex.c": BPR.replace("3./5", "3./4")})
    assert (right.methods[0].order, right.holds) == (3, True)


def test_an_order_stays_proved_where_the_next_one_nearly_holds():
    """Large weights of both signs: order 1 to 30 digits, and order 2 to 8, too few for numbers that have 30."""
    large = Fraction(10**34 // 3, 10**30)
    weights = [1, large, Fraction(1, 10**26) - large]
    A = [[0, 0, 0], ["1/2", 0, 0], [Fraction(1, 2) - 1 / (2 * Fraction(10**4, 3)) - Fraction(1, 10**8), 0, 0]]
    method = bs.RungeKutta(A, weights, digits=60, warn=False)
    assert (bs.order_of(method), hidden_order(method, 0, 2).digits) == (0, 8)
    assert reached(method, 1)[0] == reached(method, 2)[0] == 1
    assert reached(method, 2)[1] >= 26


def test_nodes_with_roots_beside_rational_entries_are_read():
    text = (
        "# second-order method\nA = [[0, 0], [0.7071067811865476, 0]]\nb = [0.29289321881345254, 0.7071067811865475]\n"
    )
    (method,) = bs.audit({"mine.py": text + "c = [0, sqrt(2)/2]\n"}).methods
    assert (method.order, method.findings) == (2, ())


def test_nodes_that_are_no_row_sums_are_notes_that_say_what_would_agree():
    """There are methods whose nodes are no row sums, such as Oliver's, so nobody is accused."""
    text = "# second-order method\nA = [[0, 0], [1/2, 0]]\nb = [0, 1]\nc = [{}]\n"
    for nodes, end in (("0, 5", "2; c[2] = 1/2 would agree"), ("1/2, 0", "1, 2; c[1] and c[2] exchanged would agree")):
        found = bs.audit({"a.py": text.format(nodes)})
        assert found.holds
        assert found.methods[0].notes[0].endswith(end)
    assert bs.audit({"a.py": text.format("0, 1/2")}).methods[0].notes == ()


def test_entries_of_the_last_row_that_are_the_weights_change_together():
    """Lobatto IIIC, and the pair of Bogacki and Shampine with names of entries, whose other weights are differences."""
    lobatto = (
        "order = 4\nA = [[1/6, -1/3, 1/6], [1/6, 5/12, -1/12], [1/6, {0}, 1/6]]\nb = [1/6, {0}, 1/6]\nc = [0, 1/2, 1]\n"
    )
    assert bs.audit({"a.py": lobatto.format("2/3")}).holds
    ((changes,),) = [x.corrections for x in bs.audit({"a.py": lobatto.format("2/5")}).methods[0].findings]
    assert [(x["entry"], x["should_be"], x["line"]) for x in changes] == [("a[3,2]", "2/3", 2), ("b[2]", "2/3", 3)]
    pair = (
        "# third-order with embedded order 2\n"
        "a21 = 1//2\na32 = 3//4\na41 = 2//9\na42 = {}\na43 = 4//9\nc1 = 1//2\nc2 = 3//4\n"
        "btilde1 = 5//72\nbtilde2 = -1//12\nbtilde3 = -1//9\nbtilde4 = 1//8\n"
    )
    assert bs.audit({"a.jl": pair.format("1//3")}).holds
    ((changes,),) = [x.corrections for x in bs.audit({"a.jl": pair.format("1//4")}).methods[0].findings]
    assert [(x["should_be"], x["line"]) for x in changes] == [("1//3", 5)]
