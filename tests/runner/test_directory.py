"""A run directory belongs to one run; whatever else is given is refused and left as it was."""

import pytest
from test_resume import SLOW, wait_for

from verify.errors import InputError
from verify.runner.directory import RunDirectory, claimed

IDENTITY = {"cases": ["a"], "options_of_result": {"repetitions": 1}}


def refused(verify, *arguments):
    done = verify("run", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    return done.stderr


def contents(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


def test_a_second_run_into_the_same_directory_is_refused_and_touches_nothing(verify):
    mark = verify.folder / "mark"
    command = ("square.toml", SLOW, "--out", "out")
    first = verify.start("run", *command, HANG_MARK=str(mark))
    wait_for(lambda: mark.exists() and mark.read_text(), first)
    before = contents(verify.folder / "out")
    assert "another run is writing into it" in refused(verify, *command)
    assert contents(verify.folder / "out") == before
    first.terminate()
    first.communicate(timeout=60)


def test_a_run_with_other_cases_or_options_is_refused_with_the_command_that_resumes(verify):
    verify("run", "square.toml", "--solver=fake_solvers:Instant", "--out", "out")
    before = contents(verify.folder / "out")
    other = verify.folder / "other.toml"
    other.write_text((verify.folder / "square.toml").read_text())
    said = refused(verify, "other.toml", "--solver=fake_solvers:Instant", "--out", "out")
    assert "square.toml" in said
    said = refused(verify, "square.toml", "--solver=fake_solvers:Other", "--out", "out")
    assert "repetitions" in said
    assert contents(verify.folder / "out") == before


def test_a_directory_that_is_not_a_run_is_refused(verify):
    (verify.folder / "out").mkdir()
    (verify.folder / "out/thesis.tex").write_text("precious")
    said = refused(verify, "square.toml", "--solver=fake_solvers:Instant", "--out", "out")
    assert "empty" in said
    assert [p.name for p in (verify.folder / "out").iterdir()] == ["thesis.tex"]


def test_a_run_that_died_before_its_first_word_is_started_afresh(tmp_path):
    (tmp_path / ".lock").touch()
    with claimed(tmp_path, IDENTITY) as directory:
        assert directory.root == tmp_path


def test_the_lock_goes_with_the_run(tmp_path):
    with (
        claimed(tmp_path, IDENTITY),
        pytest.raises(InputError, match="another run"),
        claimed(tmp_path, IDENTITY),
    ):
        pass
    with claimed(tmp_path, IDENTITY):
        pass


def test_a_damaged_run_file_is_said(tmp_path):
    (tmp_path / "run.json").write_text("{")
    with pytest.raises(InputError, match="not a JSON file"), claimed(tmp_path, IDENTITY):
        pass


@pytest.mark.parametrize("name", ["statics/f1", "a b", "..", ".hidden", "ünï"])
def test_every_case_has_a_folder_of_its_own_below_the_run(tmp_path, name):
    folder = RunDirectory(tmp_path).solve_folder(name, "my.module:Solver", 3)
    assert folder.resolve().parent.parent == tmp_path / "cases"
    assert folder.name == "my.module_Solver-3"
