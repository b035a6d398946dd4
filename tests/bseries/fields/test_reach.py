"""Reach of truncations: sizes of terms, optimal truncation, largest steps; convergence on linear scenes."""

import json
import math
import warnings
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy

import bseries as bs

LECTURE = json.loads((Path(__file__).parents[2] / "reference" / "lecture_values.json").read_text())
LINEAR = LECTURE["example3_linear"]
CATALOGUE = {
    "rk4": "rk4",
    "implicit_midpoint": "implicit-midpoint",
    "explicit_euler": "explicit-euler",
    "implicit_euler": "implicit-euler",
    "heun": "heun2",
}
RK4 = bs.method("rk4")
RICCATI = bs.scene("riccati")


def silently(f, y, h, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bs.fields.TruncationWarning)
        return bs.fields.reach(f, y, h, **options)


@pytest.mark.parametrize("name", LINEAR["radius"])
def test_radii_of_the_lecture(name):
    expected = LINEAR["radius"][name]
    found = bs.fields.convergence_radius(bs.method(CATALOGUE[name]))
    assert found.radius == pytest.approx(float(expected["rho"]), rel=1e-14)
    roots = [complex(text.replace(" ", "")) for text in expected["nearest_singularities"]]
    assert min(abs(found.root - root) for root in roots) < 1e-14


@pytest.mark.parametrize("name", ["rk4", "implicit-midpoint", "radau-iia3", "gauss4", "lobatto-iiic3", "tsit5"])
def test_root_and_kind(name):
    method = bs.method(name)
    R, found = bs.stability_function(method), bs.fields.convergence_radius(method)
    inside = 0.999 * found.radius * np.exp(2j * np.pi * np.arange(400) / 400)
    turns = np.diff(np.unwrap(np.angle(R(np.append(inside, inside[0])))))
    assert sum(turns) == pytest.approx(0, abs=1e-9)  # the argument principle: no zeros or poles inside
    value = abs(R(found.root * (1 - 1e-9)))
    assert value < 1e-6 if found.kind == "zero" else value > 1e6


def test_radius_without_roots_and_of_other_methods():
    nothing = bs.fields.convergence_radius(bs.RungeKutta([[0]], [0], warn=False))
    assert nothing == (math.inf, None, "none")
    assert str(nothing).startswith("∞")
    assert (
        str(bs.fields.convergence_radius(bs.method("implicit-euler"))) == "1, from the pole 1 of the stability function"
    )
    with pytest.raises(bs.errors, match="method must be a RungeKutta, but was"):
        bs.fields.convergence_radius(bs.method("stormer-verlet"))


@pytest.mark.parametrize("name", LINEAR["b"])
def test_terms_on_a_linear_scene(name):
    """(1/h) log R(hA) = Σ b_k h^(k−1) A^k."""
    f = bs.modified_field(bs.method(CATALOGUE[name]), bs.scene("linear", matrix=[[-3]]), 6)
    found = silently(f, [1.0], 0.1)
    expected = [abs(Fraction(b)) * 3**k for k, b in enumerate(LINEAR["b"][name], 1)]
    assert found.norms == pytest.approx([float(x) for x in expected], rel=1e-13)
    assert found.sizes == pytest.approx([float(x) / 10**k for k, x in enumerate(expected)], rel=1e-13)


@pytest.mark.parametrize("name", CATALOGUE.values())
def test_convergence_on_linear_scenes(name):
    method, matrix = bs.method(name), [[0, -1], [4, "-1/2"]]
    scene = bs.scene("linear", matrix=matrix)
    largest = max(abs(complex(x)) for x in sympy.Matrix(matrix).applyfunc(sympy.Rational).eigenvals())
    f = bs.modified_field(method, scene, 40)
    limit = bs.fields.convergence_radius(method).radius / largest
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        inside = bs.fields.reach(f, [1.0, 1.0], 0.8 * limit, method=method)
    assert inside.converges
    assert not inside.is_beyond
    assert inside.largest_step == pytest.approx(limit, rel=1e-12)
    assert inside.spectral_radius == pytest.approx(largest, rel=1e-12)
    with pytest.warns(bs.fields.TruncationWarning, match="diverges: h times the spectral radius must be below"):
        outside = bs.fields.reach(f, [1.0, 1.0], 1.25 * limit, method=method)
    assert not outside.converges
    assert outside.is_beyond
    assert max(inside.sizes[-4:]) < 0.01 * max(inside.sizes[2:10])
    assert max(outside.sizes[-4:]) > 10 * max(outside.sizes[2:10])  # the terms grow


def test_linear_scenes_are_recognised():
    affine = bs.Scene({"y": 2}, field={"y1": "1 - y2", "y2": "y1/4"}, start={"y": [1, 1]})
    assert silently(bs.modified_field(RK4, affine, 5), [1, 1], 1, method=RK4).spectral_radius == pytest.approx(0.5)
    for f in (bs.modified_field(RK4, RICCATI, 5), bs.modified_field(RK4, bs.scene("rigid-body"), 5)):
        found = silently(f, f.scene.y0, 0.1, method=RK4)
        assert (found.spectral_radius, found.radius, found.converges) == (None, None, None)


@pytest.mark.parametrize("make", [bs.modified_field, bs.modifying_field])
def test_another_method_is_noticed_on_linear_scenes(make):
    f = make(RK4, bs.scene("linear"), 6)
    other = bs.method("heun2") if make is bs.modified_field else RK4
    with pytest.raises(bs.SeriesError, match=f"the one that f is the modified equation of, but was {other.name}"):
        bs.fields.reach(f, [1, 1], 0.1, method=other)


def test_the_riccati_equation():
    """Example 1 of the lecture: terms h^k c_k y^(k+2), zero where c_k is, though trees cancel by rounding only."""
    coefficients = [abs(Fraction(c)) for c in LECTURE["example1_and_fig1"]["coefficients"]["rk4"]]
    f = bs.modified_field(RK4, RICCATI, 9)
    found = bs.fields.reach(f, [2.0], 0.1)
    assert found.norms == pytest.approx([float(c) * 2 ** (k + 2) for k, c in enumerate(coefficients)], rel=1e-12)
    assert found.powers == (0, 4, 6, 7, 8)
    assert (found.optimal_power, found.optimal_order, found.is_beyond) == (8, 9, False)
    assert found.best_error == found.sizes[8]
    with pytest.warns(
        bs.fields.TruncationWarning, match=r"worse at order 9 than at order 5: for h = 0.8 .* beyond h\^4"
    ):
        beyond = bs.fields.reach(f, [2.0], 0.8)
    assert (beyond.optimal_power, beyond.optimal_order, beyond.is_beyond) == (4, 5, True)
    assert beyond.best_error == min(size for size in beyond.sizes if size)


def reach_of(*sizes):
    return bs.fields.Reach("made up", 1.0, sizes)


@pytest.mark.parametrize(
    ("sizes", "optimal"),
    [
        ((1, 0.1, 0.01, 0.11), 2),
        ((1, 0.1, 0.01, 0.1, 1), 2),
        ((1, 0.1, 0.01, 0.001), 3),
        ((1, 0, 0.1, 0, 0.01, 0), 4),
        ((1, 0, 0.1, 0, 0.01, 0, 0.2, 0), 4),
        ((1, 0, 0, 1e-9, 1e-8), 4),  # a leading term made small
        ((1, 1e-2, 1e-9, 1e-6, 1e-8), 4),  # a term small by chance
        ((1, 0, 0.03, 0, 0.5, 0, 0.08, 0, 0.48), 6),  # two small terms between two that do not shrink
        ((1, 0, 0.03, 0, 0.5, 0, 0.08, 0, 0.3), 8),
        ((1, 0.5, 0.4, 0.38, 0.37), 3),  # each term shrinks, but two together hardly do
        ((1, 0.5, 0.3, 0.2, 0.1), 4),
        ((1, 2), 0),
        ((1, 0, 0), 0),
        ((0, 0), 0),
    ],
)
def test_the_optimal_power(sizes, optimal):
    found = reach_of(*sizes)
    assert found.optimal_power == optimal
    assert found.is_beyond == any(sizes[optimal + 1 :])
    assert (found.largest_step < 1) == found.is_beyond


def test_an_envelope_that_does_not_shrink_is_at_its_end():
    """Implicit midpoint on a pendulum at h = 3: the terms after h^8 are 0.94, 10, 82, and no order is better than 7."""
    f = bs.modified_field("implicit-midpoint", "pendulum", 9)
    found = silently(f, [0.3, -1.5], 3.0)
    assert found.sizes[::2] == pytest.approx([1.04, 0.025, 0.511, 0.0746, 0.48], rel=5e-3)
    assert (found.optimal_order, found.is_beyond) == (7, True)
    assert not silently(f, [0.3, -1.5], 2.0).is_beyond


def test_one_warning_for_each_call():
    f = bs.modified_field(RK4, RICCATI, 9)
    with pytest.warns(bs.fields.TruncationWarning) as caught:
        bs.fields.reach(f, [1.0], 1.0)
    assert [str(warning.message).count(". ") for warning in caught] == [0]
    assert caught[0].filename == __file__


def test_values_beyond_reach_are_not_given_in_silence():
    """HLW, section IX.7: the flow of rk4's linear field converges for |hλ| < 1.94 only, and h = 3."""
    H = bs.modified_hamiltonian("implicit-midpoint", "pendulum", 9)
    f = bs.modified_field(RK4, "linear", 9)
    warned = r"the modified {} on {} is worse at order 9 than at order \d: for h = {} its .* order 9 needs h ≤"
    energy = warned.format("Hamiltonian of implicit-midpoint", "pendulum", 5)
    with pytest.warns(bs.fields.TruncationWarning, match=energy) as caught:
        assert H([0, -1.5], 5) == pytest.approx(-3.18, abs=0.01)
    assert [each.filename for each in caught] == [__file__]
    with pytest.warns(bs.fields.TruncationWarning, match=energy) as caught:
        H(np.transpose([[0, -0.1]] * 99 + [[0, -1.5]] * 9), 5.0)
    assert [each.filename for each in caught] == [__file__]
    for call in (H.observer, lambda h: H.plot(h=h, window=(-2, -1, -1, 1)), lambda h: H.gradient([0, -1.5], h)):
        with pytest.warns(bs.fields.TruncationWarning, match="is worse at order 9"):
            call(5.0)
    with pytest.warns(bs.fields.TruncationWarning, match=warned.format("equation of rk4", "linear", 3)) as caught:
        f([1, 1], 3.0)
    assert [each.filename for each in caught] == [__file__]


def test_values_within_reach_and_compiled_code_are_silent():
    """Negative control: warnings are errors, also at zeros of H and at rest, where terms vanish or are rounding."""
    H = bs.modified_hamiltonian("implicit-midpoint", "pendulum", 9)
    run = bs.integrate("implicit-midpoint", "pendulum", h=0.5, steps=300)
    (
        H(run.y, 0.5),
        H.field(run.y, 0.5),
        H([0, math.pi / 2], 0.5),
        H([0, 0], 5.0),
        H([0, -1.5], 0),
        H(np.empty((2, 0)), 5),
    )
    bs.modified_field(RK4, "linear", 9)([1, 1], 1.0)
    bs.series_map(RK4, "linear", 9)([1, 1], 3.0)
    assert H.compiled(np.array([0, -1.5]), 5.0) == pytest.approx(-3.18, abs=0.01)
    out = np.empty(2)
    H.field.compiled(np.array([0, -1.5]), 5.0, out)
    assert np.array_equal(H.field.evaluator.value([0, -1.5], 5.0), out)


@pytest.mark.parametrize(
    ("scene", "method", "order"),
    [("riccati", "explicit-euler", 8), ("riccati", "rk4", 9), ("kepler", "stormer-verlet", 7), ("lorenz", "heun2", 6)],
)
def test_the_largest_step_is_sharp(scene, method, order):
    f = bs.modified_field(bs.method(method), bs.scene(scene), order)
    y = f.scene.y0 + 0.1
    limit = silently(f, y, 1.0).largest_step
    assert not silently(f, y, limit * 0.999).is_beyond
    assert silently(f, y, limit * 1.001).is_beyond
    assert silently(f, y, -limit * 1.001).is_beyond  # the sign of h does not matter
    assert silently(f, y, limit / 7).largest_step == pytest.approx(limit, rel=1e-12)


@pytest.mark.parametrize(("method", "order"), [("implicit-midpoint", 7), ("explicit-euler", 6), ("gauss2", 9)])
def test_the_error_is_about_that_of_the_next_term(method, order):
    scene = bs.scene("pendulum").with_start(p=[1], q=["1/2"])
    f, longer = (bs.modified_field(bs.method(method), scene, n) for n in (order, order + 2))
    h = 0.2
    error = bs.fields.reach(f, scene.y0, h).error
    omitted = next(size for size in bs.fields.reach(longer, scene.y0, h).sizes[order:] if size)
    assert 1 / 10 < error / omitted < 10
    assert np.linalg.norm(longer(scene.y0, h) - f(scene.y0, h)) == pytest.approx(omitted, rel=0.2)


def test_decimals_and_fields_without_terms():
    """tsit5 is published in decimals: its terms of order 2 to 5 are not exactly zero."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = bs.fields.reach(bs.modified_field(bs.method("tsit5"), RICCATI, 7), [1.0], 0.1)
    assert found.powers == (0, 5, 6)
    nothing = bs.fields.reach(bs.modified_field(RK4, RICCATI, 4), [1.0], 10.0)
    assert (nothing.error, nothing.best_error, nothing.largest_step, nothing.is_beyond) == (None, None, math.inf, False)
    at_rest = bs.fields.reach(bs.modified_field(RK4, bs.scene("lotka-volterra"), 6), [1.0, 2.0], 10.0)
    assert (at_rest.powers, at_rest.error, at_rest.best_error, at_rest.is_beyond) == ((), None, None, False)
    assert "next term unknown; largest h for it: inf" in str(at_rest)


def test_text_and_plain_data():
    found = bs.fields.reach(bs.modified_field(bs.method("implicit-midpoint"), RICCATI, 5), [1.0], 0.1)
    assert str(found).splitlines() == [
        "the modified equation of implicit-midpoint on riccati, h = 0.1",
        "power   size",
        "h^0     1",
        "h^1     0",
        "h^2     0.0025",
        "h^3     0",
        "h^4     1.25e-05   optimal",
        "order 5: not beyond the optimum, next term about 6.3e-08; largest h for it: 1.54",
    ]
    data = json.loads(json.dumps(found.to_dict()))
    assert data["kind"] == "reach"
    assert data["terms"][2] == {"power": 2, "size": pytest.approx(0.0025)}
    assert (data["optimal_power"], data["is_beyond"], data["converges"], data["radius"]) == (4, False, None, None)
    linear = bs.fields.reach(bs.modified_field(RK4, bs.scene("linear"), 6), [1, 1], 1, method=RK4)
    assert str(linear).endswith("the radius 1.94454, inside: the series converges")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"f": "rk4"}, "f must be a field, such as modified_field gives, but was 'rk4'"),
        ({"h": 1e300}, r"h must be small enough for finite terms, but was 1e\+300"),
        ({"y": [1.0, 2.0]}, r"y must have the shape \(1,\) or \(1, n\), but had \(2,\)"),
        ({"y": [[1.0]]}, r"y must have the shape \(1,\), but had \(1, 1\)"),
        ({"y": ["x"]}, "y must be real numbers, but was"),
        ({"y": [math.nan]}, r"y must be finite numbers, but was \[nan\]"),
        ({"y": [1e200]}, r"y must be where all terms of f are finite, but that with h\^0 was inf"),
        ({"h": 0}, "h must be a finite number other than 0, but was 0"),
        ({"h": "1"}, "h must be a real number, but was '1'"),
        ({"h": math.inf}, "h must be a finite number, but was inf"),
        ({"h": None}, "h must be a real number, but was None"),
        ({"method": 4}, "method must be a RungeKutta, but was 4"),
    ],
)
def test_bad_arguments(changes, message):
    check_refused(changes, message)


def test_a_map_is_no_field():
    sentence = "f must be a field, such as modified_field gives, but was the series"
    check_refused({"f": bs.series_map(RK4, RICCATI, 3)}, sentence)


def check_refused(changes, message):
    arguments = {"f": bs.modified_field(RK4, RICCATI, 5), "y": [1.0], "h": 0.1, "method": None, **changes}
    with pytest.raises(bs.errors, match=message):
        bs.fields.reach(arguments["f"], arguments["y"], arguments["h"], method=arguments["method"])
