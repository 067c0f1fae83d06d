"""Bad input: one clear line on stderr, exit code 2, nothing left behind."""

import pytest
from command_line import without_waits

from verify.cli import main
from verify.scene import case_folder

PATCH = (case_folder() / "statics" / "f1_patch.toml").read_text()

MATERIAL = '[material]\nyoung = 1.0\npoisson = 0.3\nplane = "strain"\n'

BROKEN_CASES = {
    "unknown key": ("young = ", "yuong = ", "material.yuong"),
    "missing material": (MATERIAL, "", "material: missing"),
    "Poisson's ratio": ("poisson = 0.3", "poisson = -1.5", "material.poisson"),
    "cut outside": ("0.3], [1.1, 0.7]", "3.0], [1.1, 3.0]", "outside"),
    "cut through itself": ("[1.1, 0.7]]", "[1.1, 0.7], [0.5, 0.9], [0.5, 0.1]]", "intersects"),
    "exact solution": ('solution = "patch"', 'solution = "pitch"', "'patch'"),
    "parameter of it": ("slope = ", "slop = ", "'slop'"),
    "solver of a check": (
        'metric = "strain_energy"',
        'metric = "strain_energy"\nsolver = "conformist"',
        "'conforming'",
    ),
}  # fmt: skip

BROKEN_LINES = {
    "case": (["statics/f1_pach"], "'statics/f1_patch'"),
    "file": (["nowhere.toml"], "nowhere.toml"),
    "pattern": (["fluids/*"], "'fluids/*'"),
    "expression": (["-k", "demo and"], "'demo and'"),
    "timeout of zero": (["--timeout", "0"], "--timeout"),
    "timeout nan": (["--timeout", "nan"], "--timeout"),
    "no process": (["-j", "0"], "-j"),
    "negative memory": (["--memory", "-1"], "--memory"),
    "half a repetition": (["--repetitions", "1.5"], "--repetitions"),
    "solver": (["--solver", "xfen"], "'xfem'"),
    "solver module": (["statics/f1_patch", "--solver", "no_module:S"], "'no_module'"),
    "parameter": (
        ["statics/f1_patch", "--set", "xfem.bases=shifted"],
        "'basis'",
    ),
    "cluster": (
        ["statics/f1_patch", "--cluster", "dask.json"],
        "'dask.json'",
    ),
    "both weights": (["--quick", "--heavy"], "--heavy"),
    "option": (["--fast"], "--fast"),
    "misspelt option": (["--repetition", "1", "--solvr=xfem"], "did you mean '--solver'?"),
}


def assert_refused(code, captured, said):
    assert said in captured.err
    assert code == 2
    assert without_waits(captured.err).count("\n") == 1
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


@pytest.mark.parametrize("fault", BROKEN_LINES)
def test_a_broken_command_line_is_refused(tmp_path, monkeypatch, capsys, fault):
    arguments, said = BROKEN_LINES[fault]
    code = run_here(tmp_path, monkeypatch, *arguments)
    assert_refused(code, capsys.readouterr(), said)
    assert list(tmp_path.iterdir()) == []


def test_check_says_a_line_for_every_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.toml").write_text(PATCH)
    (tmp_path / "bad.toml").write_text(PATCH.replace("young", "yuong"))
    assert main(["check", "good.toml", "bad.toml", "lost.toml"]) == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("good.toml: ok (F1 patch")
    assert without_waits(captured.err).count("\n") == 2
