"""What a page shows of a method, against the library and against known regions."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import numpy as np
import pytest

import bseries as bs
from bseries.explorer.method_facts import MOST_TREES, method_facts, most_nodes, stability_shapes


def test_terms_are_those_of_the_modified_equation():
    facts, b = method_facts(bs.method("rk4"), 6), bs.modified_equation("rk4", 6)
    assert (facts.order, facts.nodes, facts.latex) == (4, 6, b.to_latex())
    assert [term.tree for term in facts.terms] == [str(tree) for tree in b]
    assert [Fraction(term.coefficient) for term in facts.terms] == b.coefficients()
    assert [term.value for term in facts.terms] == [float(weight) for weight in b.weights()]
    assert json.loads(facts.json)["terms"][-1]["tree"] == facts.terms[-1].tree
    assert all(term.picture.count("<circle") == term.nodes for term in facts.terms)


def test_symbols_have_no_value_but_text():
    term = method_facts(bs.method("sdirk2"), 3).terms[2]
    assert "gamma" in term.weight
    assert math.isnan(term.value)


def test_pages_have_a_bounded_number_of_trees():
    for name in ("rk4", "stormer-verlet", "gark2"):
        method = bs.method(name)
        nodes = most_nodes(method)
        assert len(bs.modified_equation(method, nodes)) <= MOST_TREES < len(bs.modified_equation(method, nodes + 1))
        with pytest.raises(bs.SeriesError, match=f"order must be from 1 to {nodes} for {name}"):
            method_facts(method, nodes + 1)


def test_every_kind_of_method_has_facts():
    for name in ("gauss3", "strang", "lobatto-iiia-iiib3", "rkn-nystrom4", "grk4a", "lawson4", "avf", "tsit5"):
        facts = method_facts(bs.method(name), 3)
        assert facts.order >= 1, name
        assert "<table" in facts.tableau, name


def test_regions():
    """|1 + z| ≤ 1 for Euler's method, the left half plane for Gauss methods."""
    euler, gauss = stability_shapes("explicit-euler"), stability_shapes("gauss2")
    disc = abs(1 + euler.axis + 1j * euler.axis[:, None]) <= 1
    assert ((euler.growth <= 0) == disc).all()
    assert ((gauss.growth < 0) == (gauss.axis < 0))[:, gauss.axis != 0].all()
    assert len(gauss.poles) == 2


def test_the_order_star_has_as_many_fingers_as_the_order_tells():
    """R(z) e^(−z) = 1 − C z^(p+1) + …, so p + 1 sectors meet at the origin."""
    shapes = stability_shapes("rk4")
    radius = np.argmin(abs(shapes.axis - 0.5)), np.argmin(abs(shapes.axis))
    angle = np.arange(400) * 2 * np.pi / 400
    scale = (radius[0] - radius[1], radius[1])
    rows = np.round(scale[1] + scale[0] * np.sin(angle)).astype(int)
    columns = np.round(scale[1] + scale[0] * np.cos(angle)).astype(int)
    signs = np.sign(shapes.star[rows, columns])
    assert np.count_nonzero(signs != np.roll(signs, 1)) == 2 * 5


@pytest.mark.parametrize("name", ["stormer-verlet", "strang", "sdirk2"])
def test_methods_without_a_region_are_refused_in_a_sentence(name):
    with pytest.raises(bs.errors, match=r"method must"):
        stability_shapes(bs.method(name))
