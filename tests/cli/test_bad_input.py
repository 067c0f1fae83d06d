"""Bad input: one clear line on stderr, exit code 2, nothing left behind."""

import pytest

from verify.cli import main
from verify.scene import case_folder

PATCH = (case_folder() / "statics" / "f1_patch.toml").read_text()

MATERIAL = '[material]\nyoung = 1.0\npoisson = 0.3\nplane = "strain"\n'

BROKEN_CASES = {
    "unknown key": ("young = ", "yuong = ", "material.yuong: unknown key; did you mean 'young'?"),
    "missing material": (MATERIAL, "", "material: missing"),
    "Poisson's ratio": ("poisson = 0.3", "poisson = -1.5", "poisson: expected a number > -1, got"),
    "cut outside": ("0.3], [1.1, 0.7]", "3.0], [1.1, 3.0]", "lies outside the body"),
    "cut through itself": ("[1.1, 0.7]]", "[1.1, 0.7], [0.5, 0.9], [0.5, 0.1]]", "intersects"),
    "exact solution": ('solution = "patch"', 'solution = "pitch"', "did you mean 'patch'?"),
    "parameter of it": ("slope = ", "slop = ", "exact: 'patch' has no parameter 'slop'"),
    "solver of a check": (
        'metric = "strain_energy"',
        'metric = "strain_energy"\nsolver = "conformist"',
        "mean 'conforming'?",
    ),
}  # fmt: skip
BROKEN_MESHES = {
    "not there": (None, "geometry.file: no mesh file 'body.vtk'"),
    "not a mesh": ("a shopping list\n", "not a mesh that meshio can read"),
    "not simplicial": (
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n"
        "0 0 0 1 0 0 1 1 0 0 1 0\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n9\n",
        "not simplicial: has quad; expected triangles",
    ),
}

BROKEN_LINES = {
    "case": (["statics/f1_pach"], "no case 'statics/f1_pach'; did you mean 'statics/f1_patch'?"),
    "file": (["nowhere.toml"], "nowhere.toml: no such file; expected a case file"),
    "pattern": (["fluids/*"], "no case matches 'fluids/*'"),
    "expression": (["-k", "demo and"], "-k 'demo and': a word is missing at its end"),
    "timeout of zero": (["--timeout", "0"], "--timeout: expected a positive number, got '0'"),
    "timeout nan": (["--timeout", "nan"], "--timeout: expected a positive number, got 'nan'"),
    "no process": (["-j", "0"], "-j: expected a whole number from 1 on, got '0'"),
    "negative memory": (["--memory", "-1"], "--memory: expected"),
    "half a repetition": (["--repetitions", "1.5"], "--repetitions: expected a whole number"),
    "solver": (["--solver", "xfen"], "--solver: no solver 'xfen'; did you mean 'xfem'?"),
    "solver module": (["statics/f1_patch", "--solver", "no_module:S"], "needs 'no_module'"),
    "parameter": (
        ["statics/f1_patch", "--set", "xfem.bases=shifted"],
        "--set: xfem has no parameter 'bases'; did you mean 'basis'?",
    ),
    "cluster": (
        ["statics/f1_patch", "--cluster", "dask.json"],
        "--cluster: 'dask.json' is neither a scheduler file nor an address like tcp://host:8786",
    ),
    "both weights": (["--quick", "--heavy"], "--heavy: not allowed with argument --quick"),
    "option": (["--fast"], "unrecognized arguments: --fast"),
}


def assert_refused(code, captured, said):
    assert said in captured.err
    assert code == 2
    assert captured.err.count("\n") == 1
    assert captured.out == ""


def run_here(tmp_path, monkeypatch, *arguments):
    """Run in this process, which is quick; the exit of argparse is an exit code too."""
    monkeypatch.chdir(tmp_path)
    try:
        return main(["run", *arguments, "--out", "out"])
    except SystemExit as leaving:
        return leaving.code


@pytest.mark.parametrize("fault", BROKEN_CASES)
@pytest.mark.parametrize("command", ["run", "check"])
def test_a_broken_case_file_is_refused(tmp_path, monkeypatch, capsys, command, fault):
    old, new, said = BROKEN_CASES[fault]
    assert old in PATCH
    (tmp_path / "own.toml").write_text(PATCH.replace(old, new, 1))
    monkeypatch.chdir(tmp_path)
    options = ["--out", "out"] if command == "run" else []
    code = main([command, "own.toml", *options])
    assert_refused(code, capsys.readouterr(), said)
    assert [path.name for path in tmp_path.iterdir()] == ["own.toml"]


@pytest.mark.parametrize("fault", BROKEN_MESHES)
def test_a_broken_mesh_file_is_refused(tmp_path, monkeypatch, capsys, fault):
    content, said = BROKEN_MESHES[fault]
    rectangle = 'kind = "rectangle"\nlower = [0.0, 0.0]\nupper = [1.0, 1.0]'
    levels = "cells = [[8, 8], [16, 16]]"
    assert rectangle in PATCH
    assert levels in PATCH
    text = PATCH.replace(rectangle, 'kind = "file"\nfile = "body.vtk"')
    (tmp_path / "own.toml").write_text(text.replace(levels, 'pattern = "given"'))
    if content is not None:
        (tmp_path / "body.vtk").write_text(content)
    before = sorted(tmp_path.iterdir())
    code = run_here(tmp_path, monkeypatch, "own.toml")
    assert_refused(code, capsys.readouterr(), said)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("fault", BROKEN_LINES)
def test_a_broken_command_line_is_refused(tmp_path, monkeypatch, capsys, fault):
    arguments, said = BROKEN_LINES[fault]
    code = run_here(tmp_path, monkeypatch, *arguments)
    assert_refused(code, capsys.readouterr(), said)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("words", [["no_such_case"], ["statics/f3_inclined", "--solver", "xfen"]])
def test_a_study_that_cannot_begin_leaves_nothing_behind(tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    code = main(["study", "cost", *words, "--out", "studies"])
    assert_refused(code, capsys.readouterr(), "no ")
    assert list(tmp_path.iterdir()) == []


def test_an_expression_that_matches_nothing_is_no_error_but_nothing_ran(
    tmp_path, monkeypatch, capsys
):
    assert run_here(tmp_path, monkeypatch, "-k", "no_such_word") == 4
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_check_says_a_line_for_every_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.toml").write_text(PATCH)
    (tmp_path / "bad.toml").write_text(PATCH.replace("young", "yuong"))
    assert main(["check", "good.toml", "bad.toml", "lost.toml"]) == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("good.toml: ok (F1 patch")
    assert captured.err.count("\n") == 2


@pytest.mark.parametrize(
    "make, said",
    [
        (lambda folder: None, "not a run (it has no run.json)"),
        (lambda folder: folder.mkdir(), "not a run (it has no run.json)"),
        (lambda folder: folder.write_text("x"), "not a run (it has no run.json)"),
    ],
)
def test_report_of_what_is_no_run_is_refused(tmp_path, capsys, make, said):
    make(tmp_path / "out")
    assert_refused(main(["report", str(tmp_path / "out")]), capsys.readouterr(), said)


def test_no_command_is_a_usage_error(verify):
    done = verify()
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "see verify --help" in done.stderr
