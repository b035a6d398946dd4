"""Linear multistep and general linear methods as data: families, order, roots, stability, and what is refused."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest

import bseries as bs
from integrators import IntegratorError
from integrators.methods.kinds.root_conditions import on_and_outside, satisfies_root_condition

memory = bs.memory


def test_families_have_their_published_coefficients_orders_and_constants():
    """Hairer, Nørsett, Wanner I, tables III.1.1 and III.1.2 and section III.2."""
    assert [list(map(str, memory.adams_bashforth(k).beta[:-1])) for k in (2, 3, 4)] == [
        ["-1/2", "3/2"],
        ["5/12", "-4/3", "23/12"],
        ["-3/8", "37/24", "-59/24", "55/24"],
    ]
    assert list(map(str, memory.adams_moulton(3).beta)) == ["1/24", "-5/24", "19/24", "3/8"]
    assert list(map(str, memory.bdf(4).alpha)) == ["1/4", "-4/3", "3", "-4", "25/12"]
    constants = {
        memory.adams_bashforth: ["1/2", "5/12", "3/8", "251/720", "95/288"],
        memory.adams_moulton: ["-1/12", "-1/24", "-19/720", "-3/160"],
        memory.bdf: ["-1/2", "-1/3", "-1/4", "-1/5", "-1/6", "-1/7", "-1/8"],
    }
    for family, values in constants.items():
        found = [family(k) for k in range(1, len(values) + 1)]
        assert [str(method.error_constant) for method in found] == values
        extra = family is memory.adams_moulton
        assert [method.order for method in found] == [k + extra for k in range(1, len(values) + 1)]
    assert [memory.nystrom(k).order for k in (2, 3, 4)] == [2, 3, 4]
    assert [memory.milne_simpson(k).order for k in (2, 3, 4)] == [4, 4, 5]
    assert [bs.method(name).order for name in ("ab3", "am3", "bdf3", "nystrom-multistep3", "milne-simpson3")] == [
        3,
        4,
        3,
        3,
        4,
    ]


def test_zero_stability_is_decided_exactly():
    assert [memory.bdf(k).zero_stable for k in range(1, 10)] == [True] * 6 + [False] * 3
    # ρ = (ζ − 1)(ζ + 1)²: a double root on the unit circle, reported and not refused
    reported = bs.LinearMultistep([-1, -1, 1, 1], [0, 2, 2, 0])
    assert not reported.zero_stable
    assert reported.growth_parameters == ()
    # ζ − 1 times polynomials with roots within 10^−12 of the circle, inside and outside
    near = Fraction(1, 10**12)
    for root, stable in ((1 - near, True), (-1 - near, False), (-1, True)):
        assert satisfies_root_condition([Fraction(root), -1 - Fraction(root), Fraction(1)]) is stable
    # (ζ² − 6/5 ζ + 1) has roots of modulus 1 that are no roots of unity; with multiplicity two it fails
    circle = np.polynomial.polynomial.polymul([-1, 1], [5, -6, 5])
    assert satisfies_root_condition([Fraction(int(x)) for x in circle])
    twice = np.polynomial.polynomial.polymul(circle, [5, -6, 5])
    assert not satisfies_root_condition([Fraction(int(x)) for x in twice])
    # four roots r e^{±iθ}, e^{±iθ}/r so close to the circle that doubles do not tell, and r = 1 with multiplicity two
    for digits in (10, 40, 150):
        r = 1 + Fraction(1, 10**digits)
        four = [Fraction(1), -Fraction(6, 5) * (r + 1 / r), r * r + 1 / r**2 + Fraction(36, 25)]
        assert on_and_outside([*four, *four[1::-1]]) == ([], 2)
    assert [count for _, count in on_and_outside([Fraction(x, 25) for x in (25, -60, 86, -60, 25)])[0]] == [2, 2]
    # reciprocal roots 2 and 1/2 beside the circle
    assert not satisfies_root_condition([Fraction(x) for x in (1, Fraction(-5, 2), 1)])


def test_roots_and_growth_parameters():
    assert memory.bdf(2).roots == (1, pytest.approx(1 / 3))
    milne = memory.symmetric_multistep(["pi/2", "pi"])
    growth = {complex(round(m.root.real), round(m.root.imag)): m.growth for m in milne.growth_parameters}
    assert growth == {-1: pytest.approx(-5 / 3), 1j: pytest.approx(1 / 3), -1j: pytest.approx(1 / 3)}
    assert [mode.growth for mode in memory.parasitic_modes("nystrom-multistep2")] == [-1]
    assert [round(mode.growth.real, 12) for mode in memory.parasitic_modes("milne-simpson2")] == [round(-1 / 3, 12)]
    for mode in memory.symmetric_multistep(["pi/5", "3*pi/5", "pi"]).growth_parameters:  # exact entries with roots
        assert abs(mode.root) == pytest.approx(1, abs=1e-14)


def test_symmetric_methods_have_the_roots_that_are_asked_for():
    for angles in (["pi"], ["pi/3", "pi"], ["pi/4", "pi/2", "3*pi/4", "pi"]):
        for explicit in (True, False):
            method = memory.symmetric_multistep(angles, explicit=explicit)
            assert method.is_symmetric
            assert method.zero_stable
            assert method.order == method.steps + (0 if explicit else 2)
            wanted = {np.exp(s * 1j * float(mpmath.mpf(eval_angle(a)))).round(9) for a in angles for s in (1, -1)}
            found = {np.complex128(z).round(9) for z in method.roots}
            assert {abs(min(abs(w - z) for z in found)) < 1e-8 for w in wanted} == {True}
    assert not memory.bdf(2).is_symmetric


def eval_angle(text):
    """The number of a text such as 3*pi/4."""
    top, _, bottom = text.partition("/")
    factor, _, _ = top.rpartition("*pi") if "*pi" in top else ("1", "", "")
    return mpmath.pi * int(factor) / int(bottom or 1)


def sampled_angle(method, points=200_001):
    """A(α) from the root locus, by sampling: no exact polynomial."""
    z = memory.root_locus(method, points)
    z = z[np.isfinite(z) & (abs(z) > 1e-6)]
    return np.degrees(abs(np.angle(-z))).min()


def test_stability_angles():
    """Hairer, Wanner II, table V.2.1, and ten digits by ball arithmetic."""
    assert [memory.bdf(k).stability_angle for k in (1, 2)] == [90.0, 90.0]
    assert f"{memory.bdf(3).stability_angle:.10f}" == "86.0323668602"
    assert f"{memory.bdf(4).stability_angle:.10f}" == "73.3516704746"
    for k in (3, 4, 5, 6):
        assert memory.bdf(k).stability_angle == pytest.approx(sampled_angle(memory.bdf(k)), abs=1e-6)
    assert memory.adams_moulton(1).stability_angle == 90.0
    for method in (memory.bdf(7), memory.adams_moulton(2), memory.adams_bashforth(2), memory.nystrom(2)):
        assert method.stability_angle is None


def test_dahlquists_barriers():
    methods = [family(k) for family in (memory.adams_bashforth, memory.adams_moulton, memory.bdf) for k in range(1, 8)]
    methods += [family(k) for family in (memory.nystrom, memory.milne_simpson) for k in range(2, 8)]
    methods += [memory.symmetric_multistep(["pi/2"], explicit=False), memory.symmetric_multistep(["pi/2", "pi"])]
    stable = [method for method in methods if method.zero_stable]
    assert len(stable) > 20
    for method in stable:
        assert method.order <= memory.dahlquist_barrier(method.steps, explicit=method.is_explicit)
        if method.stability_angle == 90:
            assert method.order <= 2
            assert method.error_constant <= Fraction(-1, 12) or method.order == 1
    # the most accurate methods violate the barrier, and are unstable
    beyond = bs.LinearMultistep([-5, 4, 1], [2, 4, 0])
    assert (beyond.order, memory.dahlquist_barrier(2, explicit=True), beyond.zero_stable) == (3, 2, False)


def test_the_root_locus_bounds_the_stability_region():
    for method, inside, outside in ((memory.adams_bashforth(2), -0.5, -1.5), (memory.bdf(2), -1.0, 1.0)):
        for z, stable in ((inside, True), (outside, False)):
            pairs = zip(method.alpha[::-1], method.beta[::-1], strict=True)
            roots = np.roots([float(a) - z * float(b) for a, b in pairs])
            assert bool((abs(roots) < 1).all()) is stable
    assert memory.root_locus("ab2", 4001)[0] == pytest.approx(-1)  # the interval of AB2 is (−1, 0)


def test_general_linear_methods():
    half = [["1/2", "1/2"], ["1/2", "1/2"]]
    dimsim = bs.GeneralLinear([[0, 0], [2, 0]], [[1, 0], [0, 1]], [["5/4", "1/4"], ["3/4", "-1/4"]], half)
    assert (dimsim.u, dimsim.stages, dimsim.inputs, dimsim.is_explicit, dimsim.zero_stable) == (
        (1, 1),
        2,
        2,
        True,
        True,
    )
    assert [memory.bdf(k).to_general_linear().zero_stable for k in (2, 6, 7)] == [True, True, False]
    assert dimsim == bs.GeneralLinear(*(getattr(dimsim, key) for key in "AUBV"))
    assert dimsim != bs.GeneralLinear(*(getattr(dimsim, key) for key in "AUBV"), finishing=[0, 1])
    with pytest.raises(AttributeError, match="immutable"):
        dimsim.A = ()


REFUSED = {
    "alpha must sum to 0": lambda: bs.LinearMultistep([-1, 2], [1, 0]),
    "unless rescaled=True": lambda: bs.LinearMultistep([-1, 1], [2, 0]),
    "different from 0": lambda: bs.LinearMultistep([1, -2, 1], [0, 0, 0]),
    "beta must have 3 entries": lambda: bs.LinearMultistep([0, -1, 1], [1, 0]),
    "the last not zero": lambda: bs.LinearMultistep([-1, 1, 0], [1, 0, 0]),
    "must be exact": lambda: bs.LinearMultistep([-1, 1], [0.5, 0.5]),
    "digits must be left out": lambda: bs.LinearMultistep([-1, 1], [1, 0], digits=5),
    "rescaled must be True or False": lambda: bs.LinearMultistep([-1, 1], [1, 0], rescaled="yes"),
    "k must be a number of steps from 1": lambda: memory.bdf(0),
    "k must be a number of steps from 2": lambda: memory.nystrom(1),
    "angles must differ": lambda: memory.symmetric_multistep(["pi/2", "pi/2"]),
    "angles must have an entry": lambda: memory.symmetric_multistep([]),
    "V must have 1 as a simple eigenvalue, but has 0": lambda: bs.GeneralLinear([[0]], [[1]], [[1]], [[2]]),
    "as a multiple one": lambda: bs.GeneralLinear([[0]], [[1, 0]], [[1], [0]], [[1, 1], [0, 1]]),
    "finishing must have d·u ≠ 0": lambda: bs.GeneralLinear(
        [[0]], [[1, 0]], [[1], [0]], [[1, 0], [0, 0]], finishing=[0, 1]
    ),
    "U u = 1": lambda: bs.GeneralLinear([[0]], [[2]], [[1]], [[1]]),
    "U must have 1 row, but has 2": lambda: bs.GeneralLinear([[0]], [[1], [1]], [[1]], [[1]]),
    "one-step method here": lambda: bs.methods.repeat(bs.method("ab2"), 2),
}


@pytest.mark.parametrize("message", REFUSED)
def test_bad_input_is_refused_in_one_sentence(message):
    with pytest.raises(bs.errors, match=message) as refused:
        REFUSED[message]()
    assert "\n" not in str(refused.value)
    assert isinstance(refused.value, IntegratorError | bs.SeriesError)


def test_only_methods_with_memory_have_starting_procedures():
    for ask in (bs.underlying_one_step, memory.starting_procedure):
        with pytest.raises(bs.SeriesError, match="must be a method with memory"):
            ask("rk4", 3)
    with pytest.raises(bs.SeriesError, match="must be a linear multistep method"):
        memory.parasitic_modes("rk4")
    with pytest.raises(IntegratorError, match="symbols"):
        _ = bs.LinearMultistep(["a", "-1 - a", 1], [0, 1, 0], rescaled=True, parameters=["a"]).zero_stable


STORED = {
    "ab3": lambda: bs.method("ab3"),
    "momentum": lambda: bs.LinearMultistep(
        ["m", "-1 - m", 1], [0, 1, 0], rescaled=True, parameters=["m"], name="momentum", reference="B. T. Polyak, 1964"
    ),
    "golden": lambda: memory.symmetric_multistep(["2*pi/5", "4*pi/5"], explicit=False),
    "general": lambda: bs.method("bdf3").to_general_linear(),
    "two-step": lambda: bs.TwoStepRungeKutta([0, "1/3"], 0, [[0, 0], [1, 0]], [1, "1/2"], [[0] * 2] * 2, [0, "-1/2"]),
}


@pytest.mark.parametrize("name", STORED)
@pytest.mark.parametrize("suffix", ["json", "toml"])
def test_files_keep_methods_with_memory(name, suffix, tmp_path):
    stored, path = STORED[name](), tmp_path / f"method.{suffix}"
    bs.save_method(stored, path)
    read = bs.load_method(path)
    assert read == stored
    assert type(read) is type(stored)
    assert (read.name, read.reference, read.parameters) == (stored.name, stored.reference, stored.parameters)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"kind": "multistep", "alpha": [-1, 1], "beta": [1, 0]}', "kind must be one of linear-multistep, "),
        ('{"kind": "linear-multistep", "alpha": [-1, 1]}', "must have the key beta"),
        ('{"kind": "linear-multistep", "alpha": [-1, 1], "beta": [1, 0], "b": [1]}', "'b'"),
        ('{"kind": "linear-multistep", "alpha": [-1, 2], "beta": [1, 0]}', "alpha must sum to 0"),
        ('{"kind": ["linear-multistep"], "alpha": [-1, 1], "beta": [1, 0]}', "kind must be one of"),
    ],
)
def test_bad_files_are_refused(text, message, tmp_path):
    path = tmp_path / "method.json"
    path.write_text(text)
    with pytest.raises(IntegratorError, match=message):
        bs.load_method(path)
