"""Installed foreign solvers: a virtual environment each, and its program as a solver.

The environments lie below the user's data folder. One counts as installed once ``installed.json``
lies in its folder, which is written last. Packages are taken by the user's own pip, with hashes, as
wheels only.
"""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

from verify.errors import InputError
from verify.exchange.export import ProgramSolver
from verify.files import read_json, write_json
from verify.foreign.records import PROGRAMS, ForeignSolver, foreign_solver
from verify.printable import last_error
from verify.runner.fingerprint import file_digest
from verify.scene import Scene


class ForeignProgram(ProgramSolver):
    """The foreign solver `name`.

    Attributes
    ----------
    files : list of path
        What its answers depend on, for the fingerprint of a solve.
    implicit : bool
        No step of any of these programs is critical: no study looks for one by running them.

    Raises
    ------
    InputError
        If there is no such solver, or it is not installed.
    """

    repeats = True
    implicit = True

    def __init__(self, name: str) -> None:
        record = foreign_solver(name)
        state = state_of(record)
        if not state.python:
            raise InputError(f"solver '{name}' is not installed: {state.missing}")
        program = record.folder / "program.py"
        self.name, self.conforming = name, record.conforming
        self.parameters, self.choices = record.parameters, record.choices
        self._takes = record.takes
        self._paths, self._variables = state.paths, state.variables
        alone = ("-s",) if state.paths is None else ()
        self.command = (state.python, *alone, str(program), "{folder}", "{level}")
        self.files = [*record.folder.glob("*.*"), *PROGRAMS.glob("*.py"), mark_of(name)]
        self.files = [file for file in self.files if file.is_file()]

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what its record does not list."""
        return self._takes.refusal(scene)

    def environment(self) -> dict[str, str]:
        """Return this process' own, with the reader and writer as the first path."""
        inherited = {key: value for key, value in os.environ.items() if key != "PYTHONHOME"}
        paths = os.pathsep.join([str(PROGRAMS), *([self._paths] if self._paths else [])])
        own = {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"}
        return {**inherited, **self._variables, **own}


_ASKED = """
import importlib, importlib.metadata, json, platform, sys
module, of = sys.argv[1:]
importlib.import_module(module)
if ":" in of:
    found = getattr(importlib.import_module(of.split(":")[0]), of.split(":")[1])
    try:
        version = str(found() if callable(found) else found)
    except TypeError:
        version = str(found("version"))
else:
    version = importlib.metadata.version(of)
print(json.dumps({"version": version, "python": platform.python_version()}))
"""


@dataclass(frozen=True)
class State:
    """Whether a foreign solver can be run here.

    Attributes
    ----------
    python : str
        Its interpreter; empty if it is not there.
    version : str
    missing : str
        What to do about it, if it is not there.
    paths : str, optional
        PYTHONPATH with which a Python of the system has it, its user's packages too; None: it has
        it without either, which is tried first, since they may belong to another Python.
    variables : dict of str to str
        Of its record, as they were when it was found.
    """

    python: str = ""
    version: str = ""
    missing: str = ""
    paths: str | None = None
    variables: dict[str, str] = field(default_factory=dict)


def solvers_folder() -> Path:
    """Return where they are installed: ``VERIFY_SOLVERS``, else below the user's data folder."""
    if named := os.environ.get("VERIFY_SOLVERS"):
        return Path(named)
    home = os.environ.get("XDG_DATA_HOME")
    root = Path(home) if home else Path.home() / ".local" / "share"
    return root / "cutting-verification" / "solvers"


def mark_of(name: str) -> Path:
    """File that says that a solver is installed, and where."""
    return solvers_folder() / name / "installed.json"


def state_of(solver: ForeignSolver) -> State:
    """Look whether a solver is there; a Python of the system is asked, an own one is not."""
    mark = mark_of(solver.name)
    command = f"verify solvers install {solver.name}"
    if mark.is_file():
        said = read_json(mark)
        if not Path(said["python"]).exists():
            return State(missing=f"its Python {said['python']} has gone: {command}")
        if said["lock"] != _lock_digest(solver):
            return State(missing=f"installed from another lock: {command}")
        return State(
            said["python"], said["version"], paths=said.get("paths"),
            variables=said.get("variables", {}),
        )  # fmt: skip
    if solver.install.kind == "system":
        try:
            return _find(solver, solver.install.python)
        except InputError:
            command = f"{solver.install.how}; or {command} --python THE-PYTHON-THAT-HAS-IT"
            return State(missing=command)
    return State(missing=command)


def install(name: str, python: str | None = None) -> State:
    """Install the solver `name`, or remember the Python of the system that has it.

    Parameters
    ----------
    name : str
    python : str, optional
        Interpreter; by default of this process, or the one that the record names.

    Raises
    ------
    InputError
        If there is no such solver, the Python does not do, or the packages cannot be installed.
        Nothing of the attempt is left.
    """
    solver = foreign_solver(name)
    state, folder = state_of(solver), solvers_folder() / name
    if state.python and mark_of(name).is_file() and python is None:
        return state
    system = solver.install.kind == "system"
    asked = python or (solver.install.python if system else sys.executable)
    interpreter = shutil.which(asked)
    if interpreter is None:
        raise InputError(f"{name}: no Python '{asked}'", "--python")
    if system:
        state = _find(solver, interpreter)
    else:
        _check_version(solver, interpreter)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    try:
        if not system:
            interpreter = _environment(solver, interpreter, folder / "environment")
            state = State(interpreter, _ask(solver, interpreter)["version"])
        said = {"python": state.python, "version": state.version, "lock": _lock_digest(solver)}
        write_json({**said, "paths": state.paths, "variables": state.variables}, mark_of(name))
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return state


def remove(name: str) -> Path:
    """Remove the environment of the solver `name`, whole or not; return its folder.

    Raises
    ------
    InputError
        If nothing of it is installed here.
    """
    folder = solvers_folder() / foreign_solver(name).name
    if not folder.is_dir():
        raise InputError(f"'{name}' is not installed in {folder.parent}")
    shutil.rmtree(folder)
    return folder


def _environment(solver: ForeignSolver, python: str, place: Path) -> str:
    """Make the environment and fill it; return its interpreter."""
    own = str(place / "bin" / "python")
    _call(solver, [python, "-m", "venv", str(place)])
    pip = [own, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input"]
    exact = ["--require-hashes", "--no-deps", "--only-binary", ":all:"]
    _call(solver, [*pip, *exact, "--requirement", str(solver.lock)])
    return own


def _check_version(solver: ForeignSolver, python: str) -> None:
    least = tuple(map(int, solver.install.python.split(".")))
    said = _call(solver, [python, "-c", "import sys; print(*sys.version_info[:2])"])
    found = tuple(map(int, said.split()))
    if found < least:
        text = f"is Python {'.'.join(map(str, found))}; {solver.name} needs"
        raise InputError(f"{python} {text} {solver.install.python} or later", "--python")


def _find(solver: ForeignSolver, python: str) -> State:
    """Ask a Python of the system, without its user's packages and paths, then with them."""
    variables = {k: os.environ[k] for k in solver.install.variables if k in os.environ}
    try:
        return State(python, _ask(solver, python, "-s")["version"], variables=variables)
    except InputError:
        paths = os.environ.get("PYTHONPATH", "")
        said = _ask(solver, python, paths=paths)
        return State(python, said["version"], paths=paths, variables=variables)


def _ask(
    solver: ForeignSolver, python: str, *options: str, paths: str | None = None
) -> dict[str, str]:
    """Import it with its Python; return the versions."""
    words = [python, *options, "-c", _ASKED, solver.module, solver.version_of]
    said = _call(solver, words, paths)
    # what it imports may speak too, at its end as well
    line = next(line for line in reversed(said.splitlines()) if line.startswith("{"))
    answer: dict[str, str] = json.loads(line)
    return answer


def _call(solver: ForeignSolver, words: list[str], paths: str | None = None) -> str:
    """Run a command; what it says.

    Raises
    ------
    InputError
        If it fails: with the error that it ended with, or its last line.
    """
    outside = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    if paths:
        outside["PYTHONPATH"] = paths
    try:
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
            env=outside,
        )  # fmt: skip
    except OSError as error:
        raise InputError(f"{solver.name}: {words[0]}: {error.strerror}") from None
    if done.returncode:
        why = last_error(done.stderr or done.stdout) or f"exit code {done.returncode}"
        raise InputError(f"{solver.name} cannot be used with {words[0]}: {why}")
    return done.stdout


def _lock_digest(solver: ForeignSolver) -> str:
    return file_digest(solver.lock) if solver.lock.is_file() else ""
