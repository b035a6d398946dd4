"""Structures that are claimed: true ones are not accused, also of rounded numbers, and false ones are said."""

from __future__ import annotations

import json
from fractions import Fraction

import jsonschema
import pytest
import sympy

import bseries as bs
from bseries.auditing.structures import stage_order_of, violated


def decimals(name, digits, change=0):
    """A method with its entries as decimals, and the first one changed."""
    method = bs.method(name)
    A = [[Fraction(str(sympy.N(x, digits))) for x in row] for row in method.A]
    A[0][0] += Fraction(change)
    return bs.RungeKutta(A, [Fraction(str(sympy.N(x, digits))) for x in method.b], digits=digits, warn=False)


@pytest.mark.parametrize("structure", ["symplectic", "symmetric"])
def test_gauss_methods_have_the_structures_exactly_and_in_decimals(structure):
    assert list(violated(bs.method("gauss2"), [structure])) == []
    assert list(violated(decimals("gauss2", 16), [structure])) == []
    assert list(violated(decimals("gauss2", 16, "1e-4"), [structure])) == [structure]
    assert list(violated(bs.method("radau-iia2"), [structure])) == [structure]


def test_ssp_and_fsal():
    assert list(violated(bs.method("ssprk33"), ["SSP"])) == list(violated(bs.method("ssprk104"), ["SSP"])) == []
    assert list(violated(bs.method("rk4"), ["SSP", "FSAL"])) == ["SSP", "FSAL"]
    assert list(violated(bs.method("dormand-prince54"), ["FSAL"])) == []
    assert list(violated(bs.method("fehlberg45"), ["FSAL"])) == ["FSAL"]


@pytest.mark.parametrize("name", ["gauss2", "radau-iia2", "lobatto-iiia3", "implicit-midpoint", "rk4", "trapezoidal"])
def test_stage_orders_agree_with_check_exactly_and_in_decimals(name):
    expected = bs.check(name).stage_order
    assert stage_order_of(bs.method(name), 9) == stage_order_of(decimals(name, 16), 9) == expected
    assert stage_order_of(decimals(name, 16, "1e-4"), 9) == 1  # nodes are the sums of the changed row


def test_findings_of_structures_are_said_and_fit_the_schema():
    text = "# {} method of order 2, stage order {}\nA = [[1/2]]\nb = [1]\n"
    found = bs.audit({"a.py": text.format("symplectic", 1), "b.py": text.format("FSAL", 2)})
    right, wrong = found.methods
    assert (right.claims, right.findings) == ({"order": 2, "stage_order": 1, "symplectic": True}, ())
    assert [str(x) for x in wrong.findings] == [
        "stage order 2, but stage order 1",
        "FSAL, but the coefficients are not FSAL",
    ]
    jsonschema.validate(json.loads(json.dumps(found.to_dict())), bs.json_schema("audit"))
    assert "2, stage order 1, symplectic" in str(found)


def test_names_whose_digits_may_be_stages_accuse_nobody():
    """RK65 may have six stages and order 5, as Butcher's; RK54 five stages and order 4."""
    kutta = "def RK43():\n    A = [[0,0,0,0],[1/2,0,0,0],[0,1/2,0,0],[0,0,1,0]]\n    b = [0, 1/2, 1/2, 0]\n"
    (method,) = bs.audit({"a.py": kutta}).methods
    assert (method.claims, method.order) == ({"order": 3}, 2)
    butcher = kutta.replace("[0, 1/2, 1/2, 0]", "[1/6, 1/3, 1/3, 1/6]")
    assert bs.audit({"a.py": butcher}).holds
    assert bs.audit({"a.py": butcher.replace("RK43", "RK54")}).holds


def test_of_a_pair_that_a_text_names_either_row_may_be_the_first():
    """Sharp and Smart's 3(2): the name does not say which row is which; fields do."""
    pair = "A = [[0,0,0,0],[1/4,0,0,0],[-387/625,762/625,0,0],[1/5,1/5,3/5,0]]\n"
    pair += "b = [1/10, 2/5, 1/4, 1/4]\nbhat = [-1/90, 8/15, 5/18, 1/5]\n"
    (named,) = bs.audit({"a.py": "# Sharp-Smart RK3(2)4\n" + pair}).methods
    assert (named.order, named.embedded_orders, named.findings) == (2, (3,), ())
    assert named.notes == ("order 3 is that of the second row of weights",)
    (fields,) = bs.audit({"a.py": "order = 3\nembedded_order = 2\n" + pair}).methods
    assert [x.claim for x in fields.findings] == ["order 3"]
