"""Extreme scales of the state and extreme steps: an accuracy, a clear error or a warning, through every door."""

from __future__ import annotations

import math
import warnings
from fractions import Fraction

import numpy as np
import pytest

import bseries as bs

pytestmark = pytest.mark.slow

PENDULUM = bs.scene("pendulum")
OSCILLATOR = bs.scene("linear")
PREDATORS = bs.scene("lotka-volterra")
METHODS = ("stormer-verlet", "rk4", "implicit-midpoint")
SUBNORMAL = 5e-324
"""The least positive double."""


def integrate(method, h, **options):
    return bs.integrate(method, PENDULUM, h=h, **{"steps": 3, **options})


def step(method, h):
    """Three steps without `integrate`."""
    stepper = bs.stepper(method, PENDULUM)
    state = stepper.start(h=h)
    stepper.advance(state, 3)
    return state


def ensemble(method, h):
    return bs.ensemble(method, PENDULUM, h=h, steps=3, y0=[[0, -1.5], [0, 1.5]], final=True, workers=1)


# Steps that can be made


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("h", [1e-300, -1e-300, SUBNORMAL])
def test_steps_that_change_next_to_nothing(method, h, measured):
    """p = −h n sin(q), exactly up to the last bit of a subnormal number; q does not move."""
    expected = 3 * h * math.sin(1.5)
    ends = integrate(method, h).y[:, -1], step(method, h).y, ensemble(method, h).final[0]
    assert all(q == -1.5 for _, q in ends)
    error = max(abs(p - expected) / max(SUBNORMAL, np.spacing(abs(expected))) for p, _ in ends)
    measured.within(
        f"pendulum, {method}, 3 steps of {h:.0e}: p = 3h sin(3/2), while q stays", error, 2, " ulp", form=".1f"
    )


@pytest.mark.parametrize("h", [1, -1, Fraction(1, 10), np.float32(0.5), np.int8(2), "0.1"])
def test_kinds_of_numbers(h):
    for method in METHODS:
        number = float(h)
        assert (integrate(method, h).y == integrate(method, number).y).all()
        assert (step(method, h).y == integrate(method, number).y[:, -1]).all()
        assert ensemble(method, h).t.tolist() == [n * number for n in range(4)]


def test_32_bit_steps_are_the_doubles_that_they_are():
    assert (integrate("rk4", np.float32(0.1)).y == integrate("rk4", 0.10000000149011612).y).all()
    assert (integrate("rk4", np.float32(0.1)).y != integrate("rk4", 0.1).y)[:, -1].all()


# Steps that cannot


REFUSED = {
    "0": (0, "h must not be zero"),
    "−0.0": (-0.0, "h must not be zero"),
    "1/10⁴⁰⁰": (Fraction(1, 10**400), "h must not be zero"),
    "nan": (math.nan, "h must be a finite number, but was nan"),
    "∞": (math.inf, "h must be a finite number, but was inf"),
    "−∞": (-math.inf, "h must be a finite number, but was -inf"),
    "10⁴⁰⁰": (10**400, r"h must be a finite number, but was 1000\d+\.\.\."),
    "10⁵⁰⁰⁰": (10**5000, "h must be a finite number, but was too long to be printed"),
    "True": (True, "h must be a finite number, but was True"),
    "None": (None, "h must be a finite number, but was None"),
    "text": ("a tenth", "h must be a number, but 'a tenth' has the unknown name 'a'"),
    "complex": (0.1j, "h must be a finite number, but was 0.1j"),
    "a list": ([0.1], r"h must be a finite number, but was \[0.1\]"),
}


@pytest.mark.parametrize("h", REFUSED)
def test_what_is_no_step_is_refused(h, measured):
    value, sentence = REFUSED[h]
    for run in (integrate, step, ensemble):
        for method in METHODS:
            with pytest.raises(bs.IntegratorError, match=f"^{sentence}"):
                run(method, value)
    measured.said(f"pendulum, all methods, h: {h}", "refused", f"“{sentence.split(', but')[0]} …”")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("h", [1e300, -1e300])
def test_steps_that_are_too_large_say_so(method, h, measured):
    with pytest.raises(
        bs.integrators.StepError, match=r"h must be small enough for .*, but with h = -?1e\+300 step 1, from"
    ) as found:
        integrate(method, h)
    kept = found.value.trajectory
    assert kept is not None
    assert kept.y.T.tolist() == [[0, -1.5]]
    with pytest.raises(bs.integrators.StepError, match="h must be small enough for"):
        step(method, h)
    failures = ensemble_of_failures(method, h)
    assert [failure.step for failure in failures] == [1, 1]
    measured.said(
        f"pendulum, {method}, h = {h:g}", "StepError, the start is kept", f"“… {str(found.value).rpartition(', ')[2]}”"
    )


def ensemble_of_failures(method, h):
    """All members fail, and are listed; what is left has a mean at t = 0 only."""
    result = ensemble(method, h)
    assert np.isnan(result.mean["energy"][1:]).all()
    assert result.count.tolist() == [2, 0, 0, 0]
    return result.failures


@pytest.mark.parametrize("h", [1e155, 1e200])
def test_squares_of_steps_that_overflow_are_no_answer(h, measured):
    """h² is infinite in the matrix of Newton's method, and 1/∞ = 0 would be a change that is small enough."""
    with pytest.raises(bs.integrators.StepError, match="step 1, from t = 0, did not converge"):
        integrate("implicit-midpoint", h)
    measured.said(f"pendulum, implicit-midpoint, h = {h:g}: h² overflows", "StepError", "“… did not converge”")


@pytest.mark.parametrize("h", [1e3, 1e8, 1e100, 1e150])
def test_implicit_equations_hold_for_large_steps(h, measured):
    """sin(q) at the middle must be the (small) slope; any of the many solutions will do."""
    (_, p), (q0, q) = integrate("implicit-midpoint", h, steps=1, y0=(0, -1.5)).y
    middle = (q0 + q) / 2
    residual = abs(math.sin(middle) + 2 * (q - q0) / h / h) / max(1, abs(middle))
    assert abs(q - q0 - h * p / 2) <= 4e-16 * abs(q)
    measured.within(
        f"pendulum, implicit-midpoint, one step of {h:g}: residual of its equations", residual, 1e-15, " |q|"
    )


def test_times_that_no_double_holds_are_refused(measured):
    sentence = r"h must be small enough for a finite time after 3 steps from t = 0, but was 1e\+308"
    for run in (integrate, step, ensemble):
        with pytest.raises(bs.IntegratorError, match=sentence):
            run("rk4", 1e308)
    measured.said("3 steps of 1e308: the time overflows", "refused", "“h must be small enough for a finite time …”")
    assert integrate("rk4", 0.1, t0=1e308).t.tolist() == [1e308] * 4
    for t0 in (math.nan, math.inf, None, 10**400):
        with pytest.raises(bs.IntegratorError, match="t0 must be a finite number, but was"):
            integrate("rk4", 0.1, t0=t0)


NO_COUNTS = {repr(value)[:10]: value for value in (-1, 2.5, -3.0, 1e17, "3", True, math.nan, [3], 10**30)} | {
    "10⁵⁰⁰⁰": 10**5000
}


@pytest.mark.parametrize("steps", NO_COUNTS)
def test_what_is_no_number_of_steps_is_refused(steps):
    with pytest.raises(bs.IntegratorError, match=r"steps must be a whole number from 0 to 2\^53, but was "):
        integrate("rk4", 0.1, steps=NO_COUNTS[steps])


def test_runs_without_end_are_refused_before_they_begin(measured):
    with pytest.raises(bs.IntegratorError, match=r"save_every must be larger, .* GB of memory, but"):
        integrate("rk4", 1e-300, steps=10**14)
    measured.said("10¹⁴ steps of 1e-300, all states kept", "refused", "“save_every must be larger …”")


# The modified equation


@pytest.fixture(scope="module")
def field():
    return bs.modified_field(bs.method("implicit-midpoint"), PENDULUM, 5)


@pytest.fixture(scope="module")
def energy():
    return bs.modified_hamiltonian(bs.method("implicit-midpoint"), PENDULUM, 5)


POINT = (0.3, -1.5)


@pytest.mark.parametrize("h", [math.nan, math.inf, -math.inf, 10**400, True, None, "0.1", 0.1j, [0.1]])
def test_series_take_finite_steps_only(field, energy, h, measured):
    evaluations = (
        field,
        energy,
        energy.gradient,
        lambda y, h: energy.observer(h),
        lambda y, h: bs.fields.reach(field, y, h),
    )
    for evaluate in evaluations:
        with pytest.raises(bs.SeriesError, match=r"^h must be (a finite|a real|within the range of floats)"):
            evaluate(POINT, h)
    shown = "10⁴⁰⁰" if h == 10**400 else repr(h)
    measured.said(f"modified field, Hamiltonian and reach, h = {shown}", "refused", "“h must be …”")


def test_series_at_steps_without_influence(field, energy):
    exact = [math.sin(1.5), 0.3]
    for h in (0, 1e-300, -SUBNORMAL):
        assert field(POINT, h) == pytest.approx(exact, rel=1e-15)
        assert energy(POINT, h) == pytest.approx(0.045 - math.cos(1.5), rel=1e-15)
    with pytest.raises(bs.SeriesError, match="h must be a finite number other than 0, but was 0"):
        bs.fields.reach(field, POINT, 0)
    assert bs.fields.reach(field, POINT, 1e-300).optimal_order == 5


@pytest.mark.filterwarnings("ignore::bseries.fields.term_sizes.TruncationWarning")
def test_series_that_overflow_say_so(field, energy, measured):
    for evaluate in (field, energy, energy.gradient):
        with pytest.warns(
            RuntimeWarning, match=r"on pendulum must have finite values, but with h = 1e\+300 had none at 1 of"
        ):
            assert not np.isfinite(evaluate(POINT, 1e300)).all()
    with pytest.raises(bs.SeriesError, match=r"h must be small enough for finite terms, but was 1e\+300"):
        bs.fields.reach(field, POINT, 1e300)
    measured.said("modified field and Hamiltonian, h = 1e300", "warns", "“… must have finite values …”")
    measured.said("reach, h = 1e300", "refused", "“h must be small enough for finite terms …”")


def test_points_outside_the_domain_are_counted(measured):
    kepler = bs.modified_field(bs.method("implicit-midpoint"), bs.scene("kepler"), 3)
    points = np.array([[0, 1, 0, 0], [0, 1, 1, 0], [0, 1, 1e-200, 0]], float).T
    with pytest.warns(RuntimeWarning, match=r"on kepler must have finite values, .* had none at 2 of 3 points"):
        values = kepler(points, 0.1)
    assert np.isfinite(values).all(axis=0).tolist() == [False, True, False]
    with pytest.raises(bs.SeriesError, match=r"y must be where all terms of f are finite, but that with h\^0 was nan"):
        bs.fields.reach(kepler, points[:, 0], 0.1)
    with pytest.raises(bs.SeriesError, match="y must be finite numbers, but was"):
        bs.fields.reach(kepler, [0, math.inf, 1, 0], 0.1)
    measured.said(
        "modified field of kepler at q = 0", "warns, and tells at how many points", "“… none at 2 of 3 points”"
    )


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1e160, 1e300])
def test_sizes_of_terms_neither_overflow_nor_vanish(scale, measured):
    """On linear scenes the sizes are proportional to y; their squares have no double."""
    field = bs.modified_field(bs.method("explicit-euler"), OSCILLATOR, 4)
    found, unit = bs.fields.reach(field, [scale, scale], 0.1), bs.fields.reach(field, [1, 1], 0.1)
    error = max(abs(a / b / scale - 1) for a, b in zip(found.norms, unit.norms, strict=True))
    case = f"reach on the oscillator at y = ({scale:g}, {scale:g}): sizes of terms"
    measured.within(case, error, 1e-14, what="relative error")


# Scales of the state


@pytest.mark.parametrize("method", ["rk4", "gauss3"])
def test_linear_scenes_are_scaled_bit_for_bit(method, measured):
    """Powers of two change no digit, nor those of the carry, from 1e-289 to 1e307; below, last bits are lost."""
    one = bs.integrate(method, OSCILLATOR, h=0.1, steps=100, y0=(1, 0.3)).y
    for power in (-960, -600, 600, 1020):
        scaled = bs.integrate(method, OSCILLATOR, h=0.1, steps=100, y0=np.array([1, 0.3]) * 2.0**power).y
        assert (scaled == one * 2.0**power).all()
    measured.said(f"oscillator, {method}, y0 times 2⁻⁹⁶⁰ … 2¹⁰²⁰, 100 steps", "the same digits", "bit for bit")
    small = bs.integrate(method, OSCILLATOR, h=0.1, steps=100, y0=np.array([1, 0.3]) * 2.0**-1060).y
    error = float(abs(small - one * 2.0**-1060).max() / SUBNORMAL)
    assert error > 0
    case = f"oscillator, {method}, y0 times 2⁻¹⁰⁶⁰ (subnormal), 100 steps"
    measured.within(case, error, 100, " last bits", form=".0f")


@pytest.mark.parametrize(
    ("method", "solver", "promise"),
    [("rk4", "auto", 1e-14), ("radau-iia3", "newton", 1e-14), ("radau-iia3", "fixed-point", 1e-9)],
)
def test_mixed_scales(method, solver, promise, measured):
    """Two variables that do not know one another: fixed points end when the larger has converged."""
    apart = bs.scene("linear", matrix=[["-1/10", 0], [0, -1]])
    one, mixed = (
        bs.integrate(method, apart, h=0.5, steps=10, y0=y0, solver=solver).y for y0 in ((1, 1), (1e200, 1e-200))
    )
    error = float(abs(mixed[:, -1] / one[:, -1] / (1e200, 1e-200) - 1).max())
    case = f"two equations with y0 = (1e200, 1e-200), {method} ({solver}): each"
    measured.within(case, error, promise, what="relative error")


@pytest.mark.parametrize("kind", [np.float32, np.float16, np.longdouble, np.int8, ">f8", object])
def test_starts_of_other_types_are_the_doubles_that_they_are(kind, field):
    start = np.array([1.1, -1.6]).astype(kind)
    same = start.astype(float)
    for method in METHODS:
        assert (integrate(method, 0.1, y0=start).y == integrate(method, 0.1, y0=same).y).all()
    assert (
        bs.ensemble("rk4", PENDULUM, h=0.1, steps=3, y0=[start], workers=1, final=True).final
        == integrate("rk4", 0.1, y0=same).y[:, -1]
    ).all()
    assert (field(start, 0.1) == field(same, 0.1)).all()
    assert bs.fields.reach(field, start, 0.1).norms == bs.fields.reach(field, same, 0.1).norms


def test_32_bits_are_not_64(measured):
    narrow, wide = (integrate("rk4", 0.1, y0=np.array([1.1, -1.6], kind)).y for kind in (np.float32, np.float64))
    error = float(abs(narrow - wide).max())
    assert 1e-9 < error < 1e-6
    measured.said(
        "pendulum from 32-bit numbers",
        "steps of the doubles that they are",
        f"as such, bit for bit; {error:.0e} from the decimals",
    )


NO_STARTS = {
    "nan": [0, math.nan],
    "∞": [0, math.inf],
    "None": [0, None],
    "text": ["a", "b"],
    "complex": [1j, 0],
    "too short": [0],
    "too deep": [[0, 1]],
    "a number": 5,
    "one text": "01",
    "a set": {0, 1},
    "10⁴⁰⁰": [10**400, 0],
    "10⁵⁰⁰⁰": [10**5000, 0],
    "masked": np.ma.array([0, 1], mask=np.array([False, True])),
}


@pytest.mark.parametrize("y0", NO_STARTS)
def test_what_is_no_start_is_refused(y0):
    for method in METHODS:
        with pytest.raises(
            bs.IntegratorError, match=r"^y0 must hold 2 finite numbers, but was |^y0\[0\] must be a number, but "
        ):
            integrate(method, 0.1, y0=NO_STARTS[y0])


def test_energies_that_overflow_are_told(measured):
    """p² is infinite for p = 1e300, and the motion is not."""
    with pytest.warns(
        RuntimeWarning, match="energy must be finite at the states that are observed, but was inf at t = 0"
    ):
        run = integrate("stormer-verlet", 0.1, y0=(1e300, 0), observe="energy")
    assert run.y[1, -1] == pytest.approx(3e299, rel=1e-15)
    with pytest.warns(RuntimeWarning, match=r"energy must be finite .*, but the mean over members was nan at t = 0"):
        bs.ensemble("rk4", PENDULUM, h=0.1, steps=3, y0=[[1e300, 0], [0, 0]], workers=1)
    measured.said(
        "pendulum, p = 1e300: the energy overflows", "warns", "“energy must be finite … but was inf at t = 0”"
    )


@pytest.mark.parametrize("q", [1e16, 1e22, 1e300])
def test_angles_of_any_size(q, measured):
    """sin is right for all doubles, so that p is; q has no digits left for what it moves.

    The force, its products with h and weights, and sums: a rounding each in sin and in every of the 3 steps, and one.
    """
    p, end = integrate("rk4", 0.1, y0=(0, q)).y[:, -1]
    assert end == q
    force = math.sin(q)
    case = f"pendulum, q = {q:g}, rk4, 3 steps of 0.1: force of the true angle"
    measured.within(case, abs(p / (-0.3 * force) - 1) * 2.0**53, 8, " · 2⁻⁵³", what="relative error")
    assert abs(math.sin(q % math.tau) / force - 1) > 0.01  # a multiple of the rounded 2π is no turn


def test_warnings_are_not_given_without_cause(field):
    """The negative control of all warnings above."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        field(POINT, 0.1)
        bs.fields.reach(field, POINT, 0.1)
        integrate("stormer-verlet", 0.1, observe="energy")
        bs.ensemble("rk4", PREDATORS, h=0.1, steps=3, y0=[[1, 1], [2, 1]], workers=1)
