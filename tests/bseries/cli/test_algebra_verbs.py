"""`bseries modifying` and `bseries compose`."""

import json

import pytest

import bseries as bs


def coefficients(text):
    return {term["tree"]: term["coefficient"] for term in json.loads(text)["terms"]}


def test_modifying_integrator_in_json(answer):
    data = json.loads(answer("modifying", "implicit-midpoint", "--order", "3", "--format", "json"))
    assert (data["kind"], data["order"], data["empty"]) == ("modifying", 3, "0")
    assert [term["coefficient"] for term in data["terms"]] == ["1", "0", "-1/12", "1/12"]


def test_modifying_integrator_in_the_other_formats(answer):
    table = answer("modifying", "gauss2", "--order", "5", "--nonzero")
    assert table.startswith("Modifying integrator of gauss2: trees with 1 to 5 nodes, powers h^0 to h^4")
    assert "follows the exact flow of y' = f(y)" in table
    latex = answer("modifying", "explicit-euler", "--order", "2", "--format", "latex")
    assert latex == "f + \\frac{1}{2} h\\, f'(f)\n"
    assert answer("modifying", "explicit-euler", "--order", "2", "--format", "csv").count("\n") == 3


def test_two_half_steps_of_euler_methods_are_the_midpoint_rule(answer):
    found = answer(
        "compose", "implicit-euler", "explicit-euler", "--steps", "1/2,1/2", "--order", "4", "--format", "json"
    )
    expected = bs.series(bs.method("implicit-midpoint"), 4)
    assert coefficients(found) == {str(tree): str(value) for tree, value in expected.items()}
    other = answer(
        "compose", "explicit-euler", "implicit-euler", "--steps", "1/2,1/2", "--order", "4", "--format", "json"
    )
    assert coefficients(other) != coefficients(found)
    assert coefficients(other) == coefficients(answer("series", "trapezoidal", "--order", "4", "--format", "json"))


def test_the_modified_equation_of_a_composition(answer):
    verlet = answer("modified", "stormer-verlet", "--order", "3", "--format", "json")
    steps = ("symplectic-euler-p", "symplectic-euler-q", "--steps", "1/2,1/2", "--order", "3", "--modified")
    assert coefficients(answer("compose", *steps, "--format", "json")) == coefficients(verlet)
    title = answer("compose", *steps).splitlines()[0]
    assert title.startswith("Modified equation of symplectic-euler-p (1/2 h), then symplectic-euler-q (1/2 h): trees")


def test_steps_default_to_one_each_and_may_be_symbol_free_formulas(answer):
    assert coefficients(answer("compose", "rk4", "--order", "3", "--format", "json")) == coefficients(
        answer("series", "rk4", "--order", "3", "--format", "json")
    )
    twice = coefficients(answer("compose", "explicit-euler", "explicit-euler", "--order", "2", "--format", "json"))
    assert twice == {"τ": "2", "[τ]": "1"}
    roots = coefficients(answer("compose", "rk4", "--steps", "sqrt(2)", "--order", "2", "--format", "json"))
    assert roots == {"τ": "sqrt(2)", "[τ]": "1"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("compose", "rk4", "heun2", "--steps", "1"), "steps must be as many as methods, 2, but were 1"),
        (("compose", "rk4", "--steps", "x"), r"steps\[1\]"),
        (("compose", "rk4", "strang"), "METHODs must have the same parts, but rk4 has none and strang has a, b"),
        (("compose",), "METHOD"),
        (("compose", "rk5"), "name must be a method of the catalogue"),
        (("modifying", "ros34pw2", "--order", "3"), "method must have parts of the field only, but W is none"),
        (
            ("modifying", "--A", "0,0;1,0", "--b", "1,-1"),
            "sums of the weights of custom must not be 0, to be divided by, but are",
        ),
    ],
)
def test_bad_requests_are_refused_in_one_line(run, arguments, message):
    import re

    result = run(*arguments)
    assert result.exit_code == 2
    errors = [line for line in result.stderr.splitlines() if line.startswith("bseries: error:")]
    assert len(errors) == 1
    assert re.search(message, errors[0])
