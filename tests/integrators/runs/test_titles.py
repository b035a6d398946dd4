"""Names as printed in titles, and labels of axes."""

import pytest

from bseries_base.diagrams import axis_label
from integrators.runs.titles import printed_text


@pytest.mark.parametrize(
    "text",
    ["run-1.csv, h = 0.1", "/tmp/rk4/kepler.csv", "rk4.json", "my_kepler", "a on b", "t", "p on q", "", "H~ to h"],
)
def test_other_texts_are_left_alone(text):
    assert printed_text(text) == text


def test_names_in_titles():
    title = "rk4 on pendulum with damping, h = 0.1: linear drift, slope 3"
    assert printed_text(title) == "RK4 on pendulum with damping, h = 0.1: linear drift, slope 3"
    assert printed_text("modified Hamiltonian to h^12") == "modified Hamiltonian to h¹²"
    assert printed_text("gauss3 on fermi-pasta-ulam") == "Gauss 3 on Fermi–Pasta–Ulam"


@pytest.mark.parametrize("name", ["euler-flow", "strang-splitting4", "rk4-verlet", "boris3", "symplectic-gauss"])
def test_names_of_users_are_never_half_translated(name):
    assert printed_text(f"{name} on body-field") == f"{name} on body-field"


@pytest.mark.parametrize(
    ("name", "label"),
    [("p", "$p$"), ("q12", "$q_{12}$"), ("p_1", "$p_{1}$"), ("phi2", r"$\phi_{2}$"), ("px", "px"), ("$x$", "$x$")],
)
def test_labels(name, label):
    assert axis_label(name) == label


def test_labels_are_drawn():
    """matplotlib can read each of them as a formula."""
    from bseries_base.plotting import drawing

    with drawing(None, ValueError) as axes:
        for name in ("p", "theta_3", "lambda", "energy", "angular_momentum", "t"):
            axes.set(xlabel=axis_label(name), ylabel=axis_label(name, change=True))
            axes.figure.draw_without_rendering()
