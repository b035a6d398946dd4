"""Claims in texts as packages write them; where a text may mean two things, it claims nothing."""

from __future__ import annotations

import pytest

from bseries.auditing import claims_of


@pytest.mark.parametrize(
    ("text", "order", "embedded"),
    [
        ("This is a fifth-order method with an embedded fourth order", 5, 4),
        ("order 5(4)", 5, 4),
        ("Dormand-Prince RK5(4)7", 5, 4),
        ("Prince-Dormand RK8(7)13M", 8, 7),
        ("ESDIRK4(3)6L[2]SA (A,L stable)", 4, 3),
        ("Fehlberg's 4(5) method", 5, 4),
        ("a method of order 3.", 3, None),
        ("third order, stage order 2", 3, None),
        ("stage order 2", None, None),
        ("linear order 4", None, None),
        ("dispersion order 8", None, None),
        ("dense output order 4", None, None),
        ("12-stage, 8th and 6th order Runge-Kutta method", None, None),
        ("a combined order 10 and 11 scheme", None, None),
        ("orders 4 and 5", None, None),
        ("a 4th/5th order pair", None, None),
        ("first-order backward Euler", 1, None),
        ("Singly diagonally implicit, 2nd order, L-stable", 2, None),
        ("4 stages (order 4)", 4, None),
        ("see eq. 5 (4)-(7)", None, None),
        ("in order 1. allocate 2. fill", None, None),
        ("the order 4 conditions hold", None, None),
        ("higher order terms", None, None),
        ("reorder 5 entries", None, None),
    ],
)
def test_orders_in_texts(text, order, embedded):
    found = claims_of({"comment": text})
    assert (found.order, found.embedded) == (order, embedded)


@pytest.mark.parametrize(
    "text",
    [
        *("Not of order 3", "has not order 3", "at most third order", "Predictor of a fourth order method"),
        *(
            "of order less than 4",
            "linear problems of order 3",
            "starting values of order 4",
            "Order 3 is lost if c = 1",
        ),
    ],
)
def test_an_order_in_doubt_is_no_claim(text):
    assert claims_of({"comment": text}).to_dict() == {}
    assert claims_of({"comment": f"A method of order 2. {text}"}).order == 2


@pytest.mark.parametrize(
    ("name", "order", "embedded"),
    [
        ("RK45", 5, 4),
        ("DormandPrince54", 5, 4),
        ("BogackiShampine32", 3, 2),
        ("BogackiShampine3", None, None),  # a number alone may be of stages
        ("RK42", None, None),
        ("SSPRK104", None, None),
        ("ARK436L2SA", None, None),
        ("ESDIRK437", None, None),
        ("Gauss-Legendre RK24", None, None),
        ("RK4", None, None),
    ],
)
def test_orders_in_names(name, order, embedded):
    found = claims_of({}, name)
    assert (found.order, found.embedded) == (order, embedded)


@pytest.mark.parametrize(
    ("text", "claimed"),
    [
        ("a symplectic method", {"symplectic"}),
        ("The symplectic and symmetric Gauss method", {"symplectic", "symmetric"}),
        ("symplectic DIRK method of order 3", {"symplectic"}),
        ("a symmetric Runge-Kutta scheme", {"symmetric"}),
        ("this method is not symplectic", set()),
        ("a non-symplectic method", set()),
        ("a pseudo-symplectic method", set()),
        ("conjugate symplectic method", set()),
        ("neither symmetric nor symplectic method", set()),
        ("for symplectic systems use another method", set()),
        ("compare with symplectic methods", set()),
        ("method for symmetric matrices", set()),
        ("4-stage, 3rd order SSP Runge-Kutta method", {"SSP"}),
        ("strong stability preserving method", {"SSP"}),
        ("strong-stability-preserving with downwind operators", set()),
        ("low storage non-SSP method", set()),
        ("non-TVD Runge-Kutta method", set()),
        ("FSAL method", {"FSAL"}),
        ("The pair has the FSAL property", {"FSAL"}),
        ("not FSAL", set()),
        ("without FSAL", set()),
        ("an A-stable method", set()),
    ],
)
def test_structures_in_texts(text, claimed):
    assert set(claims_of({"comment": text}).structure) == claimed


@pytest.mark.parametrize(
    ("said", "stage_order"),
    [
        ({"comment": "stage order 2"}, 2),
        ({"comment": "with stage-order of 3"}, 3),
        ({"stage_order": "2"}, 2),
        ({"comment": "weak stage order 3"}, None),
        ({"comment": "4 stages, order 2"}, None),
        ({"comment": "stage order 1 or stage order 2"}, None),
    ],
)
def test_stage_orders(said, stage_order):
    assert claims_of(said).stage_order == stage_order


def test_structures_in_fields():
    call = "ExplicitRKTableau(A, c, b, 5, fsal = {})"
    assert claims_of({"call": call.format("true")}).structure == ("FSAL",)
    assert claims_of({"call": call.format("false")}).structure == ()
    assert claims_of({"comment": "not FSAL", "fsal": "true"}).to_dict() == {"FSAL": True}
