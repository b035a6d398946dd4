"""Scenes from one line of text."""

from __future__ import annotations

import pytest
import sympy

from integrators import IntegratorError, Scene, parse_hamiltonian, parse_scene

PENDULUM = Scene({"p": 1, "q": 1}, field={"p": "-sin(q)", "q": "p"})
LORENZ = {"x": "sigma*(y - x)", "y": "x*(rho - z) - y", "z": "x*y - beta*z"}
NUMBERS = {"sigma": 10, "rho": 28, "beta": sympy.Rational(8, 3)}


@pytest.mark.parametrize(
    "text",
    [
        "p' = -sin(q); q' = p",
        "p'=-sin(q)\nq'=p\n",
        "\n p’ = -sin(q) ;; q′ = p ;",
        "dp/dt = -sin(q); d q / d t = p",
    ],
)
def test_equations_are_written_in_several_ways(text):
    assert parse_scene(text) == PENDULUM


def test_equations_text_and_sympy_give_equal_scenes():
    text = "; ".join(f"{name}' = {formula}" for name, formula in LORENZ.items())
    expected = Scene(
        {"y": ["x", "y", "z"]}, field=LORENZ, parameters=NUMBERS, start={"y": [1, 2, "1/2"]}, name="lorenz"
    )
    by_text = parse_scene(text, parameters="sigma=10; rho=28; beta=8/3", start="x=1; z=1/2; y=2", name="lorenz")
    by_mapping = parse_scene(text, parameters=NUMBERS, start={"y": [1, 2, 0.5]})
    assert by_text == by_mapping == expected
    assert by_text.name == "lorenz"
    x, y, z, sigma, rho, beta = sympy.symbols("x y z sigma rho beta")
    field = {x: sigma * (y - x), y: x * (rho - z) - y, z: x * y - beta * z}
    assert by_text.with_start(y=[1, 1, 1]) == Scene(
        {"y": ["x", "y", "z"]}, field=field, parameters=NUMBERS, start={"y": [1, 1, 1]}
    )


@pytest.mark.parametrize(
    ("text", "sizes"),
    [
        ("y' = y^2", {"y": 1}),
        ("x' = x", {"x": 1}),
        ("u' = v; v' = -u", {"y": ["u", "v"]}),
        ("y2' = y1; y1' = y2", {"y": ["y2", "y1"]}),
        ("y1' = y2; y2' = y1", {"y": 2}),
        ("q' = p; p' = -q", {"q": 1, "p": 1}),
        ("p1' = 1; q1' = 2; p2' = 3; q2' = 4", {"p": 2, "q": 2}),
        ("px' = 1; py' = 2; qx' = 3; qy' = 4", {"p": ["px", "py"], "q": ["qx", "qy"]}),
        ("p' = q; q' = p; r' = 1", {"y": ["p", "q", "r"]}),
        ("q1' = 1; q2' = 2", {"q": 2}),
        ("p' = t; t' = 1; q' = p", {"p": 1, "t": 1, "q": 1}),
        ("t' = 1", {"t": 1}),
    ],
)
def test_blocks_are_found_by_name(text, sizes):
    found = {block.name: block.size for block in parse_scene(text).blocks}
    assert found == sizes
    assert list(found) == list(sizes)


def test_blocks_may_be_given():
    for blocks in ("p=x,u; q=y", {"p": ["x", "u"], "q": ["y"]}):
        scene = parse_scene("x' = y; y' = u; u' = x", blocks=blocks)
        assert scene.variables == ("x", "u", "y")
        assert str(scene.field) == "(y, x, u)"
    assert parse_scene("p1' = q1; q1' = p1; p2' = 0; q2' = 1", {"p": 2, "q": 2}).variables == ("p1", "p2", "q1", "q2")


def test_the_time_needs_no_equation():
    scene = parse_scene("x' = cos(t)", start="x=1")
    assert scene.variables == ("x", "t")
    assert scene.start == (1, 0)
    assert parse_scene("x' = cos(t)", start="x=1; t=2").start == (1, 2)


def test_values_may_be_lists_formulas_and_symbols():
    scene = parse_scene("x' = k*y; y' = m1*x", parameters="k=k; m=root(8, 3),2", start="y=pi,1e-2")
    assert str(scene.field) == "(k*y, 2*x)"
    assert scene.start == (sympy.pi, sympy.Rational(1, 100))


BAD = {
    "second order": ("q'' = -q", {}, "of first order, but one was \"q'' = -q\": write q' = v; v' = -q with a name v"),
    "third order": ("q''' = -q", {}, "write q' = v; v'' = -q"),
    "no derivative": ("x = 1", {}, "must have the form x' = … or dx/dt = …, but one was 'x = 1'"),
    "comparison": ("x' == 1", {}, "must have the form"),
    "no sign": ("x' 1", {}, "must have the form"),
    "two signs": ("x' = 1 = 2", {}, "field.x must be a formula, but '1 = 2' has '='"),
    "nothing": (" ;\n ", {}, "but there were none"),
    "no text": (3, {}, "equations must be text, but was 3"),
    "no formula": ("x' =", {}, "field.x must be a formula, but '' ends where"),
    "double": ("x' = 1; y' = 2; x' = 3", {}, "must be one for each variable, but x had two"),
    "missing": ("x' = y", {}, "y is undefined: it has neither an equation nor a value in parameters"),
    "number as name": ("1x' = 2", {}, "variables must be letters, digits and _"),
    "function as name": ("sin' = 2", {}, "not name a function, but one was 'sin'"),
    "function": ("x' = Abs(x)", {}, "must have functions of .* only, but has 'Abs'"),
    "times": ("x' = x(1 - x)", {}, r"has '\(' where an operator is expected"),
    "infinite": ("x' = oo", {}, "is not finite"),
    "code": ("x' = __import__('os')", {}, "os is undefined: it has neither an equation nor"),
    "parameters": ("x' = k", {"parameters": "k"}, "parameters must be as in \"a=1; b=2\", but had 'k'"),
    "two values": ("x' = k", {"parameters": "k=1; k=2"}, "but had 'k=2'"),
    "parameter 3": ("x' = k", {"parameters": 3}, "parameters must be a mapping or text, but was 3"),
    "parameter x": ("x' = x", {"parameters": "x=3"}, "x stands for a variable of the block x and the parameter x"),
    "start": ("x' = y; y' = x", {"start": "x=1"}, "start must have values for x, y, but has none for y"),
    "start of z": (
        "x' = y; y' = x",
        {"start": "x=1; y=2; z=3"},
        "start must have values for y, x, but has some for 'z'",
    ),
    "short start": ("x' = y; z' = x; y' = 1", {"start": "y=1,2"}, "has none for x|as many values"),
    "blocks": ("x' = y; y' = x", {"blocks": "p=x"}, "blocks must hold every variable, but y was in none"),
    "blocks of z": ("x' = y; y' = x", {"blocks": "p=x; q=y,z"}, "an equation for every variable, but has none for z"),
    "twice in blocks": ("x' = y; y' = x", {"blocks": "p=x; q=y,x"}, "x stands for a variable of the block p and"),
    "blocks 3": ("x' = y; y' = x", {"blocks": 3}, "blocks must be a mapping or text, but was 3"),
    "name": ("x' = x", {"name": 3}, "name must be text, but was 3"),
}


@pytest.mark.parametrize(("text", "arguments", "message"), BAD.values(), ids=BAD)
def test_bad_equations_are_refused_in_one_sentence(text, arguments, message):
    with pytest.raises(IntegratorError, match=message):
        parse_scene(text, **arguments)


@pytest.mark.parametrize(
    ("text", "sizes"),
    [
        ("p^2/2 - cos(q)", {"p": 1, "q": 1}),
        ("p^2/2", {"p": 1, "q": 1}),
        ("p1^2 + q10 + q2", {"p": ["p1", "p2", "p10"], "q": ["q1", "q2", "q10"]}),
        ("p1*p2 + q3", {"p": 3, "q": 3}),
        ("px^2 + py^2 - 1/sqrt(qx^2 + qy^2)", {"p": ["px", "py"], "q": ["qx", "qy"]}),
        ("px1*py1 + qx2*qy2", {"p": [2, 2], "q": [2, 2]}),
        ("v^2/2 + x^4/4", {"v": 1, "x": 1}),
        ("omega1^2 + omega2^2 - cos(theta1 - theta2)", {"omega": 2, "theta": 2}),
        ("p_r^2 + q_phi", {"p": ["p_phi", "p_r"], "q": ["q_phi", "q_r"]}),
    ],
)
def test_momenta_and_positions_are_found_by_name(text, sizes):
    found = parse_hamiltonian(text)
    assert {block.name: block.size for block in found.blocks} == sizes
    assert found == Scene(sizes, hamiltonian=text)


def test_hamiltonians_with_blocks_parameters_and_start_values():
    for blocks in ("p=L; q=theta", {"p": ["L"], "q": ["theta"]}):
        scene = parse_hamiltonian("L^2/(2*m) - g*cos(theta)", blocks, "m=2; g=9.81", "L=0; theta=pi/3", "rod")
        expected = Scene(
            {"p": ["L"], "q": ["theta"]},
            hamiltonian="L^2/(2*m) - g*cos(theta)",
            parameters={"m": 2, "g": 9.81},
            start={"p": 0, "q": "pi/3"},
        )
        assert scene == expected
        assert scene.name == "rod"
    assert parse_hamiltonian("p*cos(t)").notes


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        ("x^2/2", {}, "must have names such as p, q, p1, qx, or a pair such as v, x, or blocks must be given"),
        ("1", {}, "must have names such as p"),
        ("v1^2/2 + x2^2/2", {}, "must have names such as p"),
        ("p_r^2/2 + r", {}, "r is undefined: it has neither a place in blocks nor a value in parameters"),
        ("psi^2/2 + p", {}, "psi is undefined: it has neither a place in blocks nor a value in parameters"),
        ("x + y", {"blocks": "p=x; q=z"}, "y is undefined: it has neither a place in blocks"),
        ("x", {"blocks": "p=x; q=z,y"}, "must have a block of momenta and one of positions of equal size"),
        ("x^2 + y^2", {"blocks": "x=x; y=y"}, "told apart by their names: p and q, .* but had x of 1, y of 1"),
        ("p + ", {}, "hamiltonian must be a formula, but"),
        (3, {}, "hamiltonian must be text, but was 3"),
        ("p", {"start": "p=1"}, "start must have values for p, q, but has none for q"),
    ],
)
def test_bad_hamiltonians_are_refused_in_one_sentence(text, arguments, message):
    with pytest.raises(IntegratorError, match=message):
        parse_hamiltonian(text, **arguments)
