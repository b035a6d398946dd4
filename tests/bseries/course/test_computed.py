"""Formulas and numbers of the course, against values from elsewhere and against each other."""

from __future__ import annotations

import json
import re
from fractions import Fraction
from pathlib import Path

import pytest

from bseries.course import computed as module
from bseries.course.computed import COMPUTED, computed, figure_data, filled, places
from bseries.course.documents import DOCUMENTS
from bseries.exceptions import SeriesError

HERE = Path(module.__file__).parent
REFERENCE = Path(__file__).parents[2] / "reference" / "lecture_values.json"


def coefficients(tex: str) -> dict[int, Fraction]:
    """The coefficients by power of h of a sum of terms h^k c y^(k+2)."""
    found = {}
    for sign, power, term in re.findall(r"([-+]?) ?(?:h(?:\^\{(\d+)\})?\\, )(.*?)(?= [-+] | \\\\|$)", tex):
        top, bottom = re.fullmatch(r"(?:\\frac\{)?(\d*) ?y\^\{\d+\}(?:\}\{(\d+)\})?", term).groups()
        found[int(power or 1)] = (-1 if sign == "-" else 1) * Fraction(int(top or 1), int(bottom or 1))
    return found


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("riccati-explicit-euler", "-1 3/2 -8/3 31/6 -157/15"),
        ("riccati-implicit-midpoint", "0 1/4 0 1/8 0 11/192 0 3/128"),
        ("riccati-rk4", "0 0 0 -1/24 0 65/576 -17/96 19/144"),
    ],
)
def test_example_1_is_that_of_the_lecture(name, expected):
    """(5), (6), (7), from power series of the flow, without trees."""
    known = {k: Fraction(text) for k, text in enumerate(expected.split(), 1)}
    assert coefficients(computed(name)) == {k: value for k, value in known.items() if value}


def test_the_reference_has_the_same_numbers():
    text = json.dumps(json.loads(REFERENCE.read_text(encoding="utf-8")))
    for number in ("157/15", "11/192", "65/576"):
        assert number in text


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("lotka-volterra-explicit-euler", ["p q - q^{2} + 3 q - 4", "p^{2} - p q + 1"]),
        ("lotka-volterra-symplectic-euler", ["p q + q^{2} - 5 q + 4", "p^{2} + p q - 4 p + 1"]),
        ("stormer-verlet-h3", [r"\frac{U_{qq} p^{2}}{12} - \frac{U_{q}^{2}}{24}"]),
        ("stormer-verlet-h5", [r"U_{qqqq} p^{4}}{720}", r"U_{qqq} U_{q} p^{2}}{120}", r"U_{qq}^{2} p^{2}}{60}"]),
        ("takahashi-imada-h3", [r"\frac{U_{q}^{2} \left(12 \alpha + 1\right)}{24}"]),
        ("takahashi-imada-h5", [r"\left(10 \alpha - 1\right)}{120}", r"\left(20 \alpha - 1\right)}{240}"]),
        ("takahashi-imada-defect", [r"- \frac{U_{qqq} U_{q}^{2} \alpha^{2}}{2}"]),
        ("stormer-verlet-brackets", [r"\frac{1}{360} \{U,\{T,\{T,\{T,U\}\}\}\}", r"- \frac{1}{480}"]),
        ("symplectic-euler-any", [r"\frac{H_{pq} H_{p} H_{q}}{3}", r"- \frac{H_{p} H_{q}}{2}"]),
        ("pendulum-midpoint", [r"- \frac{p^{2} \cos{\left(q \right)}}{24} - \frac{\sin^{2}{\left(q \right)}}{24}"]),
        ("linear-radii", ["| rk4 | $0$ | $0$ | $0$ | $-1/120$ | 1.9445 |", "| explicit-euler | $-1/2$ | $1/3$"]),
        ("trees", ["| `[τ,τ]` | $f''(f,f)$ | 3 | 2 | $1/12$ | $-1/24$ | $0$ |"]),
    ],
)
def test_formulas_of_the_corrected_lecture(name, parts):
    text = computed(name)
    for part in parts:
        assert part in text


def test_both_sides_of_19_agree_on_the_pendulum():
    assert computed("pendulum-time-mean") == computed("pendulum-space-mean") == r"-6.5429\cdot10^{-6}"


def test_a_coarse_mean_is_another_one(monkeypatch):
    """Negative control: with three points a turn the mean over time is another number."""
    monkeypatch.setattr(module, "FINE", 3)
    assert computed("pendulum-time-mean") != computed("pendulum-space-mean")


@pytest.mark.slow
def test_figure_8_and_the_means_of_19_for_atoms():
    """The ensemble, and the rates along other trajectories, tell the same; the step agrees by the law h⁴."""
    data, drifts = figure_data("lennard-jones-drift"), module.atom_drifts()
    assert abs(data.mean[-1]) < 2 * data.standard_error[-1]
    assert all(abs(s.mean) < 3 * s.error for s in drifts)
    assert sum(s.diffusion for s in drifts) > 4 * sum(s.diffusion_error**2 for s in drifts) ** 0.5
    rates = float(computed("figure-8-predicted").replace(r"\cdot10^{", "e").rstrip("}"))
    assert abs(rates / data.deviation[-1] - 1) < 0.25
    step = float(computed("figure-8-step"))
    assert abs(data.deviation[-1] * (step / data.h) ** 4 / 3.08e-6 - 1) < 0.05  # σ in the lecture
    assert computed("figure-8-members") == str(data.members)


def test_everything_computed_has_its_place_and_every_place_its_function():
    texts = [(HERE / document.source).read_text(encoding="utf-8") for document in DOCUMENTS.values()]
    assert set(places("".join(texts))) == set(COMPUTED)


def test_other_names_are_refused():
    with pytest.raises(SeriesError, match=r"must be one of .*did you mean riccati-rk4\?"):
        computed("ricati-rk4")
    assert places("${{a}}$ {{ b }} {{C}}") == ["a"]
    with pytest.raises(KeyError):
        filled("{{a}}", {})
