"""Installation: hash-checked, whole or not at all, one clear error."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from verify.cli import main
from verify.errors import InputError, UnsupportedSceneError
from verify.foreign import foreign_solver, install, installing, remove, state_of
from verify.foreign.installing import ForeignProgram, mark_of, solvers_folder
from verify.printable import last_error
from verify.scene import load_scene

ROOTED = """
import json, os, pathlib, sys
import rooted
folder = pathlib.Path(sys.argv[1]) / f"level-{sys.argv[2]}"
said = {"schema": 1, "refused": f"{rooted.version()} at {os.environ['ROOTED']}"}
(folder / "solution.json").write_text(json.dumps(said))
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """Where the first environment is kept that an installation of these tests makes."""
    return tmp_path_factory.mktemp("environments") / "first"


@pytest.fixture
def locked(add_example, wheel, environment, monkeypatch):
    """A solver of the package ``cutfake``, with the hash of its wheel in the lock."""
    call = installing._call

    def made_once(
        solver, command, paths=None
    ):  # most of what an installation takes is an empty environment
        if command[1:3] != ["-m", "venv"]:
            return call(solver, command, paths)
        if not environment.exists():
            call(solver, [*command[:3], str(environment)])
        return shutil.copytree(environment, command[3], symlinks=True)

    monkeypatch.setattr(installing, "_call", made_once)
    folder = add_example("fake", module="cutfake", kind="packages", python="3.12")
    (folder / "requirements.lock").write_text(f"cutfake==1.5 --hash=sha256:{wheel}\n")
    return folder


def test_a_solver_is_installed_with_its_hash_into_an_environment_of_its_own_and_removed(
    locked, capsys
):
    # an environment without its mark is not installed; what is half there is replaced
    (solvers_folder() / "fake" / "environment").mkdir(parents=True)
    assert "install fake" in state_of(foreign_solver("fake")).missing
    assert main(["solvers", "install", "fake"]) == 0
    state = state_of(foreign_solver("fake"))
    assert state.version == "1.5"
    assert state.python.startswith(str(solvers_folder() / "fake"))
    capsys.readouterr()
    assert main(["solvers", "list", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["name"], row["version"], row["licence"]) == ("fake", "1.5", "Apache-2.0")
    assert main(["solvers", "list"]) == 0
    own, foreign, *_ = capsys.readouterr().out.splitlines()
    assert {"xfem", "conforming", "virtual_node"} <= set(own.replace(",", "").split())
    assert foreign.startswith("fake")
    # the lock of another version of the project: what is there is not what it names
    with (locked / "requirements.lock").open("a") as lock:
        lock.write("# newer\n")
    assert "another lock" in state_of(foreign_solver("fake")).missing
    assert main(["solvers", "remove", "fake"]) == 0
    assert not (solvers_folder() / "fake").exists()
    with pytest.raises(InputError, match="not installed"):
        remove("fake")


@pytest.mark.parametrize("fault", ["hash", "module"])
def test_nothing_is_left_of_an_installation_that_fails(locked, fault, capsys):
    lock = locked / "requirements.lock"
    if fault == "hash":
        lock.write_text(f"cutfake==1.5 --hash=sha256:{'0' * 64}\n")
    else:
        record = locked / "solver.toml"
        record.write_text(record.read_text().replace('module = "cutfake"', 'module = "other"'))
    assert main(["solvers", "install", "fake"]) == 2
    said = capsys.readouterr().err.strip()
    assert len(said.splitlines()) == 1
    assert "fake" in said
    assert not (solvers_folder() / "fake").exists()
    assert state_of(foreign_solver("fake")).python == ""


def test_a_system_package_is_found_where_it_is_and_else_the_way_to_it_is_said(add_example):
    add_example("here", module="numpy")
    add_example("elsewhere", module="no_such_module_anywhere")
    assert state_of(foreign_solver("here")).python == sys.executable
    assert "administrator" in state_of(foreign_solver("elsewhere")).missing
    with pytest.raises(InputError, match="no_such_module_anywhere"):
        install("elsewhere")
    assert not mark_of("elsewhere").exists()
    install("here", sys.executable)  # remembers this Python
    assert mark_of("here").is_file()


@pytest.mark.parametrize("way", ["path file", "user site", "PYTHONPATH"])
def test_a_python_of_the_system_has_its_package_by_any_way_that_python_knows(
    way, add_example, tmp_path, monkeypatch
):
    python, package = sys._base_executable, tmp_path / "package"
    package.mkdir()
    (package / "rooted.py").write_text("def version():\n    return '7.1'\n")
    if way == "path file":
        subprocess.run([python, "-m", "venv", "--without-pip", tmp_path / "own"], check=True)
        python = str(tmp_path / "own/bin/python")
        (site,) = tmp_path.glob("own/lib/python3*/site-packages")
        (site / "rooted.pth").write_text(str(package))
    elif way == "user site":
        monkeypatch.setenv("PYTHONUSERBASE", str(tmp_path / "user"))
        asked = [python, "-c", "import site; print(site.getusersitepackages())"]
        site = Path(
            subprocess.run(asked, check=True, capture_output=True, text=True).stdout.strip()
        )
        shutil.copytree(package, site)
    else:
        monkeypatch.setenv("PYTHONPATH", str(package))
    folder = add_example("rooted", python=python, text=ROOTED)
    record = folder / "solver.toml"
    text = record.read_text().replace("[parameters]", 'variables = ["ROOTED"]\n[parameters]')
    text = text.replace('version_of = "numpy"', 'version_of = "rooted:version"')
    record.write_text(text.replace('module = "numpy"', 'module = "rooted"'))
    monkeypatch.setenv("ROOTED", "its root")
    assert install("rooted").version == "7.1"
    monkeypatch.delenv("ROOTED")
    monkeypatch.delenv("PYTHONPATH", raising=False)
    with pytest.raises(UnsupportedSceneError, match=r"^7\.1 at its root$"):
        ForeignProgram("rooted").solve(load_scene("statics/f1_patch"), 0)


def test_the_reason_of_a_failure_is_its_error_not_what_a_program_says_after_it():
    said = "Traceback (most recent call last):\n  File 'x'\nValueError: no mesh\n[INFO] unloaded\n"
    assert last_error(said) == "ValueError: no mesh"
    logged = "[ERROR]   [Runtime] RuntimeError: no rest\nTraceback:\n  raise RuntimeError(text)\n"
    assert last_error(logged) == "RuntimeError: no rest"
    assert last_error("one\nstopped early\n\n") == "stopped early"
    assert last_error("a.b.LostError: gone\nSystemExit\n") == "SystemExit"
    assert last_error("") == ""
