"""`predict_run`: expected errors against measured ones, and honest answers where they cannot be known."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

import bseries as bs
from bseries.advice.measures import energy_size, relative_change, relative_distance, without_time
from bseries.advice.predictions import perturbation_run as runs_module
from bseries.advice.predictions.modified_terms import modified_terms

FACTOR = 3.0
PENDULUM = bs.scene("pendulum")
SHIPPED = runs_module.MOST_POINTS


@pytest.fixture(autouse=True)
def short_runs(monkeypatch):
    """Half as long as they are otherwise."""
    monkeypatch.setattr(runs_module, "MOST_POINTS", SHIPPED // 2)


def predicted(scene, method, h, steps, **options):
    return bs.predict_run(method, scene, h=h, steps=steps, timed=False, **options)


def followed(found):
    """The number of steps over which errors are expected."""
    return round(found.covered * found.steps)


def measured(scene, method, h, steps, finer, looks=300):
    """The errors of energy and solution of a run, the latter from another method with finer steps."""
    every = max(1, steps // looks)
    run = bs.integrate(method, scene, h=h, steps=steps, save_every=every, observe="energy", observe_every=1)
    exact = bs.integrate("gauss4", scene, h=h / finer, steps=steps * finer, save_every=every * finer).y
    energy = run.observed["energy"]
    return relative_change(energy, energy_size(scene, scene.y0)), relative_distance(run.y, exact)


RUNS = [
    ("pendulum", "stormer-verlet", 0.4, 50, 4),
    ("pendulum", "stormer-verlet", 0.05, 200_000, 1),
    ("pendulum", "rk4", 0.1, 30_000, 1),
    ("pendulum", "yoshida6", 0.1, 100_000, 1),
    ("kepler", "stormer-verlet", 0.002, 30_000, 1),
    ("kepler", "rk4", 0.02, 3_000, 2),
    ("kepler", "rk4", 0.01, 200_000, 1),
    ("henon-heiles", "rk4", 0.1, 20_000, 1),
    ("toda", "gauss2", 0.1, 500, 4),
    ("lotka-volterra", "symplectic-euler-p", 0.03, 2_000, 1),
    ("outer-solar-system", "stormer-verlet", 100, 2_000, 2),
]
"""Scene, method, step size, steps, and how much finer the steps of the other method are."""
FURTHER_RUNS = [
    ("kepler", "gauss2", 0.05, 40_000, 5),
    ("henon-heiles", "yoshida6", 0.1, 50_000, 1),
    ("toda", "yoshida6", 0.03, 20_000, 1),
    ("lotka-volterra", "gauss2", 0.1, 20_000, 2),
    ("outer-solar-system", "rk4", 20, 10_000, 1),
]
"""Of scenes and of methods that are in `RUNS`."""


@pytest.mark.few(6)
@pytest.mark.parametrize(
    ("name", "method", "h", "steps", "finer"),
    [*RUNS, *(pytest.param(*run, marks=pytest.mark.slow) for run in FURTHER_RUNS)],
)
def test_errors_are_within_a_factor_of_three(name, method, h, steps, finer):
    scene = bs.scene(name)
    found = predicted(scene, method, h, steps)
    real = measured(scene, method, h, followed(found), finer)
    for expected, value in zip((found.energy, found.solution), real, strict=True):
        assert expected.value is not None, expected.reason
        assert 1 / FACTOR < expected.value / value < FACTOR


@pytest.mark.parametrize(
    ("name", "method", "h", "steps", "finer"),
    [
        ("pendulum", "stormer-verlet", 0.05, 400_000, 1), ("kepler", "gauss2", 0.05, 60_000, 5),
        ("henon-heiles", "rk4", 0.1, 20_000, 1), ("outer-solar-system", "stormer-verlet", 100, 10_000, 2),
    ],
)  # fmt: skip
def test_errors_over_the_whole_time_that_is_covered(name, method, h, steps, finer, monkeypatch):
    monkeypatch.setattr(runs_module, "MOST_POINTS", SHIPPED)
    test_errors_are_within_a_factor_of_three(name, method, h, steps, finer)


ROTATING = bs.scene("pendulum").with_start(p=[3], q=[0])


@pytest.mark.parametrize(
    ("scene", "method", "h", "steps", "finer"),
    [
        (ROTATING, "rk4", 0.05, 400_000, 1), (ROTATING, "gauss2", 0.05, 400_000, 1),
        (bs.scene("central-field"), "gauss2", 0.05, 200_000, 5),
    ],
)  # fmt: skip
def test_angles_grow_as_their_errors_do(scene, method, h, steps, finer):
    """Errors are relative to the angle at the end of the part that is followed, of which nothing goes beyond."""
    found = predicted(scene, method, h, steps)
    assert found.covered < 1 / 5
    real = measured(scene, method, h, followed(found), finer, looks=20_000)  # near a perihelion errors are large
    for expected, value in zip((found.energy, found.solution), real, strict=True):
        assert expected.value is not None, expected.reason
        assert 1 / 1.5 < expected.value / value < 1.5


def test_energies_near_zero_are_no_measure_of_an_orbit():
    """H = −cos q is 8e-4 at the start, and what rk4 loses 2.5e-3; the orbit is one of size 1 all the same."""
    scene = bs.scene("pendulum").with_start(p=[0], q=["1.57"])
    found = predicted(scene, "rk4", 0.2, 5000)
    real = measured(scene, "rk4", 0.2, followed(found), 2)
    assert found.energy.value == pytest.approx(real[0], rel=0.1)
    assert real[0] > 1
    assert found.solution.value == pytest.approx(real[1], rel=0.1)


@pytest.mark.few(1)
@pytest.mark.parametrize(("method", "h"), [("stormer-verlet", 0.02), ("gauss2", 0.02), ("rk4", 0.01)])
def test_energy_errors_of_atoms_are_known_though_their_paths_are_not(method, h):
    atoms, steps = bs.scene("lennard-jones"), round(100 / h)
    found = predicted(atoms, method, h, steps)
    energy = bs.integrate(method, atoms, h=h, steps=followed(found), save_every=None, observe="energy", observe_every=1)
    values = energy.observed["energy"]
    assert found.energy.value is not None
    assert 1 / FACTOR < found.energy.value / (abs(values - values[0]).max() / abs(values[0])) < FACTOR


def test_a_wrong_order_would_be_noticed():
    """What the second order method does is not what is expected of the fourth order one: the test above can fail."""
    pendulum = bs.scene("pendulum")
    real = measured(pendulum, "stormer-verlet", 0.1, 1000, 1)
    other = predicted(pendulum, "gauss2", 0.1, 1000)
    assert other.energy.value is not None
    assert other.solution.value is not None
    assert real[0] > 100 * other.energy.value
    assert real[1] > 100 * other.solution.value


class TestUnknown:
    """Where errors cannot be known, that is said with a reason."""

    def test_chaos(self, monkeypatch):
        monkeypatch.setattr(runs_module, "MOST_POINTS", SHIPPED)  # in half of them errors do not reach the orbit's size
        found = predicted(bs.scene("lennard-jones"), "stormer-verlet", 0.005, 10**6)
        assert found.solution.value is None
        assert "as in chaos" in found.solution.reason
        assert found.energy.value is not None

    def test_chaos_on_a_scene_that_is_also_regular(self):
        scene = bs.scene("henon-heiles")
        wild, tame = ([(1 / 3 - 0.01 - 0.002) ** 0.5, 0.1, 0.0, 0.0], None)
        found = predicted(scene, "gauss2", 0.1, 20_000, y0=wild).solution
        assert found.value is None or found.reason == "of the size of the orbit"
        regular = predicted(scene, "gauss2", 0.1, 20_000, y0=tame).solution.value
        assert regular is not None
        assert regular < 1e-3

    def test_chaos_from_errors_that_are_still_small(self):
        """The kicked solution is lost long before a run with so small errors is."""
        wild = [(1 / 3 - 0.01 - 0.002) ** 0.5, 0.1, 0.0, 0.0]
        found = predicted(bs.scene("henon-heiles"), "gauss4", 0.02, 30_000, y0=wild)
        assert found.covered == 1
        assert found.solution.value is None

    @pytest.mark.parametrize(
        ("scene", "method", "h", "steps"),
        [
            (bs.scene("pendulum", effects=["drive"]), "stormer-verlet", 0.1, 5000),
            (bs.scene("pendulum", effects=["drive"]), "stormer-verlet", 0.02, 25_000),
            (bs.scene("pendulum", effects=["drive"]), "rk4", 0.1, 5000),
            (bs.scene("double-pendulum").with_start(q=[2, 2]), "implicit-midpoint", 0.02, 3000),
        ],
    )
    def test_chaos_with_a_rough_method(self, scene, method, h, steps):
        """Errors larger than the kicks are linear in them for long, and then a hundred times as large as orbits are."""
        found = predicted(scene, method, h, steps)
        assert found.covered == 1
        assert found.solution.value is None
        assert "as in chaos" in found.solution.reason
        soon = predicted(scene, method, h, steps // 50).solution
        assert soon.value is not None
        assert soon.value < 1

    @pytest.mark.parametrize(
        ("name", "method", "h"),
        [("pendulum", "stormer-verlet", 2.5), ("kepler", "gauss2", 1.0), ("kepler", "rk4", 0.5)],
    )
    def test_steps_beyond_the_radius(self, name, method, h):
        found = predicted(bs.scene(name), method, h, 1000)
        assert found.energy.value is None
        assert "modified equation" in found.energy.reason or "orbit" in found.energy.reason

    def test_an_orbit_that_is_lost(self):
        found = predicted(bs.scene("pendulum"), "explicit-euler", 0.1, 1000)
        assert found.energy.value is found.solution.value is None
        assert "another" in found.energy.reason

    def test_an_orbit_that_is_lost_while_its_energy_hardly_changes(self):
        """A small oscillation grows by e^5: that is 1 % of H = p²/2 − cos q, which is −1 at rest."""
        small = bs.scene("pendulum").with_start(p=[0], q=["1/100"])
        found = predicted(small, "explicit-euler", 0.01, 100_000)
        assert found.energy.value is found.solution.value is None
        assert "another" in found.energy.reason
        sooner = predicted(small, "explicit-euler", 0.001, 10_000).solution
        assert sooner.value == pytest.approx(measured(small, "explicit-euler", 0.001, 10_000, 1)[1], rel=0.05)

    def test_terms_that_are_not_finite(self):
        found = predicted(bs.scene("pendulum"), "rk4", 0.1, 10, y0=[1e200, 1])
        assert found.energy.value is found.solution.value is None
        assert "y0 must be a state at which the terms of the modified equation are finite" in found.energy.reason

    def test_no_energy(self):
        found = predicted(bs.scene("pendulum", effects=["damping"]), "rk4", 0.1, 1000)
        assert found.energy.reason == "there is no energy that the scene conserves"
        assert found.solution.value is not None

    def test_blow_up(self):
        found = predicted(bs.parse_scene("y' = y^2"), "rk4", 0.01, 1000, y0=[1.0])
        assert found.solution.reason == "the solution could not be computed beyond t = 1.02"
        assert found.powers == ()

    def test_variable_steps(self):
        found = predicted(bs.scene("kepler"), "stormer-verlet", 0.01, 1000, control="sqrt(q1^2 + q2^2)")
        assert "constant steps" in found.solution.reason
        assert "errors unknown: " in str(found)

    def test_symbols_are_refused(self):
        with pytest.raises(bs.IntegratorError, match="must"):
            predicted(bs.scene("kepler", mu="mu"), "rk4", 0.01, 100)


@pytest.mark.parametrize(("name", "method"), [("pendulum", "avf"), ("rigid-body", "gauss2")])
def test_of_energy_that_is_conserved_only_rounding_is_left(name, method):
    found = predicted(bs.scene(name), method, 0.1, 10**5)
    assert found.energy.reason == "rounding will be larger"
    assert found.energy.value is not None
    assert found.energy.value < 1e-14


@pytest.mark.parametrize("h", np.linspace(0.0147, 0.0157, 11))
def test_of_runs_that_are_covered_nothing_is_extrapolated(h):
    """Not even by one rounding of the time; three quarters of a turn would not tell how the solution goes on."""
    found = predicted(bs.scene("kepler"), "rk4", h, 300)
    assert found.covered == 1
    assert found.solution.value is not None


@pytest.mark.parametrize(("h", "steps"), [(1e-60, 10), (1e-80, 10), (1e-100, 3), (1e-300, 3), (1e-320, 3)])
def test_of_tiny_steps_only_rounding_is_left(h, steps):
    found = predicted(bs.scene("pendulum"), "rk4", h, steps)
    assert found.energy == found.solution == bs.advice.ExpectedError(0.0, "rounding will be larger")


def test_tiny_states_are_as_good_as_others():
    linear = bs.scene("linear")
    one, tiny = (predicted(linear, "rk4", 0.1, 100, y0=[size, 0]).solution.value for size in (1.0, 1e-200))
    assert tiny == pytest.approx(one, rel=1e-6)


def test_a_motion_may_begin_slowly():
    """The double pendulum begins at rest; the grid must not be that of its first moment."""
    scene = bs.scene("double-pendulum")
    found = predicted(scene, "gauss2", 0.01, 200)
    real = measured(scene, "gauss2", 0.01, 200, 2)
    for expected, value in zip((found.energy, found.solution), real, strict=True):
        assert expected.value is not None, expected.reason
        assert 1 / FACTOR < expected.value / value < FACTOR


def test_damped_errors_do_not_grow_for_ever():
    """After the pendulum has come to rest nothing is added."""
    damped = bs.scene("pendulum", effects=["damping"], gamma="1/2")
    short, long = (predicted(damped, "rk4", 0.2, steps).solution for steps in (500, 50_000))
    assert short.value is not None
    assert long.value == pytest.approx(short.value, rel=0.1)


def test_time_among_the_variables_has_no_error():
    driven = bs.scene("pendulum", effects=["drive"], amplitude="1/100")
    found = predicted(driven, "rk4", 0.1, 300)
    runs = [bs.integrate(m, driven, h=0.1 / k, steps=300 * k, save_every=k).y for m, k in (("rk4", 1), ("gauss4", 2))]
    real = relative_distance(*(without_time(driven, y) for y in runs))
    assert found.solution.value is not None
    assert 1 / FACTOR < found.solution.value / real < FACTOR
    assert relative_distance(*runs) < real / FACTOR  # with the time, which is 30 in the end


def test_backwards_in_time_is_as_good_as_forwards():
    pendulum = bs.scene("pendulum")
    there, back = (predicted(pendulum, "gauss2", h, 1000) for h in (0.1, -0.1))
    assert back.energy.value == pytest.approx(there.energy.value, rel=1e-3)
    assert back.solution.value == pytest.approx(there.solution.value, rel=1e-2)


def test_exact_methods_have_rounding_errors_only():
    free = bs.Scene({"p": 1, "q": 1}, hamiltonian="p^2/2", start={"p": [1], "q": [0]})
    found = predicted(free, "rk4", 0.1, 100)
    assert found.energy == found.solution == bs.advice.ExpectedError(0.0, "only rounding")


@pytest.mark.parametrize(
    ("name", "powers"),
    [("explicit-euler", (1, 2, 3)), ("dop853", (8, 9, 10)), ("yoshida6", (6, 8)), ("gauss4", (8, 10))],
)
def test_powers_begin_with_the_order(name, powers):
    assert modified_terms(bs.method(name), bs.scene("pendulum")).powers == powers


def near_separatrix(t):
    """The pendulum from rest at q = 3.14, at some times: by elliptic functions."""
    with mpmath.workdps(30):
        k = mpmath.sin(mpmath.mpf(3.14) / 2)
        quarter = mpmath.ellipk(k**2)
        values = [[mpmath.ellipfun(f, x + quarter, m=k**2) for f in ("sn", "cn")] for x in t]
        return np.array([[float(2 * k * cn), float(2 * mpmath.asin(k * sn))] for sn, cn in values]).T


def test_orbits_that_a_small_change_makes_others():
    """Next to a separatrix errors are linear in r only as long as they are small beside the distance from it."""
    start, t = PENDULUM.with_start(p=[0], q=["3.14"]), np.arange(0, 2001, 20)
    found = predicted(start, "gauss2", 0.1, 20_000).solution
    run = bs.integrate("gauss2", start, h=0.1, steps=20_000, save_every=200)
    real = relative_distance(run.y, near_separatrix(t))
    assert found.value is not None, found.reason
    assert 1 / FACTOR < found.value / real < FACTOR
    assert predicted(start, "stormer-verlet", 0.1, 20_000).solution.value is None
    far = predicted(PENDULUM.with_start(p=[0], q=["3.1"]), "stormer-verlet", 0.1, 200).solution
    assert far.value is not None  # control


@pytest.mark.parametrize("steps", [2000, 20_000])
def test_a_run_that_leaves_for_another_kind_of_motion_is_unknown(steps):
    """The method turns round where the pendulum swings."""
    start = PENDULUM.with_start(p=["1.999"], q=[0])
    run = bs.integrate("stormer-verlet", start, h=0.1, steps=steps)
    assert abs(run.y[1]).max() > 2 * np.pi  # control
    found = predicted(start, "stormer-verlet", 0.1, steps).solution
    assert found.value is None
    assert "as in chaos" in found.reason


def test_energies_that_change_by_as_much_as_there_is_are_unknown():
    comet = bs.scene("kepler", eccentricity="0.99")
    found = predicted(comet, "stormer-verlet", 0.001, 20_000)
    assert found.energy.value is found.solution.value is None
    assert "the orbit is another one" in found.energy.reason


@pytest.mark.parametrize("steps", [200, 2000, 20_000])
def test_terms_whose_own_effects_cancel(steps):
    """Of the symplectic Euler method the first term only oscillates, and with its square does what the second does."""
    found = predicted(PENDULUM, "symplectic-euler-p", 0.02, steps)
    measures = measured(PENDULUM, "symplectic-euler-p", 0.02, followed(found), 1)
    for expected, real in zip((found.energy, found.solution), measures, strict=True):
        assert expected.value is not None, expected.reason
        assert 1 / FACTOR < expected.value / real < FACTOR


def test_a_method_must_follow_the_field():
    with pytest.warns(bs.methods.TableauWarning, match="inconsistent"):
        slow = bs.RungeKutta([[0, 0], [1, 0]], ["1/2", "1/3"], name="slow")
    found = predicted(PENDULUM, slow, 0.01, 1000)
    assert found.energy.value is found.solution.value is None
    assert found.solution.reason == "method must be consistent, but slow follows 0.833 times the field"


@pytest.mark.parametrize(("h", "steps"), [(1e308, 10), (1e300, 10**10)])
def test_times_beyond_all_numbers(h, steps):
    with pytest.raises(bs.IntegratorError, match="h must be small enough for a finite time"):
        predicted(PENDULUM, "rk4", h, steps)


@pytest.mark.parametrize("option", ["to", "checkpoint"])
def test_a_prediction_leaves_files_alone(option, tmp_path):
    path = tmp_path / "run.npz"
    bs.integrate("rk4", bs.scene("pendulum"), h=0.1, steps=50, to=path)
    before = path.read_bytes()
    with pytest.raises(bs.IntegratorError, match=f"{option} must be left out"):
        bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=1000, **{option: path})
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(bs.IntegratorError, match="progress must be left out"):
        bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=1000, progress=print)


def test_times_are_those_of_the_same_code():
    found = bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=10**9, observe="energy", observe_every=1000)
    assert found.seconds is not None
    assert 0.1 < found.seconds < 1e5
    again = bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=10, seconds_per_step=2.0)
    assert again.seconds == 20.0


@pytest.mark.parametrize("steps", [63, 64])
def test_short_runs_are_repeated_until_their_time_is_known(steps):
    found = bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=steps)
    longer = bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=2 * steps)
    assert found.seconds is not None
    assert longer.seconds is not None
    assert 1 / 5 < found.seconds / longer.seconds < 5


def test_what_is_not_finite_in_a_calibration_is_no_warning():
    found = bs.predict_run("explicit-euler", bs.scene("lotka-volterra"), h=1, steps=8, observe="energy")
    assert found.solution.value is None


@pytest.mark.parametrize("steps", [0, 1, 10])
def test_times_of_too_few_steps_are_unknown_and_not_zero(steps):
    found = bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=steps)
    assert found.seconds is None
    assert str(found).startswith("relative energy error ")


@pytest.mark.parametrize("steps", [-30, 2.5, "x", True, 2**53 + 1])
def test_steps_are_a_whole_number(steps):
    with pytest.raises(bs.IntegratorError, match=r"steps must be a whole number from 0 to 2\^53, but was "):
        predicted(bs.scene("pendulum"), "rk4", 0.1, steps)


@pytest.mark.parametrize("known", [{"timed": False}, {"seconds_per_step": 1.0}])
def test_options_that_there_are_not(known):
    with pytest.raises(TypeError, match="unexpected keyword argument 'obsreve'"):
        bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=10, obsreve="energy", **known)


@pytest.mark.parametrize(
    ("cost", "message"),
    [
        (-3.0, "must be positive, but was -3"),
        (0, "must be positive, but was 0"),
        ("x", "must be a"),
        (np.nan, "must be a finite number, but was nan"),
    ],
)
def test_known_costs_are_positive_numbers(cost, message):
    with pytest.raises(bs.IntegratorError, match=f"seconds_per_step {message}"):
        bs.predict_run("rk4", bs.scene("pendulum"), h=0.1, steps=10, seconds_per_step=cost)


def test_failing_steps_are_errors():
    with pytest.raises(bs.integrators.StepError, match="step 1"):
        bs.predict_run("implicit-euler", bs.parse_scene("y' = y^2"), y0=[1.0], h=10, steps=5)


def test_nothing_is_asked_of_the_time_beyond_the_end():
    """y' = y² blows up at t = 1, which a perturbation run of some hundred points would reach from a run to t = 0.2."""
    riccati = bs.scene("riccati")
    found = predicted(riccati, "rk4", 0.01, 20)
    run = bs.integrate("rk4", riccati, h=0.01, steps=20, save_every=1)
    real = np.abs(run.y[0] * (1 - run.t) - 1) / (1 - run.t)
    assert found.solution.value is not None, found.solution.reason
    assert 1 / FACTOR < found.solution.value / (real.max() / run.y.max()) < FACTOR


def test_plain_data_and_text():
    found = bs.predict_run("gauss2", bs.scene("pendulum"), h=0.1, steps=10**6, timed=False)
    data = found.to_dict()
    assert data["powers"] == [4, 6]
    assert data["energy_error"]["value"] == found.energy.value
    assert str(found).startswith("relative energy error 1.8e-06, relative solution error ")
    assert "from the modified equation to h^6, over the first 1.4 % of the time" in str(found)


@pytest.mark.parametrize("more", ["", " + y/10^8"])
def test_fields_of_the_time_alone(more):
    """Steps may keep slopes that do not depend on the state, but none that a kick would change."""
    found = bs.predict_run("rk4", bs.parse_scene(f"y' = t^5{more}", start="y=1"), h=0.1, steps=60, timed=False)
    assert found.solution.value == pytest.approx(9.6e-9, rel=0.05)
