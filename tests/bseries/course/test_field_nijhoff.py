"""Exercise 5: a modified Hamiltonian in closed form."""

import json
import math
import pickle
from fractions import Fraction
from pathlib import Path

import pytest
import sympy

import bseries as bs
from bseries.course.field_nijhoff import field_nijhoff

LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
EXERCISE5 = LECTURE["exercise5_field_nijhoff"]


@pytest.mark.parametrize("variant", ["p", "q"])
def test_exercise_5(variant):
    scene = bs.scene("field-nijhoff", alpha="1/2", beta=2)
    found = field_nijhoff(variant, scene)
    p, q = scene.symbols
    invariant = (p + sympy.Rational(1, 2)) * (q + 2)
    assert sympy.simplify(found.radius - invariant) == 0
    coefficients = EXERCISE5[f"{variant}_implicit"]["coefficients_of_h^k_I^-k_k=1..9"]
    point, h = {p: 1, q: 2}, Fraction(1, 100)
    I = 6  # noqa: E741
    series = math.log(I) + sum(float(Fraction(x)) * (float(h) / I) ** k for k, x in enumerate(coefficients, 1))
    assert found([1, 2], float(h)) == pytest.approx(series, abs=1e-15)
    exact = found.expression(sympy.Rational(1, 100)).subs(point).evalf(30)
    assert float(exact) == pytest.approx(series, abs=1e-15)
    assert pickle.loads(pickle.dumps(found))([1, 2], 0.01) == found([1, 2], 0.01)
    terms = bs.hamiltonians.generating_function(f"symplectic-euler-{variant}", scene, 5).hamiltonian()
    assert all(
        sympy.simplify(term - sympy.Rational(x) / invariant**k) == 0
        for k, (term, x) in enumerate(zip(terms[1:], coefficients, strict=False), 1)
    )


@pytest.mark.parametrize("variant", ["p", "q"])
def test_exercise_5_is_conserved_up_to_the_radius(variant):
    found = field_nijhoff(variant)
    p, q, h = 1.0, 1.0, 3.9  # I = 4
    first = found([p, q], h)
    for _ in range(2):
        ratio = (1 - h / 4) if variant == "p" else 1 / (1 + h / 4)
        p, q = (1 + p) * ratio - 1, (1 + q) / ratio - 1
        assert found([p, q], h) == pytest.approx(first, rel=1e-10)
    with pytest.raises(bs.SeriesError, match="must be less than 4"):
        found([p, q], 4.0)
    with pytest.raises(bs.SeriesError, match="must be less than 0"):
        found([[1, -2], [1, 1]], 0.1)  # where H is not defined
    assert found([1, 1], 0) == pytest.approx(math.log(4))
    assert found([1, 1], 1e-14) == pytest.approx(math.log(4), rel=1e-13)
