"""The set-up script: what it redoes, what it leaves alone, what it survives.

pip and the Python it runs under are a stand-in (conftest.py); a set-up with the real ones is what
continuous integration begins with.
"""

import re
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
APT_LINE = "apt-get install -y --no-install-recommends libegl1"


def set_up(checkout, *arguments, **changes):
    place, environment = checkout
    return subprocess.run(
        [place / ".ci/setup", *arguments],
        env=environment | {key: str(value) for key, value in changes.items()},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
    )


def pip_calls(checkout):
    log = Path(checkout[1]["STAND_IN_LOG"])
    return log.read_text().splitlines() if log.exists() else []


def installed_lock(checkout):
    return (checkout[0] / ".venv/requirements.lock").read_text()


def test_setup_installs_the_hashed_lock_and_then_the_project(checkout):
    done = set_up(checkout)
    assert done.returncode == 0, done.stderr
    locked, project = pip_calls(checkout)
    assert "--require-hashes -r " in locked
    assert "--only-binary :all:" in locked
    assert installed_lock(checkout) == (ROOT / ".ci/requirements.lock").read_text()
    assert "--no-deps --no-build-isolation --editable" in project


def test_second_setup_installs_nothing_and_is_silent(checkout):
    set_up(checkout)
    begin = time.perf_counter()
    again = set_up(checkout)
    seconds = time.perf_counter() - begin
    assert (again.returncode, again.stdout) == (0, "")
    assert len(pip_calls(checkout)) == 2
    assert seconds < 5  # what the project promises; about 0.03 s on an idle machine


def test_interrupted_setup_is_begun_again(checkout):
    broken = set_up(checkout, STAND_IN_PIP_EXIT=7)
    assert broken.returncode == 7
    recovered = set_up(checkout)
    assert recovered.returncode == 0, recovered.stderr
    assert "removing the unfinished" in recovered.stdout


def test_changed_lock_rebuilds_and_changed_project_file_reinstalls_only_the_project(checkout):
    place, _ = checkout
    set_up(checkout)
    (place / "pyproject.toml").open("a").write("\n# changed\n")
    assert set_up(checkout).returncode == 0
    assert [("--editable" in call) for call in pip_calls(checkout)] == [False, True, True]
    (place / ".ci/requirements.lock").open("a").write("\n# changed\n")
    assert set_up(checkout).returncode == 0
    assert [("--editable" in call) for call in pip_calls(checkout)[3:]] == [False, True]


def test_directory_that_is_no_environment_is_never_removed(checkout):
    place, _ = checkout
    precious = place / ".venv" / "thesis.tex"
    precious.parent.mkdir()
    precious.write_text("years of work")
    refused = set_up(checkout)
    assert refused.returncode == 2
    assert "environment" in refused.stderr
    assert precious.read_text() == "years of work"


def test_system_dolfinx_takes_the_lock_without_dolfinx_and_a_gmsh_that_is_there(checkout):
    assert set_up(checkout, DOLFINX="system").returncode == 0
    full = (ROOT / ".ci/requirements-system-dolfinx.lock").read_text()
    # The stand-in has every module that it is asked for, so gmsh too.
    (gmsh,) = re.findall(r"^gmsh==.*\n(?: .*\n)+", full, re.MULTILINE)
    assert installed_lock(checkout) == full.replace(gmsh, "")


@pytest.mark.parametrize(
    ("arguments", "changes", "message"),
    [
        (["--force"], {}, "unknown argument --force"),
        ([], {"DOLFINX": "yes"}, "DOLFINX=yes: expected wheel"),
        ([], {"VERIFY_PYTHON": "/nowhere/python"}, "VERIFY_PYTHON=/nowhere/python"),
    ],
)
def test_wrong_use_is_one_line_and_leaves_nothing_behind(checkout, arguments, changes, message):
    refused = set_up(checkout, *arguments, **changes)
    assert refused.returncode == 2
    assert message in refused.stderr
    assert refused.stderr.count("\n") == 1
    assert not (checkout[0] / ".venv").exists()


def test_check_names_the_apt_line_and_changes_nothing(checkout, tmp_path):
    (tmp_path / "lacks").write_text(f"libEGL.so.1 is missing\n{APT_LINE}\n")
    stopped = set_up(checkout, "--check", STAND_IN_LACKS=tmp_path / "lacks")
    assert stopped.returncode == 1
    assert stopped.stderr.splitlines()[-1] == f"setup: {APT_LINE}"
    assert not (checkout[0] / ".venv").exists()


@pytest.fixture
def user(checkout, tmp_path):
    """Return a function that sets who runs the set-up, on a machine with a recording apt-get."""
    place, environment = checkout
    programs = tmp_path / "programs"
    programs.mkdir()

    def become(number, apt_exit=0):
        lines = {
            "id": f"echo {number}",
            "apt-get": f'echo "$*" >>{tmp_path}/apt.log; rm -f {tmp_path}/lacks; exit {apt_exit}',
        }
        for name, line in lines.items():
            (programs / name).write_text(f"#!/bin/bash\n{line}\n")
            (programs / name).chmod(0o755)
        environment["PATH"] = f"{programs}:{environment['PATH']}"
        (tmp_path / "lacks").write_text(f"libEGL.so.1 is missing\n{APT_LINE}\n")
        return place, environment | {"STAND_IN_LACKS": str(tmp_path / "lacks")}

    return become


def test_missing_library_stops_a_plain_user_with_the_line_to_run(user, tmp_path):
    stopped = set_up(user(1000))
    assert stopped.returncode == 1
    assert stopped.stderr.splitlines()[-1] == (
        f"setup: run:  sudo apt-get update && sudo {APT_LINE}"
    )
    assert not (tmp_path / "apt.log").exists()


@pytest.mark.timing
@pytest.mark.skipif(
    Path(sys.prefix) != ROOT / ".venv", reason="another environment than the project's own"
)
def test_the_projects_own_environment_is_found_ready_in_under_a_second():
    begin = time.perf_counter()
    done = subprocess.run([ROOT / ".ci/setup"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "")
    assert time.perf_counter() - begin < 1
