"""Parameters of solvers reach the solver that they are meant for."""

import json

import pytest

from verify.cli import main
from verify.cli.solver_parameters import of_one_solver, of_solvers


def test_values_are_numbers_where_they_are_json_and_text_elsewhere():
    assert of_one_solver(["a=1", "b=0.5", "c=true", "d=shifted"]) == {
        "a": 1, "b": 0.5, "c": True, "d": "shifted",
    }  # fmt: skip


def test_each_solver_gets_its_own():
    given = ["xfem.basis=shifted", "xfem.tip=inside", "my.module:Solver.order=2"]
    wanted = {"xfem": {"basis": "shifted", "tip": "inside"}, "my.module:Solver": {"order": 2}}
    assert of_solvers(given) == wanted


@pytest.mark.usefixtures("warm")
def test_a_run_solves_with_the_parameters_that_it_was_given(tmp_path, capsys):
    # one level and scheme: first order in time, which the case does not accept
    run = ["run", "dynamics/freed_half", "--solver", "xfem", "--repetitions", "1", "--no-report"]
    out = ["--out", str(tmp_path / "run"), "--json"]
    assert main([*run, *out, "--set", "xfem.scheme=implicit_euler"]) != 0
    (case,) = json.loads(capsys.readouterr().out)["cases"]
    assert case["verdict"] == "FAIL"
    assert main(["run", "dynamics/freed_half", "--set", "xfme.scheme=newmark"]) == 2
    assert "no solver 'xfme'" in capsys.readouterr().err
    assert main(["run", "statics/f1_patch", "--set", "xfem.tip=middle", *out[:2]]) == 2
    assert "xfem.tip" in capsys.readouterr().err
