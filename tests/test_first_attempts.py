"""What people try first who know other packages: it works, or the answer says what does."""

from __future__ import annotations

import linecache
import warnings
from fractions import Fraction

import numpy as np
import pytest
import sympy

import bseries as bs
from bseries.cli.options.values import DEFAULT_ORDER


def test_a_start_by_name():
    run = bs.integrate("rk4", "pendulum", h=0.1, steps=5, y0={"q": "1/2", "p": 1})
    same = bs.integrate("rk4", "pendulum", h=0.1, steps=5, y0=[1, 0.5])
    assert run.variables == ("p", "q")
    assert run.y.tolist() == same.y.tolist()
    part = bs.integrate("rk4", "kepler", h=0.1, steps=1, y0={"q": [1, 0]})
    assert part.y[:, 0].tolist() == [*bs.scene("kepler").y0[:2], 1, 0]
    for y0 in ({"x": 1}, {"q": [1, 2]}):
        with pytest.raises(bs.IntegratorError):
            bs.integrate("rk4", "pendulum", h=0.1, steps=1, y0=y0)


def test_progress_true_writes_a_line_that_ends(capsys):
    bs.integrate("rk4", "pendulum", h=0.1, steps=100, progress=True)
    shown = capsys.readouterr().err
    assert shown.startswith("\r")
    assert shown.endswith("\r100%\n")
    bs.integrate("rk4", "pendulum", h=0.1, steps=100, progress=False)
    bs.integrate("rk4", "pendulum", h=0.1, steps=100)
    assert capsys.readouterr().err == ""
    with pytest.raises(bs.IntegratorError, match="progress must be a function of two numbers, True or None, but was 1"):
        bs.integrate("rk4", "pendulum", h=0.1, steps=100, progress=1)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "order"), [("RK45", 5), ("ode45", 5), ("DOP853", 8), ("Tsit5", 5), ("RK23", 3), ("ode23", 3), ("BS3", 3)]
)
def test_methods_by_the_names_of_other_packages(name, order):
    assert bs.order_of(name) == order


@pytest.mark.parametrize("name", ["RK23", "RK45", "DOP853"])
def test_these_are_the_tableaus_of_scipy(name):
    theirs = getattr(pytest.importorskip("scipy.integrate"), name)
    ours, stages = bs.method(name).to_float(), theirs.n_stages  # type: ignore[attr-defined]
    size = tuple(map(slice, np.minimum(theirs.A.shape, stages)))
    np.testing.assert_allclose(np.array(ours.A)[size], theirs.A[size], rtol=1e-14, atol=1e-16)
    np.testing.assert_allclose(ours.b[:stages], theirs.B, rtol=1e-14)


def test_methods_that_cannot_be_here_are_answered():
    with pytest.raises(bs.IntegratorError, match=r"must be a one-step method, radau-iia3 .*, but LSODA is a multistep"):
        bs.method("LSODA")
    with pytest.raises(bs.IntegratorError, match=r"nearest are .*radau-iia\{s\}"):
        bs.method("Radau")
    assert bs.method("leapfrog") == bs.method("stormer-verlet")


def test_plain_functions_are_told_what_makes_methods_and_scenes_of_them():
    def step(f, y, h):
        return y + h * f(y)

    with pytest.raises(bs.SeriesError, match=r"method must be a method, which bs\.trace makes of a function, but was"):
        bs.order_of(step)  # type: ignore[arg-type]
    with pytest.raises(bs.IntegratorError, match=r"scene must be .*, which scene_from_function makes of a function"):
        bs.integrate("rk4", lambda y: -y, h=0.1, steps=1)  # type: ignore[arg-type]
    assert bs.order_of(bs.trace(step)) == 1
    for other in (3, None):
        with pytest.raises(bs.SeriesError, match="method must be a method such as"):
            bs.order_of(other)  # type: ignore[arg-type]
        with pytest.raises(bs.IntegratorError, match="must be a Scene or the name of one, but was"):
            bs.integrate("rk4", other, h=0.1, steps=1)  # type: ignore[arg-type]


def test_the_default_order_is_that_of_the_command():
    for make in (bs.modified_equation, bs.modifying_integrator, bs.series):
        assert make("rk4") == make("rk4", DEFAULT_ORDER)
    assert bs.modified_equation(bs.exact_flow(3)).order == 3


def test_rows_of_explicit_tableaus_may_end_at_the_diagonal():
    whole = bs.RungeKutta([[0, 0, 0], ["1/2", 0, 0], [-1, 2, 0]], ["1/6", "2/3", "1/6"])
    assert bs.RungeKutta([[], ["1/2"], [-1, 2]], ["1/6", "2/3", "1/6"]) == whole
    for rows in ([[]], [[0], ["1/2"]], [[], [1], [2]], [[], ["1/2", 0]], [["1/2"], ["1/2", "1/2"]]):
        with pytest.raises(bs.IntegratorError, match="must be square"):
            bs.RungeKutta(rows, [1] * len(rows))


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("√2", sympy.sqrt(2)),
        ("√2/2", sympy.sqrt(2) / 2),
        ("1 - √(3)/6", 1 - sympy.sqrt(3) / 6),
        ("√√16", Fraction(2)),
        ("√2^2", Fraction(2)),
        ("√(4/9)", Fraction(2, 3)),
        ("-√ 2", -sympy.sqrt(2)),
    ],
)
def test_roots_may_be_written_with_their_sign(text, value):
    assert bs.RungeKutta([[text]], [1]).A[0][0] == value


@pytest.mark.parametrize("text", ["√", "2√3", "√-2", "√(2", "√" * 200 + "2"])
def test_what_is_no_root_is_refused(text):
    with pytest.raises(bs.IntegratorError, match=r"A\[1\]\[1\] must be a formula, but"):
        bs.RungeKutta([[text]], [1])


def third(f, y, h):
    k = f(y)
    return y + h * (np.multiply(1 / 3, k) + np.divide(k, 1 / 7))


def test_warnings_point_at_the_line_of_the_user(tmp_path):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        bs.trace(third)
    lines = [linecache.getline(warning.filename, warning.lineno).strip() for warning in caught]
    assert len(lines) == 2
    assert all(line.startswith("return y + h * (np.multiply(1 / 3") for line in lines)


def test_warnings_of_files_and_partitions_point_at_the_line_of_the_user(tmp_path):
    path = tmp_path / "wrong.json"
    path.write_text('{"A": [[0]], "b": [2]}', encoding="utf-8")
    lines = []
    for call in ("bs.load_method(path)", 'bs.PartitionedRungeKutta({name: {"A": [[0]], "b": [2]} for name in "pq"})'):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            eval(call)
        lines += [warning.filename for warning in caught]
    assert lines
    assert set(lines) == {"<string>"}


def test_sentences_that_ask_have_one_mark():
    from bseries_base.errors import as_sentence

    with pytest.raises(bs.IntegratorError) as caught:
        bs.scene("keplr")
    assert as_sentence(caught.value).endswith("did you mean kepler?")
    assert as_sentence(ValueError("no")) == "no."


WAITING = {
    "ensemble": lambda **show: bs.ensemble("rk4", "pendulum", h=0.1, steps=5, y0=[[0, 1], [0, 2]], **show),
    "shadow_energy": lambda **show: bs.shadow_energy(bs.integrate("leapfrog", "pendulum", h=0.1, steps=99), **show),
    "effect_influence": lambda **show: bs.effect_influence("rk4", "pendulum", h=0.1, span=3, **show),
    "work_precision": lambda **show: bs.work_precision("rk4", "pendulum", span=3, errors=(1e-2, 1e-3), **show),
}


@pytest.mark.parametrize("name", WAITING)
def test_all_that_takes_long_takes_progress_true(capsys, name):
    WAITING[name](progress=True)
    assert capsys.readouterr().err.endswith("100%\n")
    WAITING[name](progress=False)
    assert capsys.readouterr().err == ""
