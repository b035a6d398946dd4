"""The option --plot of verbs whose results have a picture."""

from __future__ import annotations

import pytest

pytest.importorskip("matplotlib")

RUN = ("--method", "stormer-verlet", "--step", "0.1")
VERBS = {
    "check": ("check", "rk4"),
    "drift": ("drift", "rk4", "--scene", "pendulum", "--start", "p=5/2;q=0", "--step", "0.1"),
    "effects": ("effects", "kepler", "--method", "rk4", "--step", "0.02", "--span", "1", "--effect", "drag"),
    "effect-costs": ("effects", "kepler", "--method", "rk4", "--step", "0.02", "--effect", "drag"),
    "ensemble": ("simulate", "pendulum", *RUN, "--steps", "50", "--ensemble", "4", "--spread", "0.1"),
    "hamiltonian": ("hamiltonian", "symplectic-euler-p", "--scene", "pendulum", "--order", "3", "--step", "0.2"),
    "methods": ("methods", "gauss2"),
    "run": ("simulate", "pendulum", *RUN, "--steps", "5000"),
    "run-without-energy": ("simulate", "lorenz", "--method", "rk4", "--step", "0.01", "--steps", "5000"),
    "trees": ("trees", "--order", "4"),
}


@pytest.mark.few(3)
@pytest.mark.parametrize("verb", VERBS)
def test_a_picture_is_written_beside_the_answer(verb, answer, tmp_path):
    path = tmp_path / "plot.pdf"
    with_picture = answer(*VERBS[verb], "--plot", str(path))
    assert path.read_bytes().startswith(b"%PDF")
    assert b"/Type3" not in path.read_bytes()
    assert with_picture.splitlines()[0]


def test_a_modified_energy_beyond_its_reach_is_drawn_with_a_warning(run, tmp_path):
    path, verb = str(tmp_path / "levels.png"), ("hamiltonian", "stormer-verlet", "--scene", "pendulum", "--order", "9")
    found = run(*verb, "--step", "1.7", "--plot", path)
    assert found.exit_code == 0
    assert found.stderr.startswith(
        "bseries: warning: the modified Hamiltonian of stormer-verlet-kdk on pendulum is worse"
    )
    assert found.stderr.count("\n") == 1
    assert run(*verb, "--step", "0.2", "--plot", path).stderr == ""


def test_formats_follow_the_suffix(answer, tmp_path):
    for suffix, beginning in (("png", b"\x89PNG"), ("svg", b"<?xml"), ("PDF", b"%PDF")):
        path = tmp_path / f"trees.{suffix}"
        answer("trees", "--order", "3", "--plot", str(path))
        assert path.read_bytes().startswith(beginning)


def test_pictures_do_not_change_the_answer(answer, tmp_path):
    plain = answer("check", "gauss2")
    assert answer("check", "gauss2", "--plot", str(tmp_path / "region.svg")) == plain


def test_a_run_is_drawn_at_a_thousand_times(answer, tmp_path, monkeypatch):
    import bseries as bs

    counts = []
    plot = bs.Trajectory.plot
    monkeypatch.setattr(bs.Trajectory, "plot", lambda run, **options: counts.append(len(run.t)) or plot(run, **options))
    answer(*VERBS["run-without-energy"], "--plot", str(tmp_path / "lorenz.png"))
    assert counts == [1001]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ("check", "rk4", "--plot", "a.gif"),
            "must be one of png, svg, pdf, but was 'gif'",
        ),
        (("check", "rk4", "--plot", "no/a.png"), "plot must be a file in a folder that is there, but was 'no/a.png'"),
        (("check", "strang", "--plot", "a.png"), "method must be a RungeKutta, but was <Splitting strang"),
        (("methods", "--plot", "a.png"), "METHOD must be given with --plot, but was not"),
        (("trees", "--count", "--plot", "a.png"), "count must be left out with --plot"),
        (("trees", "--order", "12", "--plot", "a.png"), "trees must be at most 2000 in one picture, but are more"),
        (("drift", "rk4", "--scene", "pendulum", "--plot", "a.png"), "step must be given with --plot"),
        (
            ("hamiltonian", "strang", "--scene", "pendulum", "--plot", "a.png"),
            "plot must come with --step, and without --brackets and --verdict",
        ),
        (
            ("hamiltonian", "strang", "--brackets", "--step", "1", "--plot", "a.png"),
            "plot must come with --step, and without --brackets and --verdict",
        ),
    ],
)
def test_refusals(run, arguments, sentence, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert result.exit_code == 2
    assert sentence in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())
