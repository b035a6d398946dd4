"""Towers of powers and huge numbers: every reader ends at once, with a value or with a sentence."""

from __future__ import annotations

import random
import subprocess
import sys

import mpmath
import pytest
import sympy

from integrators import IntegratorError, parse_hamiltonian, parse_scene
from integrators.exact.arithmetic import substituted
from integrators.exact.expressions import decimal_text, parse_constant, parse_number
from integrators.exact.functions import as_function
from integrators.scenes.model.formulas import read_formula
from integrators.scenes.text import loads_scene

TOWERS = (
    "2" + "**-2" * 40,
    "y" + "^(1/2)" * 40,
    "2^(-" * 30 + "y" + ")" * 30,
    "1e-30" + "^-10" * 20,
    "exp(" * 6 + "y" + ")" * 6,
    "pi^-pi^pi^pi",
    "cosh(asinh(1e-4000))",
    "sin(atan(7^-999))",
    "y^(y^(y^(y^(y^(y^(y^y))))))",
    "(2^(1/2))" + "^(2^(1/2))" * 6,
)
READ = """
import sys
from integrators import IntegratorError
from integrators.exact.expressions import parse_constant, parse_number
from integrators.scenes.model.formulas import read_formula

for text in sys.stdin.read().splitlines():
    for read in (parse_constant, lambda text: parse_number(text, names="y"), lambda text: read_formula(text, "y", "f")):
        try:
            read(text)
        except IntegratorError as error:
            assert len(str(error)) < 400
print("done")
"""


def read_by_another_process(texts):
    """What hangs is killed, and fails."""
    done = subprocess.run(
        [sys.executable, "-c", READ], input="\n".join(texts), capture_output=True, text=True, timeout=300
    )
    assert done.stdout == "done\n", done.stderr


def formula(chance, depth):
    """A random formula with towers, huge and tiny numbers, and functions within functions."""
    if depth == 0 or chance.random() < 0.15:
        return chance.choice(["y", "2", "-2", "1/3", "0.1", "1e-30", "9999", "pi", "1e300", "99", "1e-4000", "0"])
    inner = [formula(chance, depth - 1) for _ in range(3)]
    kind = chance.random()
    if kind < 0.3:
        return f"({inner[0]})^{chance.choice(['', '-'])}({inner[1]})"
    if kind < 0.65:
        return f"{chance.choice(['exp', 'sin', 'atan', 'log', 'sqrt', 'cbrt', 'sinh', 'asinh', 'abs'])}({inner[0]})"
    if kind < 0.75:
        return f"max({', '.join(inner)})"
    return f"({inner[0]}{chance.choice('+-*/')}{inner[1]})"


def test_towers_are_read_or_refused():
    read_by_another_process(TOWERS)


@pytest.mark.parametrize("count", [100, pytest.param(3000, marks=pytest.mark.slow)])
def test_random_formulas_are_read_or_refused(count):
    chance = random.Random(count)
    read_by_another_process([formula(chance, chance.randint(2, 6)) for _ in range(count)])


@pytest.mark.parametrize("parameter", ["30", "1e300", "pi"])
def test_numbers_put_for_symbols_obey_the_same_bounds(parameter):
    made = parse_scene("y' = m^m^m^m^m + y", parameters="m=m")
    with pytest.raises(IntegratorError, match=r"parameters must make .* small enough, but it has a"):
        made.with_parameters(m=parameter).field  # noqa: B018
    assert parse_scene("y' = m^m^m*y", parameters="m=2").field == (16 * sympy.Symbol("y"),)


def test_odd_roots_of_negative_parameters_are_those_of_numbers():
    mu, y = sympy.symbols("mu y")
    for text in ("cbrt({0})*y", "root({0}, 5)*y", "cbrt({0})^2*y", "y + 1/cbrt({0})"):
        read = parse_scene(f"y' = {text.format('(-8)')}").field
        assert parse_scene(f"y' = {text.format('mu')}", parameters="mu=-8").field == read
    assert substituted(sympy.cbrt(mu) * y, {mu: sympy.Integer(-8)}) == -2 * y
    with pytest.raises(IntegratorError, match="real"):
        parse_scene("y' = sqrt(mu)*y", parameters="mu=-8").field  # noqa: B018


STARTS = ("log(exp(exp(exp(y))) - 5)", "sqrt(y^(y^(y^(y^y))) - 5)", "1/(exp(exp(exp(y))) - 7)")


@pytest.mark.parametrize("text", STARTS)
def test_guards_too_large_to_be_computed_pass(text):
    assert parse_scene(f"y' = {text}", start="y=30").y0[0] == 30


def test_values_of_invariants_are_bounded():
    text = 'variables = {p = 1, q = 1}\nhamiltonian = "p^2/2 + q^2"\nstart = {p = [1], q = [1]}\n'
    with pytest.raises(IntegratorError, match="invariants of scene must be defined"):
        loads_scene(text + 'invariants = {a = "sin(exp(exp(30*p)))"}')
    with pytest.raises(IntegratorError, match="invariants must be constant"):  # a moderate one is computed
        loads_scene(text + 'invariants = {a = "sin(exp(exp(p)))"}')


@pytest.mark.parametrize("text", ["sin(exp(exp(30*y)))", "y^(y^(y^(y^y)))", "exp(exp(exp(exp(y))))"])
def test_functions_in_many_digits_refuse_what_they_cannot_hold(text):
    y = sympy.Symbol("y")
    function = as_function([y], read_formula(text, "y", "f"), "mpmath")
    with pytest.raises(IntegratorError, match=r"numbers in a formula must be at most 10\^1000 in size"):
        function(mpmath.mpf(30))
    small = mpmath.mpf(1) / 100
    expected = read_formula(text, "y", "f").xreplace({y: sympy.Rational(1, 100)}).evalf(15)
    assert float(function(small)) == pytest.approx(float(expected), rel=1e-12)


LONG = "9" * 5000


def test_numbers_beyond_pythons_limit_are_ours_to_refuse_or_to_read():
    limit = sys.get_int_max_str_digits()
    tiny = parse_hamiltonian("p^2/2", start="p=1e-4000; q=0")
    assert loads_scene(tiny.to_toml()) == tiny
    assert str(tiny)
    assert parse_hamiltonian(f"p{LONG}^2/2 + p3").variables == ("p3", f"p{LONG}", "q3", f"q{LONG}")
    for text in (LONG, f"1e{LONG}", f"0.{LONG}", "1e-4001", f"y{LONG}"):
        for read in (parse_number, parse_constant):
            with pytest.raises(IntegratorError, match=r"more than 4000 digits|unknown name"):
                read(text)
    with pytest.raises(IntegratorError, match="more than 4000 digits"):
        loads_scene(f'variables = {{y = 1}}\nfield = {{y = "a*y"}}\nparameters = {{a = 0x{LONG}}}')
    for digits in (1200, 1299, 4000):
        value = parse_constant(f"1e-{digits}")
        assert parse_constant(decimal_text(value)) == value
    assert sys.get_int_max_str_digits() == limit
