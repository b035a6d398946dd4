"""Runs of multistep methods in generated steps: against the recursion itself, their order, and their parasites."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import bseries as bs

memory = bs.memory
METHODS = ["ab1", "ab2", "ab4", "am1", "am3", "bdf1", "bdf3", "nystrom-multistep2", "milne-simpson2"]


def exact(scene, times):
    """A reference solution at some times, (times, variables)."""
    field, span, y0 = bs.integrators.right_hand_side(scene), (0, max(times) or 1), bs.scene(scene).y0
    return np.array(solve_ivp(field, span, y0, t_eval=times, rtol=1e-13, atol=1e-14, method="DOP853").y).T


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("scene", ["pendulum", "brusselator"])
def test_runs_satisfy_the_recursion_and_have_its_order(name, scene):
    method, field, errors = bs.method(name), bs.integrators.right_hand_side(scene), []
    for steps in (64, 128):
        h = 1 / steps
        start = exact(scene, [j * h for j in range(method.steps)])
        run = bs.integrate(method, scene, h=h, steps=steps, start=start)
        y = run.y.T
        assert (y[: method.steps] == start).all()
        assert run.t == pytest.approx(np.arange(steps + 1) * h)
        slopes = np.array([field(0, x) for x in y])
        alpha, beta = (np.array(row, float) for row in (method.alpha, method.beta))
        windows = (slice(n, n + method.steps + 1) for n in range(steps + 1 - method.steps))
        residuals = [alpha @ y[window] - h * beta @ slopes[window] for window in windows]
        assert abs(np.array(residuals)).max() < 5e-15 * (1 + abs(y).max())
        errors.append(abs(y[-1] - exact(scene, [0, 1])[-1]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(method.order, abs=0.25)


@pytest.mark.parametrize("name", ["ab3", "bdf2", "ab5"])
def test_starting_by_a_runge_kutta_method_keeps_the_order(name):
    errors = []
    for steps in (64, 128):
        run = bs.integrate(name, "pendulum", h=1 / steps, steps=steps)
        errors.append(abs(run.y[:, -1] - exact("pendulum", [0, 1])[-1]).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(bs.method(name).order, abs=0.25)


def test_the_parasite_of_leapfrog_on_a_decaying_solution():
    """From exact starting values it is 7.47e-5 (−1.105)^n for h = 0.1; on the underlying method there is none."""
    decay = bs.parse_scene("y' = -y")
    run = bs.integrate("nystrom-multistep2", decay, h=0.1, steps=150, start=[[1.0], [np.exp(-0.1)]])
    assert run.y[0, 100] == pytest.approx(1.618, abs=5e-4)
    assert run.y[0, 150] == pytest.approx(238, abs=0.5)
    root = -0.1 + np.sqrt(1.01)  # Φ on this equation, whose powers are the solution without parasite
    started = bs.integrate("nystrom-multistep2", decay, h=0.1, steps=100, start=[[1.0], [root]])
    assert started.y[0, 100] == pytest.approx(4.616e-5, rel=1e-3)
    values = memory.starting_values("nystrom-multistep2", decay, 0.1, 12, y0=[1.0])
    assert values[1, 0] == pytest.approx(root, abs=1e-14)


def parasites(h, starts):
    """Sizes at t = 4 of the component that changes its sign in each step, for leapfrog on the pendulum."""
    steps = round(4 / h)

    def run(start):
        return bs.integrate("nystrom-multistep2", "pendulum", h=h, steps=steps + 1, start=start).y

    best = run(memory.starting_values("nystrom-multistep2", "pendulum", h, 9))
    differences = [run(start) - best for start in starts]
    return [abs(d[:, steps - 1] - 2 * d[:, steps] + d[:, steps + 1]).max() / 4 for d in differences]


def test_parasites_are_as_small_as_the_starting_procedure_is_accurate():
    """The modified flow truncated at h⁰, h², h⁴ leaves h³, h⁵, h⁷; Φ to 2, 4, 6 nodes leaves h⁴, h⁶, h⁸ as its next
    coefficients vanish."""
    fields = [bs.modified_field("nystrom-multistep2", "pendulum", nodes) for nodes in (1, 3, 5)]
    sizes = []
    for h in (0.1, 0.05):
        y0 = bs.scene("pendulum").y0
        flows = [
            solve_ivp(lambda t, y, f=f, h=h: f(y, h), (0, h), y0, rtol=1e-13, atol=1e-15, method="DOP853").y[:, -1]
            for f in fields
        ]
        series = [memory.starting_values("nystrom-multistep2", "pendulum", h, nodes) for nodes in (2, 4, 6)]
        sizes.append(parasites(h, [*(np.array([y0, y]) for y in flows), *series]))
    assert np.log2(np.divide(*sizes)) == pytest.approx([3, 5, 7, 4, 6, 8], abs=0.3)


def test_runs_do_not_depend_on_how_they_are_cut(tmp_path):
    whole = bs.integrate("ab4", "kepler", h=0.01, steps=300, observe="energy")
    sparse = bs.integrate("ab4", "kepler", h=0.01, steps=300, save_every=7, observe="energy")
    assert (whole.y[:, :295:7] == sparse.y[:, :43]).all()
    assert (whole.observed["energy"][:295:7] == sparse.observed["energy"][:43]).all()
    assert whole.t[:5] == pytest.approx([0, 0.01, 0.02, 0.03, 0.04])
    stepper = bs.stepper("bdf3", "pendulum")
    start = memory.starting_values("bdf3", "pendulum", 0.05)
    one, other = stepper.start(start, h=0.05), stepper.start(start, h=0.05)
    assert (one.n, one.t) == (2, 0.1)
    stepper.advance(one, 40)
    for _ in range(40):
        stepper.advance(other, 1)
    assert (one.y == other.y).all()


def test_stiff_problems_are_solved_by_bdf():
    stiff = bs.parse_scene("u' = -2000*(u - cos(v)); v' = 1", name="stiff")
    run = bs.integrate("bdf4", stiff, h=0.05, steps=40, y0=[1.0, 0.0])
    assert abs(run.y[0, -1] - np.cos(2)) < 1e-3
    with pytest.raises(bs.integrators.StepError):
        bs.integrate("ab4", stiff, h=0.05, steps=400, y0=[1.0, 0.0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": "underlying"}, "start must be runge-kutta or the starting values"),
        ({"start": [[0.0, 1.0]]}, "start must be the 3 starting values of ab3"),
        ({"start": np.zeros((3, 2)), "y0": [0, 1]}, "y0 must be left out where start"),
        ({"start": [[0, 1], [0, 1], [0, np.inf]]}, "finite"),
        ({"steps": 1}, "steps must be at least 2 for ab3"),
        ({"control": "1 + p^2"}, "control must be None for a multistep method"),
    ],
)
def test_bad_starts_are_refused(options, message):
    with pytest.raises(bs.IntegratorError, match=message):
        bs.integrate("ab3", "pendulum", **{"h": 0.1, "steps": 10, **options})


def test_other_methods_with_memory_and_symbols_are_refused():
    with pytest.raises(bs.IntegratorError, match="start must be left out for a one-step method"):
        bs.integrate("rk4", "pendulum", h=0.1, steps=10, start=[[0, 1]])
    with pytest.raises(bs.IntegratorError, match="must be a one-step method"):
        bs.integrate(bs.method("ab2").to_general_linear(), "pendulum", h=0.1, steps=10)
    momentum = bs.LinearMultistep(["m", "-1 - m", 1], [0, 1, 0], rescaled=True, parameters=["m"])
    with pytest.raises(bs.IntegratorError, match="parameters must have values"):
        bs.integrate(momentum, "pendulum", h=0.1, steps=10)
    with pytest.raises(bs.IntegratorError, match="y0 must be the 2 starting values of ab2"):
        bs.stepper("ab2", "pendulum").start([0.0, 1.0], h=0.1)
    with pytest.raises(bs.SeriesError, match="must be a linear multistep method"):
        memory.starting_values("rk4", "pendulum", 0.1)


LOSS = "x' = -(x + 4*x^3 - y); y' = -(2*y - x + y^3)"
"""f = −∇L for L = x²/2 + x⁴ − xy + y² + y⁴/4."""


@pytest.mark.parametrize(("momentum", "h"), [("1/2", 0.002), ("9/10", 0.0001)])
def test_the_memoryless_equation_predicts_a_run_with_momentum(momentum, h):
    """Heavy-ball gradient descent follows the modified equation with the field f/(1 − m); one term is not enough."""
    method = bs.LinearMultistep([momentum, f"-1 - {momentum}", 1], [0, 1, 0], rescaled=True, name="momentum")
    scene, steps = bs.parse_scene(LOSS), 200
    start = memory.starting_values(method, scene, h, 6, y0=[1.0, -1.0])
    run = bs.integrate(method, scene, h=h, steps=steps, start=start)
    errors = []
    for nodes in (1, 2, 5):
        field = bs.modified_field(method, scene, nodes)
        end = solve_ivp(lambda t, y, f=field: f(y, h), (0, steps * h), start[0], rtol=1e-12, atol=1e-13).y[:, -1]
        errors.append(np.linalg.norm(end - run.y[:, -1]) / np.linalg.norm(run.y[:, -1]))
    assert errors[2] < 0.01
    assert errors[2] < errors[1] / 5 < errors[0] / 15
    assert errors[0] > 0.01  # negative control: the gradient flow alone, with the rescaled step, is not as close


@pytest.mark.parametrize("start", [np.zeros((2, 2)), [[0, 1], [1, 0]], None, "underlying"])
def test_one_step_methods_need_no_starting_values(start):
    with pytest.raises(bs.IntegratorError, match="start must be left out for a one-step method, but was "):
        bs.integrate("rk4", "pendulum", h=0.1, steps=3, start=start)
