"""The report of `check` and the command on methods with memory."""

import json

import bseries as bs


def test_check_reports_stability_and_structure_of_the_underlying_method():
    report = bs.check("nystrom-multistep2")
    assert report.order == 2
    assert report.structure["symmetric"].holds
    assert report.structure["conjugate_symplectic"].holds
    assert report.structure["symplectic"].order == 2
    assert report.stability["zero_stable"] is True
    assert report.stability["error_constant"] == "1/6"
    assert report.stability["parasitic_modes"] == "-1+0j grows with -1+0j"
    bdf = bs.check("bdf3").stability
    assert (bdf["stability_angle"][:13], bdf["a_stable"], bdf["zero_stable"]) == ("86.0323668602", False, True)
    assert bs.check("bdf7").stability["zero_stable"] is False
    assert "structure are those of the underlying one-step method" in str(bs.check("ab2"))


def test_what_is_not_decided_is_said():
    family = bs.LinearMultistep(["a", "-1 - a", 1], ["-(1 + a)/2", "(3 - a)/2", 0], parameters=["a"], name="family")
    found = bs.check(family).stability
    assert found["zero_stable"] is None
    assert "no symbols" in found["undecided"]["zero_stable"]
    assert bs.check(bs.method("ab2").to_general_linear()).stability["inputs"] == 4


def test_the_command_takes_names_and_files(run, tmp_path):
    by_name = run("modified", "ab2", "--order", "4", "--format", "json")
    bs.save_method(bs.method("ab2"), tmp_path / "mine.json")
    by_file = run("modified", str(tmp_path / "mine.json"), "--order", "4", "--format", "json")
    assert by_name.exit_code == by_file.exit_code == 0
    assert json.loads(by_name.stdout) == json.loads(by_file.stdout)
    weights = {term["tree"]: term["coefficient"] for term in json.loads(by_name.stdout)["terms"]}
    assert (weights["[τ,τ]"], weights["[[τ]]"]) == ("-5/6", "-5/12")
    checked = run("check", "bdf2", "--format", "json")
    assert json.loads(checked.stdout)["stability"]["stability_angle"] == "90"


def test_the_command_refuses_in_one_line(run, tmp_path):
    path = tmp_path / "wrong.json"
    path.write_text('{"kind": "linear-multistep", "alpha": [-1, 2], "beta": [1, 0]}')
    for arguments in (["check", str(path)], ["modified", "bdf0", "--order", "3"], ["modifying", "ab2", "--order", "3"]):
        result = run(*arguments)
        assert result.exit_code == 2, arguments
        assert len(result.stderr.strip().splitlines()) == 1
        assert "Traceback" not in result.stderr


def test_the_command_runs_multistep_methods_and_writes_their_equations(run):
    simulated = run("simulate", "pendulum", "--method", "ab2", "--step", "1/10", "--steps", "20", "--format", "json")
    assert simulated.exit_code == 0, simulated.stderr
    end = {row["what"]: row["end"] for row in json.loads(simulated.stdout)["rows"]}
    made = bs.integrate("ab2", "pendulum", h=0.1, steps=20)
    assert [end["p"], end["q"]] == list(made.y[:, -1])
    equation = run("equation", "ab2", "--scene", "pendulum", "--order", "3")
    assert equation.exit_code == 0, equation.stderr
    assert "5*p*cos(q)/12" in equation.stdout
