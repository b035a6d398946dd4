"""Series on scenes: the routes agree, only what is called for is computed, and bad input is refused."""

import itertools
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import sympy
from numba import njit

import bseries as bs
from bseries.fields.evaluation import PreciseSeries
from bseries.fields.scene_trees import trees_of_method

SMALL = [entry.name for entry in bs.scene_catalogue() if bs.scene(entry.name).dimension <= 3]


def field(name="pendulum", method="rk4", order=6, **options):
    return bs.modified_field(bs.method(method), bs.scene(name), order, **options)


@pytest.mark.few(6)
@pytest.mark.filterwarnings("ignore::bseries.fields.term_sizes.TruncationWarning")  # of van-der-pol
@pytest.mark.parametrize(
    ("make", "name"),
    [
        *((bs.modified_field, name) for name in SMALL),
        *itertools.product([bs.modifying_field, bs.series_map], SMALL[::3]),
    ],
)
def test_towers_formulas_and_high_precision_agree(make, name):
    scene = bs.scene(name)
    towers, formulas = (make(bs.method("explicit-midpoint"), scene, 5, route=r) for r in ("towers", "symbolic"))
    precise = PreciseSeries(towers, 30)
    generator = np.random.default_rng(5)
    for _ in range(3):
        y, h = scene.y0 + 0.05 * generator.random(scene.dimension), 0.0625 * generator.random()
        expected = np.array(precise(list(y), h), float)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(towers(y, h), expected, rtol=1e-13, atol=1e-14 * scale)
        np.testing.assert_allclose(formulas(y, h), expected, rtol=1e-13, atol=1e-13 * scale)
        values = dict(zip(scene.symbols, map(sympy.Rational, y), strict=True))
        powers = range(5 if towers.is_field else 6)
        exact = [sum(sympy.Rational(h) ** k * towers.symbolic(k)[i] for k in powers) for i in range(scene.dimension)]
        np.testing.assert_allclose([float(x.subs(values).evalf(30)) for x in exact], expected, rtol=1e-14, atol=1e-15)


def test_a_wrong_coefficient_is_seen():
    f = field()
    tree = bs.Tree("[τ,[[τ]],τ]")
    wrong = bs.modified_equation(bs.method("rk4"), 6) + bs.BSeries.from_rule(lambda t: int(t == tree), 6, empty=0)
    y = np.array([0.4, 1.1])
    for route in ("towers", "symbolic"):
        assert np.abs(bs.modified_field(wrong, bs.scene("pendulum"), route=route)(y, 0.5) - f(y, 0.5)).max() > 1e-4


def test_only_the_trees_that_a_scene_calls_for():
    assert field(order=8).report() == "123 of 24,314 trees"
    assert field(method="stormer-verlet-kdk", order=8).report() == "123 of 24,314 trees"
    assert field("lorenz", order=8).report() == "93 of 200 trees"  # two children at most: 1, 1, 2, 3, 6, 11, 23, 46
    assert field("linear", order=8).report() == "8 of 200 trees"


@pytest.mark.parametrize("method", ["rk4", "implicit-midpoint", "gauss2"])
def test_blocks_as_colours_change_nothing(method):
    scene = bs.scene("pendulum")
    chosen = trees_of_method(bs.method(method), 7, scene)
    assert chosen.table.colors == 2
    assert chosen.shapes.colors == 1
    y = np.array([0.3, -1.2])
    whole = bs.modified_field(bs.modified_equation(bs.method(method), 7), scene, route="towers")
    np.testing.assert_allclose(
        field(method=method, order=7, route="towers").terms(y), whole.terms(y), rtol=1e-14, atol=1e-16
    )


@pytest.mark.parametrize("route", ["towers", "symbolic"])
def test_many_points(route):
    f = field(route=route)
    points = np.random.default_rng(0).normal(size=(2, 37))
    together = f(points, 0.1)
    assert together.shape == (2, 37)
    for k in range(37):
        np.testing.assert_array_equal(together[:, k], f(points[:, k], 0.1))
    np.testing.assert_array_equal(f(points, 0.1, workers=2), together)
    assert f.terms(points).shape == (6, 2, 37)


@pytest.mark.slow
@pytest.mark.parametrize("route", ["towers", "symbolic"])
def test_compiled_in_other_compiled_code(route):
    compiled = field(route=route).compiled

    @njit
    def two_euler_steps(y, h):
        slope = np.empty_like(y)
        for _ in range(2):
            compiled(y, h, slope)
            y = y + h * slope
        return y

    f, y = field(route=route), np.array([0.2, 1.0])
    once = y + 0.1 * f(y, 0.1)
    np.testing.assert_allclose(two_euler_steps(y, 0.1), once + 0.1 * f(once, 0.1), rtol=1e-15)


def test_route_is_chosen_by_cost():
    assert field().evaluator.route == "symbolic"
    assert field("lennard-jones", method="stormer-verlet-kdk", order=3).evaluator.route == "towers"
    with pytest.raises(bs.SeriesError, match="route must be one of auto, towers, symbolic, but was 'fast'"):
        field(route="fast")


def with_ten_effects(**options):
    effects = {f"wind{k}": bs.Effect(field={"p": f"-c{k}*p^{k}"}, parameters={f"c{k}": k}) for k in range(1, 10)}
    effects["spin"] = bs.Effect(field={"q": "w", "w": "-w"}, variables={"w": 1}, start={"w": [1]})
    start = {"p": [0], "q": [1]}
    return bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)", start=start, effects=effects, **options)


@pytest.mark.parametrize("route", ["towers", "symbolic"])
def test_effects_that_are_off_leave_no_trace(route):
    from integrators.compile.scene_source import scene_source

    one = with_ten_effects().with_effects("wind3")
    start = {"p": [0], "q": [1]}
    plain = bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)", field={"p": "-3*p^3"}, start=start)

    def evaluated(scene):
        """All that the compiled code depends on."""
        series = bs.modified_field(bs.method("rk4"), scene, 4, route=route).evaluator
        return series.formulas.source if route == "symbolic" else [table.tolist() for table in series.tables]

    assert evaluated(one) == evaluated(plain) != evaluated(with_ten_effects().with_effects("wind2"))
    assert scene_source(one) == scene_source(plain)
    base = bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2 - cos(q)", start=start)
    for build in (scene_source, evaluated):
        assert build(with_ten_effects()) == build(base)


def test_effects_change_the_numbers():
    y = np.array([0.3, 1.0, 0.5])
    f = bs.modified_field(bs.method("rk4"), with_ten_effects().with_effects("spin"), 5)
    assert f.variables == ("p", "q", "w")
    assert f(y, 0.1)[1] != field(order=5)(y[:2], 0.1)[1]


def test_parts_of_methods():
    abc, split = bs.scene("abc-flow"), bs.methods.lie_trotter(["a", "b", "c"])
    f = bs.modified_field(split, abc, 4)
    assert [str(piece.part) for piece in f.trees.pieces] == ["a", "b", "c"]
    strang = bs.method("strang")
    pendulum = bs.scene("pendulum")
    kdk = bs.modified_field(strang, pendulum, 6, parts={"a": "p", "b": "q"})
    y = np.array([0.3, 0.8])
    verlet = bs.modified_field(bs.method("stormer-verlet-kdk"), pendulum, 6)
    np.testing.assert_allclose(kdk(y, 0.1), verlet(y, 0.1), rtol=1e-14)
    dkd = bs.modified_field(strang, pendulum, 6, parts={"a": "q", "b": "p"})
    assert np.abs(dkd(y, 0.1) - verlet(y, 0.1)).max() > 1e-5


def abc(names, **options):
    return bs.modified_field(bs.methods.lie_trotter(list(names)), bs.scene("abc-flow"), 3, **options)


def test_fields_that_vanish_and_no_points():
    zero = bs.Scene({"y": 1}, field={"y": 0})
    for route in ("towers", "symbolic", "auto"):
        f = bs.modified_field(bs.method("rk4"), zero, 3, route=route)
        out = np.ones(1)
        f.compiled(np.array([2.0]), 0.1, out)
        assert (f([2.0], 0.1).tolist(), out.tolist()) == ([0.0], [0.0])
        assert f(np.empty((1, 0)), 0.1, workers=2).shape == (1, 0)


@pytest.mark.parametrize("route", ["towers", "symbolic"])
def test_compiled_code_refuses_other_sizes(route):
    with pytest.raises(ValueError, match="y and out must have 2 entries"):
        field(order=3, route=route).compiled(np.zeros(3), 0.1, np.zeros(3))


@pytest.mark.parametrize("route", ["towers", "symbolic"])
def test_copies_by_pickling(route):
    f = field(order=4, route=route)
    y = np.array([0.3, 0.4])
    value = f(y, 0.1)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(f))(y, 0.1), value)


def test_threads_do_not_disturb_each_other():
    f = field("lennard-jones", "stormer-verlet-kdk", 5)
    points = f.scene.y0[:, None] + 0.01 * np.random.default_rng(0).random((36, 40))
    alone = [f(column, 0.01) for column in points.T]
    with ThreadPoolExecutor(4) as pool:
        np.testing.assert_array_equal(list(pool.map(lambda column: f(column, 0.01), points.T)), alone)


def test_coefficients_that_are_zero_within_their_digits_are_zero_on_both_routes():
    values = [field(method="tsit5", order=7, route=route).terms([0.3, 0.4]) for route in ("towers", "symbolic")]
    assert not values[0][1:5].any()
    np.testing.assert_array_equal(*values)


def test_printed_text_too_large_for_formulas_is_no_obstacle():
    huge = bs.Scene({"y": 1}, field={"y": "10^300*y^2"})
    f = bs.modified_field(bs.method("explicit-euler"), huge, 4)
    assert f.route == "towers"
    np.testing.assert_allclose(f.terms([1e-100])[0], 1e100, rtol=1e-15)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: field("riccati", "stormer-verlet-kdk"),
            "scene must have blocks or parts for p, q, .* but riccati has the block y only",
        ),
        (
            lambda: bs.modified_field(bs.methods.lie_trotter(["kick", "drift"]), bs.scene("pendulum"), 4),
            "parts must say what the method's parts kick, drift are",
        ),
        (lambda: field(method="strang", parts={"a": "p"}), "parts must map a, b to blocks"),
        (lambda: field(method="strang", parts={"a": "p", "b": "p"}), "parts must take each block of p, q once"),
        (
            lambda: field(method="strang", parts={"a": "p", "b": "z"}),
            "parts.b must be of the scene's p, q, but was 'z'",
        ),
        (lambda: field(order=None), "order must be given for a method"),
        (lambda: field()([1.0], 0.1), r"y must have the shape \(2,\) or \(2, n\), but had \(1,\)"),
        (lambda: field()("ab", 0.1), "y must be real numbers, but was 'ab'"),
        (lambda: field()([1, 2j], 0.1), "y must be real numbers, but was "),
        (lambda: field()([1, 2], "0.1"), "h must be a real number, but was '0.1'"),
        (lambda: field()([None, 1], 0.1), "y must be real numbers, but was "),
        (lambda: field()([True, False], 0.1), "y must be real numbers, but was "),
        (lambda: field("field-nijhoff").precise([-1, 0], 0.1), "y must lie in the domain of the field"),
        (lambda: field(parts={"x": "p"}), "parts must be None where the whole field is one part"),
        (lambda: field(method="strang", parts={"a": "p", "b": 5}), "parts.b must be of the scene's p, q, but was 5"),
        (lambda: field("fermi-pasta-ulam", "strang", parts={"a": "linear", "b": "linear"}), "parts must be the whole"),
        (lambda: abc(parts={"a": "a", "b": "b", "c": "c", "d": "a"}, names="abcd"), "parts must take each part"),
        (lambda: bs.modified_field(bs.exact_flow(3), bs.scene("riccati")), "the series of a field, with b"),
        (lambda: bs.series_map(bs.exact_flow(3).log(), bs.scene("riccati")), "the series of a flow, with a"),
        (lambda: field(method="tsit5", order=3).precise([1, 2], 1, digits=40), "digits must be at most 16, as coeff"),
        (
            lambda: bs.modified_field(bs.method("sdirk2"), bs.scene("riccati"), 3)([1], 0.1),
            "numbers for its parameters",
        ),
        (lambda: field()([1, 2], 0.1, workers=0), "workers must be a whole number ≥ 1, but was 0"),
        (lambda: field().symbolic(6), "k must be a power of h from 0 to 5, but was 6"),
        (lambda: field().precise([1], 1), "y must have 2 values, but had 1"),
        (lambda: field().precise([1, 2], 1, digits=0), "digits must be an integer from 1 to 1000, but was 0"),
        (
            lambda: bs.modified_field(bs.method("rkn-nystrom4"), bs.scene("lotka-volterra"), 4),
            "scene must be of the kind",
        ),
        (lambda: bs.modified_field(4, bs.scene("pendulum"), 4), "method must be"),
        (lambda: bs.modified_field(bs.method("rk4"), 3, 4), "scene must be a Scene or the name of one, but was 3"),
    ],
)
def test_bad_input(call, message):
    with pytest.raises(bs.errors, match=message):
        call()
