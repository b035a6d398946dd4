"""Modified Hamiltonians of functions that are only named, against those of functions with formulas."""

from __future__ import annotations

from itertools import product

import pytest
import sympy

import bseries as bs

named_hamiltonian = bs.hamiltonians.named_hamiltonian
CASES = [
    ("stormer-verlet", "p^2/2 + U(q)", {"U": "-cos(q)"}, 5),
    ("takahashi-imada", "p^2/2 + U(q)", {"U": "exp(q) - q^3"}, 5),
    ("symplectic-euler-p", "T(p) + U(q)", {"T": "p^4 - p", "U": "sin(q)"}, 4),
    ("symplectic-euler-q", "H(p, q)", {"H": "exp(p)*sin(q) + p^2*q"}, 3),
    ("implicit-midpoint", "p^2/2 + q*V(q, p)", {"V": "p^2*sin(q)"}, 3),
    ("stormer-verlet", "(p1^2 + p2^2)/2 + k*V(q1, q2)", {"V": "q1^2*q2 - cos(q2)"}, 3),
]


def derivatives(name, variables, formula, order):
    """The values of the symbols that stand for derivatives of one function."""
    for times in product(range(order + 1), repeat=len(variables)):
        n, value = sum(times), formula
        for x, k in zip(variables, times, strict=True):
            value = sympy.diff(value, x, k)
        if len(variables) == 1:
            yield name + ("'" * n if n < 4 else f"^({n})"), value
        else:
            yield f"{name}_{''.join(str(x) * k for x, k in zip(variables, times, strict=True))}".rstrip("_"), value


@pytest.mark.parametrize(("method", "text", "functions", "order"), CASES, ids=[case[1] for case in CASES])
def test_formulas_hold_for_every_function(method, text, functions, order):
    parameters = {"k": "3/2"} if "k" in text else {}
    found = named_hamiltonian(method, text, order, parameters=parameters)
    plain, values = text, {}
    for name, formula in functions.items():
        inside = text.partition(f"{name}(")[2].partition(")")[0]
        variables = sympy.symbols(inside.replace(",", " "), seq=True)
        values |= {
            sympy.Symbol(key): value for key, value in derivatives(name, variables, sympy.sympify(formula), order)
        }
        plain = plain.replace(f"{name}({inside})", f"({formula})")
    wanted = bs.modified_hamiltonian(method, bs.parse_hamiltonian(plain, parameters=parameters), order)
    assert any(found.symbolic(k) != 0 for k in range(1, order))
    for k in range(order):
        assert found.symbolic(k).free_symbols <= values.keys() | set(wanted.scene.symbols)
        gap = found.symbolic(k).subs(values) - wanted.symbolic(k)
        assert sympy.simplify(gap) == 0


def test_symplectic_euler_has_the_published_formula():
    """HLW, example IX.3.4, for H(p, q), and a wrong coefficient."""
    H_p, H_q, H_pp, H_pq, H_qq = map(sympy.Symbol, ("H_p", "H_q", "H_pp", "H_pq", "H_qq"))
    found = named_hamiltonian("symplectic-euler-p", "H(p,q)", 3)
    assert found.symbolic(1) == -H_p * H_q / 2
    right = (H_pp * H_q**2 + 4 * H_pq * H_p * H_q + H_qq * H_p**2) / 12
    assert sympy.expand(found.symbolic(2) - right) == 0
    assert sympy.expand(found.symbolic(2) - right - H_pp * H_q**2) != 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("p^2/2 - cos(q)", "text must have functions that are only named"),
        ("p^2/2 + U(q, q)", r"functions of different variables, but has U\(q, q\)"),
        ("T(p) + T(q)", "T of the same variables everywhere"),
        ("p^2/2 + U(q + 1)", "text must have functions that are only named"),
        ("p^2/2 + q_point*U(q)", "no names that end in _point"),
        ("p^2/2 + U(q) + W", "W is undefined"),
    ],
)
def test_refusals(text, message):
    with pytest.raises(bs.errors, match=message):
        named_hamiltonian("stormer-verlet", text, 3)


def test_methods_that_are_not_symplectic_are_refused():
    with pytest.raises(bs.SeriesError, match="method must be symplectic"):
        named_hamiltonian("rk4", "p^2/2 + U(q)", 6)
    with pytest.raises(bs.errors):
        named_hamiltonian("stormer-verlet", "p^2/2 + U(q)", 3)([0.0, 1.0], 0.1)
