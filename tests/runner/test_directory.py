"""A run directory belongs to one run; whatever else is given is refused and left as it was."""

import pytest
from command_line import without_waits
from test_resume import SLOW, wait_for

from verify.errors import InputError
from verify.runner.directory import claimed

IDENTITY = {"cases": ["a"], "options_of_result": {"repetitions": 1}}


def refused(verify, *arguments):
    done = verify("run", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert without_waits(done.stderr).count("\n") == 1
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


def test_the_lock_goes_with_the_run(tmp_path):
    with (
        claimed(tmp_path, IDENTITY),
        pytest.raises(InputError, match="another run"),
        claimed(tmp_path, IDENTITY),
    ):
        pass
    with claimed(tmp_path, IDENTITY):
        pass
