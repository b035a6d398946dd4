"""Steps written in Python as methods: their series are those of the tableaus, and what is no method is refused."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
import sympy

import bseries as bs

THIRD = Fraction(1, 3)


def heun(f, y, h):
    k1 = f(y)
    return y + h / 2 * (k1 + f(y + h * k1))


def rk4(f, t, y, h):
    k1 = f(t, y)
    k2 = f(t + h / 2, y + h / 2 * k1)
    k3 = f(t + h / 2, y + h / 2 * k2)
    return y + h / 6 * (k1 + 2 * k2 + 2 * k3 + f(t + h, y + h * k3))


def gauss2(f, y, h):
    s, q = sympy.sqrt(3) / 6, Fraction(1, 4)

    def stages(Y1, Y2):
        k1, k2 = f(Y1), f(Y2)
        return y + h * (q * k1 + (q - s) * k2), y + h * ((q + s) * k1 + q * k2)

    Y1, Y2 = f.solve(stages)
    return y + h * (f(Y1) + f(Y2)) / 2


def verlet(f, y, h):
    y = y + h / 2 * f.p(y)
    y = y + h * f.q(y)
    return y + h / 2 * f.p(y)


def strang(f, y, h):
    y = f.a.flow(y, h / 2)
    y = f.b.flow(y, h)
    return f.a.flow(y, h / 2)


def taylor2(f, y, h):
    return y + h * f(y) + h**2 / 2 * f.derivative(y, f(y))


def fixed_point(f, y, h):
    """Five iterations of the implicit midpoint rule, an explicit method."""
    end = y
    for _ in range(5):
        end = y + h * f((y + end) / 2)
    return end


@pytest.mark.parametrize(
    ("step", "name", "parts"),
    [
        (heun, "heun2", ()),
        (rk4, "rk4", ()),
        (gauss2, "gauss2", ()),
        (lambda f, y, h: f.solve(lambda end: y + h * f((y + end) / 2)), "implicit-midpoint", ()),
        (strang, "strang", ("a", "b")),
    ],
    ids=["heun", "rk4", "gauss2", "midpoint", "strang"],
)
def test_series_are_those_of_the_catalogue(step, name, parts):
    order = 6 if len(parts) < 2 else 5
    assert bs.modified_equation(bs.trace(step, parts=parts), order) == bs.modified_equation(name, order)


def test_partitioned_steps_are_those_of_tableaus():
    traced, known = (bs.modified_equation(m, 5) for m in (bs.trace(verlet, parts=["p", "q"]), "stormer-verlet-kdk"))
    separable = [tree for tree in known.table if all(a != b for a, b in edges(tree))]
    assert len(separable) > 20
    assert all(traced[tree] == known[tree] for tree in separable)


def edges(tree):
    """The colours at both ends of each edge."""
    stack = []
    for level, color in zip(tree.levels, tree.colors, strict=True):
        del stack[level - tree.levels[0] :]
        if stack:
            yield stack[-1], color
        stack.append(color)


def test_random_tableaus():
    random = np.random.default_rng(3)
    for _ in range(5):
        A = [[Fraction(int(x), 7) for x in random.integers(-5, 6, i)] for i in range(4)]
        b = [Fraction(int(x), 5) for x in random.integers(-5, 6, 3)]
        b.append(1 - sum(b))

        def step(f, y, h, A=A, b=b):
            slopes = []
            for row in A:
                slopes.append(f(y + h * sum(a * k for a, k in zip(row, slopes, strict=True))))
            return y + h * np.dot(np.array(b, dtype=object), slopes)

        traced = bs.trace(step)
        tableau = bs.RungeKutta([[*row, *[0] * (4 - len(row))] for row in A], b)
        assert bs.series(traced, 6) == bs.series(tableau, 6)


def test_derivatives_loops_and_stepping():
    assert bs.order_of(bs.trace(taylor2)) == 2
    assert bs.trace(taylor2).stages == 2
    midpoint = bs.series("implicit-midpoint", 5)
    iterated = bs.series(bs.trace(fixed_point), 6)
    assert all(iterated[tree] == midpoint[tree] for tree in midpoint)
    assert iterated["[[[[[τ]]]]]"] != bs.series("implicit-midpoint", 6)["[[[[[τ]]]]]"]
    ours, theirs = (bs.integrate(m, "pendulum", h=0.1, steps=50).y for m in (bs.trace(rk4), "rk4"))
    np.testing.assert_allclose(ours, theirs, rtol=1e-13)


def test_rosenbrock_steps_solve_linear_systems():
    gamma = 1 - sympy.sqrt(2) / 2

    def ros2(f, y, h):
        jacobian = f.derivative
        k1 = f.solve(lambda k: f(y) + gamma * h * jacobian(y, k), like=f(y))
        k2 = f.solve(lambda k: f(y + h * k1) - 2 * gamma * h * jacobian(y, k1) + gamma * h * jacobian(y, k), like=f(y))
        return y + h / 2 * (k1 + k2)

    assert bs.order_of(bs.trace(ros2)) == 2
    assert bs.series(bs.trace(ros2), 4) != bs.series("heun2", 4)


ZEROS = {
    "a multiple": lambda y: 0 * y,
    "a multiple with h": lambda y: y - y,
    "of a shape": lambda y: np.zeros(y.shape),
    "like": np.zeros_like,
    "a number": lambda y: 0,
}


@pytest.mark.parametrize("zero", ZEROS.values(), ids=ZEROS)
def test_sums_may_start_from_zero(zero):
    def step(f, y, h):
        point, total = zero(y), zero(y)
        for b, c in (
            (Fraction(1, 6), 0),
            (Fraction(1, 3), Fraction(1, 2)),
            (Fraction(1, 3), Fraction(1, 2)),
            (Fraction(1, 6), 1),
        ):
            k = f(y + c * h * point)
            point = zero(y) + k
            total += b * k
        return y + h * total

    assert bs.trace(step).program == bs.trace(rk4).program


def test_floats_are_the_fractions_they_stand_for():
    with pytest.warns(UserWarning, match="0.3333333333333333 is read as 1/3"):
        third = bs.trace(lambda f, y, h: y + (1 / 3) * h * f(y) + 2 * THIRD * h * f(y + 0.75 * h * f(y)))
    assert bs.modified_equation(third, 3).domain == "QQ"
    assert bs.order_of(third) == 2
    odd = bs.trace(lambda f, y, h: y + h * f(y + 0.123456789 * h * f(y)))
    assert bs.modified_equation(odd, 3).domain == "RR"


def test_names():
    assert (bs.trace(heun).name, bs.trace(heun, name="h2").name) == ("heun", "h2")
    assert bs.trace(lambda f, y, h: y + h * f(y)).name == "custom"


REFUSED = {
    "branches": (lambda f, y, h: y if f(y) > 0 else y + h * f(y), "looks at a value"),
    "equality": (lambda f, y, h: y if y == 0 else y + h * f(y), "looks at a value"),
    "residual": (lambda f, y, h: y if abs(f(y)) else y + h * f(y), "looks at a value"),
    "a function of NumPy": (lambda f, y, h: y + h * np.sin(f(y)), r"calls np\.sin on a value"),
    "a function of math": (lambda f, y, h: y + h * math.sin(y), "must run on any state, but line .* failed"),
    "no factor h": (lambda f, y, h: y + f(y), r"adds different powers of h \(y and h\^-1 k1\)"),
    "h squared": (lambda f, y, h: y + h**2 * f(y), "adds different powers of h"),
    "products": (lambda f, y, h: y + h * f(y) * f(y), "multiplies two states"),
    "powers": (lambda f, y, h: y + h * f(y) ** 2, "takes a power of a state"),
    "quotients": (lambda f, y, h: y + h * f(y) / y, "divides by a state"),
    "zero": (lambda f, y, h: y / 0, "divides by zero"),
    "zero and a number": (lambda f, y, h: y + h * f(0 * y + 1), "adds a number to a state"),
    "a point at zero": (lambda f, y, h: y + h * f(0 * y), "calls f where a value must be"),
    "ones": (lambda f, y, h: y + h * np.ones_like(y), r"calls np\.ones_like on a value"),
    "ones of a shape": (lambda f, y, h: y + h * f(y) + np.ones(y.shape), "adds a number to a state"),
    "another array in place": (lambda f, y, h: np.add(y, h * f(y), out=np.zeros(())), r"calls np\.add on a value"),
    "components": (lambda f, y, h: y + h * f(y)[0], "failed: 'Value' object is not subscriptable"),
    "a number": (lambda f, y, h: y + 1, "adds a number to a state"),
    "nothing": (lambda f, y, h: None, "must return the end of the step, y \\+ h …, but returned None"),
    "another end": (lambda f, y, h: 2 * y + h * f(y), r"must return y \+ h …, but returned 2\*y \+ k1"),
    "another argument": (lambda f, y, h: y + h * f(h), "calls f with something else than a state"),
    "a scaled point": (lambda f, y, h: y + h * f(2 * y), "calls f where a value must be"),
    "an unknown name": (lambda f, y, h: y + h * f.grad(y), r"f has derivative, flow, solve, but .* uses f\.grad"),
    "a wrong time": (lambda f, t, y, h: y + h * f(t + h, y), r"f must be called at the time of its point, t \+ \(0\)"),
    "the time itself": (lambda f, t, y, h: y + t * f(t, y), "uses t other than as an argument of f"),
    "an unknown outside f": (lambda f, y, h: f.solve(lambda Y: (Y + y) / 2 + h * f(Y)), "unknowns inside f only"),
    "two equations": (lambda f, y, h: f.solve(lambda Y: (Y, Y)), "solves for 1 unknowns with another number"),
    "arguments": (lambda y, h: y, "must take f, y, h or f, t, y, h, but took 2"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_method_is_refused(case):
    step, message = REFUSED[case]
    with pytest.raises(bs.IntegratorError, match=message):
        bs.trace(step)


def test_values_of_two_steps_do_not_mix():
    kept = []

    def keep(f, y, h):
        kept.append(f(y))
        return y + h * kept[0]

    bs.trace(keep)
    with pytest.raises(bs.IntegratorError, match="uses a value of another step"):
        bs.trace(keep)


def test_messages_quote_the_line():
    def step(f, y, h):
        k = f(y)
        if k > 0:
            return y
        return y + h * k

    with pytest.raises(bs.IntegratorError, match=r"line \d+ \(if k > 0:\) looks at a value"):
        bs.trace(step)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"step": 3}, r"step must be a function such as step\(f, y, h\), but was 3"),
        ({"step": heun, "parts": "pq"}, "parts must be a sequence of names, but was 'pq'"),
        ({"step": heun, "parts": ["flow", "p"]}, "parts must have other names than derivative, flow, solve"),
        ({"step": rk4, "parts": ["p", "q"]}, "step must take f, y, h where parts are given"),
    ],
)
def test_arguments(arguments, message):
    with pytest.raises(bs.IntegratorError, match=message):
        bs.trace(**arguments)


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (lambda f, t, y, h: y + h * f(t, y) if t == 0 else y, "uses t other than as an argument of f"),
        (lambda f, y, h: y + h ** (10**9) * f(y), "takes the power 1000000000 of h, beyond 100"),
        (lambda f, y, h: np.zeros(3) + y + h * f(y), "combines an array with a value"),
        (lambda f, y, h: y, "step must call f, but did not"),
    ],
)
def test_steps_that_would_be_misread_are_refused(step, message):
    with pytest.raises(bs.IntegratorError, match=message):
        bs.trace(step)


def test_arguments_with_any_names_are_not_counted():
    assert bs.trace(lambda f, y, h, **options: y + h * f(y)) == bs.trace(lambda f, y, h: y + h * f(y))
