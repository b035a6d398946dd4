"""Pairs as solvers of SciPy, tableaux of SciPy's own solvers, scenes as right-hand sides."""

from __future__ import annotations

import pickle
import sys

import numpy as np
import pytest

from integrators import IntegratorError, RungeKutta, Scene, catalogue, method, scene
from integrators.runs.scipy_solvers import right_hand_side, scipy_solver

pytestmark = pytest.mark.minimum

integrate = pytest.importorskip("scipy.integrate")
solve_ivp = integrate.solve_ivp

PAIRS = {"merson4": 3, "bogacki-shampine32": 2, "fehlberg45": 4, "cash-karp45": 4, "dormand-prince54": 4}
PAIRS |= {"verner65": 5, "tsit5": 4, "dormand-prince87": 7, "dop853": 7}
HEUN = [[0, 0], [1, 0]]
OWN = {"bogacki-shampine32": "RK23", "dormand-prince54": "RK45", "dop853": "DOP853"}


def kepler(t, y):
    cube = np.hypot(y[0], y[1]) ** 3
    return np.array([y[2], y[3], -y[0] / cube, -y[1] / cube])


def driven(t, y):
    return np.array([y[1], 2 * (1 - y[0] ** 2) * y[1] - y[0] + np.cos(t)])


def rational(t, y):
    """Has the solution y = 1/(1.2 − sin t) with y(0) = 1/1.2."""
    return y**2 * np.cos(t)


def rational_solution(t):
    return 1 / (1.2 - np.sin(t))


def kepler_at(t, eccentricity=0.6):
    """The solution that starts at the pericentre, by Kepler's equation."""
    anomaly = t
    for _ in range(50):
        anomaly -= (anomaly - eccentricity * np.sin(anomaly) - t) / (1 - eccentricity * np.cos(anomaly))
    axis, speed = np.sqrt(1 - eccentricity**2), 1 / (1 - eccentricity * np.cos(anomaly))
    place = [np.cos(anomaly) - eccentricity, axis * np.sin(anomaly)]
    return np.array([*place, -np.sin(anomaly) * speed, axis * np.cos(anomaly) * speed])


KEPLER_START = [0.4, 0, 0, 2]
PROBLEMS = {
    "kepler": (kepler, (0, 12), KEPLER_START),
    "backwards": (kepler, (1, -4), KEPLER_START),
    "driven": (driven, (0, 8), [1, 0.5]),
    "complex": (lambda t, y: 1j * y, (0, 7), [1 + 0j, 2j]),
}
OPTIONS = [{}, {"rtol": 1e-7, "atol": 1e-9}, {"max_step": 0.1}, {"first_step": 1e-3, "rtol": 1e-6, "atol": 1e-8}]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("problem", PROBLEMS)
@pytest.mark.parametrize(("name", "own"), OWN.items())
def test_equal_tableaux_take_the_steps_of_scipys_own_solvers(name, own, problem, options):
    fun, span, y0 = PROBLEMS[problem]
    theirs = solve_ivp(fun, span, y0, method=own, **options)
    ours = solve_ivp(fun, span, y0, method=scipy_solver(method(name)), **options)
    assert ours.success
    assert ours.nfev == theirs.nfev
    assert ours.y.dtype == theirs.y.dtype
    # Estimates are small differences of large stages: their rounding errors reach the next step's length.
    np.testing.assert_allclose(ours.t, theirs.t, rtol=1e-6)
    np.testing.assert_allclose(ours.y, theirs.y, rtol=1e-6, atol=1e-6)


def test_another_pair_of_the_same_orders_takes_other_steps():
    fun, span, y0 = PROBLEMS["kepler"]
    theirs = solve_ivp(fun, span, y0, method="RK45")
    ours = solve_ivp(fun, span, y0, method=scipy_solver(method("tsit5")))
    assert len(ours.t) != len(theirs.t) or abs(ours.t - theirs.t).max() > 1e-2


def fixed_steps(name, number, **options):
    """Steps of one length: tolerances so wide that no estimate matters."""
    wide = {"first_step": 3 / number, "max_step": 3 / number, "rtol": 1e9, "atol": 1e9}
    return solve_ivp(rational, (0, 3), [1 / 1.2], method=scipy_solver(method(name)), **wide, **options)


@pytest.mark.parametrize("name", PAIRS)
def test_measured_orders_are_those_of_the_weights_at_the_steps_and_between(name):
    order = scipy_solver(method(name)).order
    times = np.linspace(0, 3, 997)
    errors = []
    for number in (32, 64) if order == 8 else (256, 512):
        found = fixed_steps(name, number, dense_output=True)
        at_steps = abs(found.y[0] - rational_solution(found.t)).max()
        errors.append((at_steps, abs(found.sol(times)[0] - rational_solution(times)).max()))
    orders = np.log2(np.divide(*errors))
    assert (orders > order - 0.2).all()
    assert (orders < order + 0.3).all()


@pytest.mark.parametrize("name", PAIRS)
def test_errors_follow_the_tolerance(name):
    solver = scipy_solver(method(name))
    errors = []
    for tolerance in (1e-6, 1e-10):
        found = solve_ivp(kepler, (0, 10), KEPLER_START, method=solver, rtol=tolerance, atol=tolerance)
        errors.append(abs(found.y[:, -1] - kepler_at(10)).max())
    slope = np.log10(errors[0] / errors[1]) / 4
    assert abs(slope - solver.order / (solver.error_estimator_order + 1)) < 0.3


def test_a_last_stage_that_is_the_next_first_is_evaluated_once():
    wide = {"rtol": 1e9, "atol": 1e9}
    for name, per_step in (("tsit5", 6), ("dormand-prince54", 6), ("bogacki-shampine32", 3), ("cash-karp45", 6)):
        found = solve_ivp(driven, (0, 1), [1, 0.5], scipy_solver(method(name)), max_step=0.1, first_step=0.1, **wide)
        assert found.nfev == 1 + per_step * (len(found.t) - 1)


def test_interpolation_takes_no_evaluations_but_for_two_pairs():
    for name, further in (("tsit5", 0), ("fehlberg45", 0), ("verner65", 1), ("dop853", 4)):
        plain, dense = (fixed_steps(name, 16, dense_output=dense) for dense in (False, True))
        assert dense.nfev - plain.nfev == further * (len(plain.t) - 1)


def test_events_and_times_asked_for_are_met():
    def turning(t, y):
        return y[1]

    solver = scipy_solver(method("tsit5"))
    asked = np.linspace(0, 9, 50)
    found = solve_ivp(
        lambda t, y: [y[1], -y[0]], (0, 9), [0, 1], solver, events=turning, t_eval=asked, rtol=1e-9, atol=1e-9
    )
    np.testing.assert_allclose(found.t_events[0], np.array([0.5, 1.5, 2.5]) * np.pi, atol=1e-7)
    np.testing.assert_array_equal(found.t, asked)
    np.testing.assert_allclose(found.y, [np.sin(asked), np.cos(asked)], atol=1e-7)


@pytest.mark.parametrize("name", ["bogacki-shampine32", "tsit5", "dop853"])
def test_the_solution_between_steps_is_differentiable(name):
    found = solve_ivp(driven, (0, 6), [1, 0.5], scipy_solver(method(name)), dense_output=True)
    shift = 1e-5
    for step, t in zip(found.sol.interpolants[:-1], found.t[1:-1], strict=True):
        following = found.sol.interpolants[list(found.t).index(t)]
        np.testing.assert_allclose(step(t), following(t), atol=1e-12)
        slopes = [(piece(t + shift) - piece(t - shift)) / (2 * shift) for piece in (step, following)]
        np.testing.assert_allclose(*slopes, atol=1e-7)
        np.testing.assert_allclose(slopes[0], driven(t, step(t)), atol=1e-7)


def test_dense_output_has_the_shapes_of_scipys_and_survives_pickling():
    theirs, ours = (
        solve_ivp(driven, (0, 2), [1, 0.5], solver, dense_output=True).sol
        for solver in ("RK45", scipy_solver(method("dormand-prince54")))
    )
    copy = pickle.loads(pickle.dumps(ours))
    for t in (0.7, np.array([0.7]), np.linspace(0, 2, 5)):
        assert ours(t).shape == theirs(t).shape
        np.testing.assert_allclose(ours(t), theirs(t), atol=1e-3)
        np.testing.assert_array_equal(copy(t), ours(t))


def test_nothing_to_integrate_is_fine():
    solver = scipy_solver(method("tsit5"))
    assert solve_ivp(driven, (1, 1), [1, 0.5], solver, dense_output=True).y[:, -1].tolist() == [1, 0.5]
    assert solve_ivp(lambda t, y: y, (0, 1), [], solver).success


def test_vectorized_right_hand_sides():
    solver = scipy_solver(method("tsit5"))
    plain, vectorized = (solve_ivp(driven, (0, 3), [1, 0.5], solver, vectorized=v) for v in (False, True))
    np.testing.assert_array_equal(plain.y, vectorized.y)


def test_a_singularity_stops_before_it():
    for name in ("tsit5", "dop853"):
        with np.errstate(all="ignore"):
            found = solve_ivp(lambda t, y: y**2, (0, 2), [1.0], scipy_solver(method(name)))
        assert found.status == -1
        assert "step size" in found.message
        assert found.t[-1] == pytest.approx(1, abs=1e-2)


def test_a_right_hand_side_that_is_not_finite_fails():
    found = solve_ivp(lambda t, y: y * np.nan, (0, 2), [1.0], scipy_solver(method("tsit5")))
    assert found.status == -1
    assert found.t.tolist() == [0]
    assert "not finite" in found.message


def test_options_of_other_solvers_and_too_small_tolerances_are_warned_of():
    solver = scipy_solver(method("tsit5"))
    with pytest.warns(UserWarning, match="arguments have no effect .*`jac`"):
        solve_ivp(driven, (0, 1), [1, 0.5], solver, jac=None)
    with pytest.warns(UserWarning, match="At least one element of `rtol` is too small"):
        solve_ivp(driven, (0, 0.01), [1, 0.5], solver, rtol=1e-20)


def test_equal_methods_have_the_same_solver():
    assert scipy_solver(method("tsit5")) is scipy_solver(method("tsitouras5"))
    assert scipy_solver(method("tsit5")).__name__ == "tsit5"


@pytest.mark.parametrize("wrong", [3, method("stormer-verlet")], ids=str)
def test_what_is_no_tableau_is_refused(wrong):
    with pytest.raises(IntegratorError, match="method must be a RungeKutta, but was"):
        scipy_solver(wrong)


@pytest.mark.parametrize(("name", "order"), PAIRS.items())
def test_pairs_have_the_orders_of_their_sources(name, order):
    solver = scipy_solver(method(name))
    assert solver.error_estimator_order == order
    assert len(solver.E) == solver.n_stages + 1 == len(solver.A) + 1


def test_the_order_of_two_estimates_does_not_depend_on_their_order():
    dop853 = method("dop853")
    turned = RungeKutta(dop853.A, dop853.b, embedded=dop853.embedded[::-1], digits=dop853.digits)
    one, other = scipy_solver(dop853), scipy_solver(turned)
    assert one.error_estimator_order == other.error_estimator_order
    assert np.array_equal([one.E, one.E2], [other.E, other.E2])


@pytest.mark.parametrize(
    ("tableau", "message"),
    [
        (method("rk4"), "must have embedded weights .* but rk4 has none; of the catalogue have merson4, .*dop853"),
        (method("gauss2"), "must be explicit, but gauss2 is implicit"),
        (method("sdirk2"), "parameters of sdirk2 must have values, but gamma had none"),
        (RungeKutta(HEUN, ["1/2", "1/2"], embedded=["1/2", "1/2"]), "another result than b, but those of custom do"),
        (RungeKutta([[0, 0], [0, 0]], [1, 0], embedded=[0, 1]), "another result than b"),
        (RungeKutta(HEUN, ["1/2", "1/3"], embedded=[1, 0], warn=False), "must be consistent, but weights b sum to 5/6"),
        (RungeKutta(HEUN, ["1/2", "1/2"], [0, 2], embedded=[1, 0], warn=False), "consistent, but row 2 of A sums to 1"),
        (RungeKutta(HEUN, ["1/2", "1/2"], embedded=[[1, 0]] * 3), "one or two rows of embedded weights, .* has 3"),
    ],
)
def test_what_is_no_explicit_pair_is_refused(tableau, message):
    with pytest.raises(IntegratorError, match=message):
        scipy_solver(tableau)


def test_all_pairs_of_the_catalogue_are_in_these_tests():
    assert {entry.name for entry in catalogue() if entry.kind == "embedded pair"} == set(PAIRS)


def test_without_scipy_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy.integrate", None)
    with pytest.raises(ImportError, match=r"pip install '\.\[scipy\]' in the clone"):
        scipy_solver(method("tsit5"))


def test_right_hand_sides_are_the_fields_of_scenes():
    pendulum = scene("pendulum")
    fun = right_hand_side(pendulum)
    np.testing.assert_allclose(fun(3.0, np.array([0.5, 0.2])), [-np.sin(0.2), 0.5], rtol=1e-15)
    np.testing.assert_allclose(fun(0.0, [1, 0]), [0, 1])


@pytest.mark.parametrize("solver", ["RK45", "Radau", "BDF", "LSODA", "DOP853"])
def test_all_solvers_of_scipy_take_scenes(solver):
    oscillator = Scene({"p": 1, "q": 1}, hamiltonian="(p^2 + q^2)/2", start={"p": [0], "q": [1]})
    found = solve_ivp(right_hand_side(oscillator), (0, 2), oscillator.y0, solver, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.y[:, -1], [-np.sin(2), np.cos(2)], atol=1e-5)


def test_scenes_that_depend_on_the_time_carry_it():
    driven_scene = Scene({"y": 1}, field={"y": "cos(t)"}, start={"y": [0]})
    solver = scipy_solver(method("tsit5"))
    found = solve_ivp(right_hand_side(driven_scene), (0, 2), driven_scene.y0, solver, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.y[driven_scene.places["y"]], np.sin(found.t), atol=1e-7)
    np.testing.assert_allclose(found.y[driven_scene.places["t"]], found.t, atol=1e-12)


def test_states_that_do_not_fit_are_refused():
    fun = right_hand_side(scene("pendulum"))
    with pytest.raises(IntegratorError, match=r"y must have the shape \(2,\), but had \(3,\)"):
        fun(0.0, np.zeros(3))
    with pytest.raises(IntegratorError, match="y must be real, but was complex"):
        fun(0.0, np.zeros(2, dtype=complex))
    with pytest.raises(IntegratorError, match="scene must be a Scene or the name of one, but was 3"):
        right_hand_side(3)
