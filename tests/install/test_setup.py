"""Setting up: an interpreter, the lock, make, the doctor, packages of the system."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from verify import doctor

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


def test_a_terminal_shows_how_far_the_set_up_has_come_and_a_log_does_not(checkout):
    place, environment = checkout
    exit_code = 7  # it comes through
    of_terminal, seen = os.openpty()
    environment |= {"STAND_IN_PIP_SECONDS": "1.5", "STAND_IN_PIP_EXIT": str(exit_code)}
    environment.pop("CI", None)
    done = subprocess.run([place / ".ci/setup"], env=environment, stdin=seen, stdout=seen,
                          stderr=seen, timeout=120)  # fmt: skip
    os.close(seen)
    shown = b""
    with suppress(OSError):  # what ends a terminal whose other end is closed
        while read := os.read(of_terminal, 4096):
            shown += read
    os.close(of_terminal)
    assert done.returncode == exit_code
    lines = (ROOT / ".ci/requirements.lock").read_text().splitlines()
    count = sum("==" in line for line in lines)
    assert f"2 of {count} fetched".encode() in shown
    assert f"1 of {count} installed".encode() in shown
    assert b"fetched" not in set_up(checkout, STAND_IN_PIP_SECONDS=0).stdout.encode()


def test_a_second_setup_is_silent_and_installs_only_what_has_changed(checkout):
    place, _ = checkout
    set_up(checkout)
    again = set_up(checkout)
    assert (again.returncode, again.stdout) == (0, "")
    assert len(pip_calls(checkout)) == 2
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


def test_an_environment_of_another_clone_is_used_and_never_removed(checkout):
    """Same packages: the project is installed from there. Others: refused, nothing is touched."""
    place, environment = checkout
    second, shared = place.parent / "second", place / ".venv"
    shutil.copytree(place, second)
    assert set_up(checkout).returncode == 0
    for one, calls in ((second, 3), (second, 3), (place, 4)):
        done = set_up((one, environment), VERIFY_VENV=shared)
        assert done.returncode == 0, done.stderr
        assert "removing" not in done.stdout
        assert len(pip_calls(checkout)) == calls
        assert f"--editable {one}" in pip_calls(checkout)[-1]
    (second / ".ci/requirements.lock").open("a").write("\n# changed\n")
    for stamp in ((shared / "ready").read_text(), "", None):
        if stamp is None:
            (shared / "ready").unlink()
        else:
            (shared / "ready").write_text(stamp)
        refused = set_up((second, environment), VERIFY_VENV=shared)
        assert refused.returncode == 2
        assert f"{shared} belongs to {place}" in refused.stderr
        assert (shared / "bin/python").exists()
    shutil.rmtree(place / ".ci")  # a clone that is gone has no more use of it
    assert set_up((second, environment), VERIFY_VENV=shared).returncode == 0


# Runs the code that it is given under the real Python, which now says that it is another one.
PRETENDER = """#!/bin/bash
exec {python} -c 'import sys
sys.version_info = {version}
code = sys.argv[2]
sys.argv = ["-c", *sys.argv[3:]]
exec(code)' "$@"
"""
REFUSING_SHIM = "#!/bin/sh\necho 'shim: python3.12: command not found' >&2\nexit 127\n"


def test_older_python3_and_refusing_shims_are_passed_over(root, tmp_path):
    for name, text in (
        ("python3", PRETENDER.format(python=sys.executable, version=(3, 11, 7))),
        *((f"python3.{minor}", REFUSING_SHIM) for minor in (12, 13, 14)),
        ("python", f'#!/bin/sh\nexec {sys.executable} "$@"\n'),
    ):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    path = {"PATH": f"{tmp_path}:/usr/bin:/bin", "HOME": str(tmp_path)}
    command = [root / ".ci/find-python"]
    found = subprocess.run(command, env=path, capture_output=True, text=True, timeout=60)
    assert found.returncode == 0, found.stderr
    version = subprocess.check_output(
        [found.stdout.strip(), "-c", "import sys; print(sys.version_info[:2] >= (3, 12))"]
    )
    assert version.strip() == b"True"


# Stands for pytest: an exit code for the claims about time, another for the rest; kernels compile.
PYTEST = """#!/bin/bash
case "$*" in
    *'verify doctor --compile') exit 0 ;;
    *'-m timing and not heavy'*) exit {timed} ;;
    *'-m not timing and not heavy'*) exit {rest} ;;
esac
exit 99
"""


def make(checkout, *arguments):
    place, environment = checkout
    return subprocess.run(
        ["make", *arguments], cwd=place, env=environment, capture_output=True, text=True, timeout=60
    )


@pytest.mark.parametrize(("timed", "rest"), [(0, 1), (1, 0)])
def test_no_claim_about_time_decides_make_test(checkout, timed, rest):
    place, _ = checkout
    (place / ".ci/setup").write_text("#!/bin/sh\n")
    python = place / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text(PYTEST.format(timed=timed, rest=rest))
    python.chmod(0o755)
    assert (make(checkout, "test").returncode == 0) is (rest == 0)
    assert (make(checkout, "bench").returncode == 0) is (timed == 0)


def test_all_that_a_full_run_needs_works_here():
    done = subprocess.run(
        [sys.executable, "-m", "verify", "doctor", "--json"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    found = {entry["name"]: entry for entry in json.loads(done.stdout)}
    assert done.returncode == 0, done.stdout
    assert "mumps" in found["PETSc"]["found"]
    assert "gamg" in found["PETSc"]["found"]
    assert {"DOLFINx", "gmsh", "off-screen VTK", "DOLFINx forms", "numba"} <= set(found)


@pytest.fixture(scope="module")
def requirements():
    place = ROOT / ".ci/system_requirements.py"
    specification = importlib.util.spec_from_file_location("system_requirements", place)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_the_doctor_the_set_up_and_the_guide_name_the_same_packages(requirements, tmp_path):
    libraries = requirements.LIBRARIES
    assert {name: p for name, (p, _) in libraries.items()} == doctor.DEBIAN_PACKAGES
    packages = {package for package, _ in libraries.values()} | {"gcc", "libc6-dev"}
    guide = (ROOT / "docs/guide/install.md").read_text()
    assert f"\n{requirements.apt_line(packages)}\n" in guide

    def load(library):
        if library in ("libGLU.so.1", "libEGL.so.1"):
            raise OSError(library)

    (tmp_path / "Python.h").touch()
    lacking = requirements.missing(
        load=load, which=lambda _: "/opt/cc", include=tmp_path, has_module=lambda _: True
    )
    assert requirements.apt_line(lacking) == (
        "apt-get install -y --no-install-recommends libegl1 libglu1-mesa"
    )
