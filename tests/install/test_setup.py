"""Setting up: an interpreter, the lock, make, the doctor, packages of the system."""

import importlib.util
import json
import subprocess
import sys
import time
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


# Runs the code that it is given under the real Python, which now says that it is another one.
PRETENDER = """#!/bin/bash
exec {python} -c 'import sys
sys.version_info = {version}
code = sys.argv[2]
sys.argv = ["-c", *sys.argv[3:]]
exec(code)' "$@"
"""
REFUSING_SHIM = "#!/bin/sh\necho 'shim: python3.12: command not found' >&2\nexit 127\n"


@pytest.fixture
def programs(tmp_path):
    """Return a function that puts a program at the front of PATH, and that PATH."""
    directory = tmp_path / "bin"
    directory.mkdir()

    def put(name, text):
        (directory / name).write_text(text)
        (directory / name).chmod(0o755)
        return directory / name

    return put, f"{directory}:/usr/bin:/bin"


def find_python(root, path, home, **changes):
    return subprocess.run(
        [root / ".ci/find-python"],
        env={"PATH": path, "HOME": str(home)} | changes,
        capture_output=True,
        text=True,
        timeout=60,
    )


def pretender(version):
    return PRETENDER.format(python=sys.executable, version=version)


def passing_on_to_this_python():
    return f'#!/bin/sh\nexec {sys.executable} "$@"\n'


def test_older_python3_and_refusing_shims_are_passed_over(root, tmp_path, programs):
    put, path = programs
    put("python3", pretender((3, 11, 7)))
    put("python3.12", REFUSING_SHIM)
    put("python3.13", REFUSING_SHIM)
    put("python3.14", REFUSING_SHIM)
    put("python", passing_on_to_this_python())
    found = find_python(root, path, tmp_path)
    assert found.returncode == 0, found.stderr
    version = subprocess.check_output(
        [found.stdout.strip(), "-c", "import sys; print(sys.version_info[:2] >= (3, 12))"]
    )
    assert version.strip() == b"True"


# Stands for pytest: an exit code for the claims about time, another for the rest.
PYTEST = """#!/bin/bash
case "$*" in
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


def test_make_alone_lists_every_target(checkout):
    helped = make(checkout)
    assert helped.returncode == 0
    for target in ("demo", "test", "heavy", "bench", "check", "size", "clean", "lock"):
        assert f"  make {target}" in helped.stdout


@pytest.mark.parametrize("timed", [0, 1])
@pytest.mark.parametrize("rest", [0, 1])
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


def test_the_doctor_and_the_set_up_name_the_same_packages():
    place = ROOT / ".ci/system_requirements.py"
    specification = importlib.util.spec_from_file_location("requirements_of_ci", place)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    assert {name: p for name, (p, _) in module.LIBRARIES.items()} == doctor.DEBIAN_PACKAGES


@pytest.fixture(scope="module")
def requirements():
    place = ROOT / ".ci/system_requirements.py"
    specification = importlib.util.spec_from_file_location("system_requirements", place)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def loader_without(*absent):
    def load(library):
        if library in absent:
            raise OSError(library)

    return load


@pytest.fixture
def headers(tmp_path):
    (tmp_path / "Python.h").touch()
    return tmp_path


@pytest.fixture
def complete(headers):
    return {"load": loader_without(), "which": lambda _: "/opt/cc", "include": headers,
            "has_module": lambda _: True}  # fmt: skip


def test_missing_libraries_lead_to_the_exact_apt_line(requirements, complete):
    lacking = requirements.missing(
        **complete | {"load": loader_without("libGLU.so.1", "libEGL.so.1")}
    )
    assert requirements.apt_line(lacking) == (
        "apt-get install -y --no-install-recommends libegl1 libglu1-mesa"
    )


def test_the_guide_gives_the_same_apt_line(requirements):
    packages = {package for package, _ in requirements.LIBRARIES.values()} | {"gcc", "libc6-dev"}
    guide = (ROOT / "docs/guide/install.md").read_text()
    assert f"\n{requirements.apt_line(packages)}\n" in guide
