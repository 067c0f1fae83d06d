"""The set-up script: what it redoes, what it leaves alone, what it survives.

pip and the Python it runs under are a stand-in (conftest.py); a set-up with the real ones is what
continuous integration begins with.
"""

import subprocess
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


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
