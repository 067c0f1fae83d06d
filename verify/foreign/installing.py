"""Foreign solvers: their records, a virtual environment each, and its program as a solver.

A folder of ``programs/`` is the record of one::

    programs/NAME/solver.toml         what it is, how it is installed, what it takes
    programs/NAME/program.py          the program, run by its own Python
    programs/NAME/requirements.lock   its packages with their hashes, if it is installed from them

The environments lie below the user's data folder. One counts as installed once ``installed.json``
lies in its folder, which is written last. Packages are taken by the user's own pip, with hashes, as
wheels only.
"""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict

from verify.errors import InputError
from verify.exchange.export import ProgramSolver
from verify.files import asked_place, read_json, write_json
from verify.printable import last_error
from verify.result import checked
from verify.runner.fingerprint import file_digest
from verify.scene import BodyForce, Scene
from verify.scene.strict import nearest

PROGRAMS = Path(__file__).resolve().parent / "programs"
_STRICT = ConfigDict(extra="forbid")


@dataclass(frozen=True)
class Install:
    """How a foreign solver is installed.

    Attributes
    ----------
    kind : {"packages", "system"}
        From ``requirements.lock`` into an environment of its own; or by the user, into a Python
        of the system.
    python : str
        The least version of Python; of a system package the interpreter that it is installed for.
    how : str
        The command that installs a system package, for the user to read.
    variables : list of str
        Environment variables that it needs, as they are when it is installed.
    """

    __pydantic_config__ = _STRICT
    kind: Literal["packages", "system"]
    python: str
    how: str = ""
    variables: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Takes:
    """What a solver takes; all else it refuses before anything runs.

    Attributes
    ----------
    dimensions, analyses, kinematics, cuts : list
        As in case files; ``cuts`` are their kinds.
    materials : {"one", "several"}
    models : list of str
        Of the material.
    opening : bool
        Whether cuts may open in the course of a motion.
    histories : bool
        Whether supports and loads may change in time.
    membranes, damping : bool
    formulas : bool
        Whether body forces may be formulas, or the exact solution's.
    initial : list of str
        Kinds of initial states.
    """

    __pydantic_config__ = _STRICT
    dimensions: list[int]
    analyses: list[str]
    kinematics: list[str]
    cuts: list[str] = field(
        default_factory=lambda: [
            "polyline", "arc", "polygon", "disc", "cylinder", "sphere", "swept", "tool_path",
        ]
    )  # fmt: skip
    materials: Literal["one", "several"] = "several"
    models: list[str] = field(default_factory=lambda: ["hooke"])
    opening: bool = False
    histories: bool = False
    membranes: bool = False
    damping: bool = False
    formulas: bool = True
    initial: list[str] = field(default_factory=lambda: ["rest"])

    def refusal(self, scene: Scene) -> str | None:
        """Say in one sentence why the scene is not taken, or None."""
        analysis, timed = scene.analysis, [*scene.supports, *scene.loads]
        if scene.cell_dimension != scene.dimension and not self.membranes:
            return "membranes are not offered"
        asked: list[tuple[str, Any, list[Any]]] = [
            ("dimension", scene.dimension, self.dimensions),
            ("analysis", analysis.kind, self.analyses),
            ("kinematics", analysis.kinematics, self.kinematics),
            ("material model", scene.material.model, self.models),
            ("initial state", scene.initial.kind, self.initial),
            *(("cut", cut.kind, self.cuts) for cut in scene.cuts),
        ]
        for name, found, offered in asked:
            if found not in offered:
                return f"{name} {found!r} is not offered; {', '.join(map(str, offered))} is"
        if self.materials == "one" and not scene.material.is_uniform:
            return "several materials are not offered"
        if not self.opening and any(getattr(cut, "opens_at", 0.0) for cut in scene.cuts):
            return "cuts that open in the course of a motion are not offered"
        if not self.histories and any(getattr(one, "history", None) for one in timed):
            return "supports and loads that change in time are not offered"
        if not self.damping and any(analysis.damping):
            return "damping is not offered"
        forces = [load.force for load in scene.loads if isinstance(load, BodyForce)]
        if not self.formulas and any(isinstance(f, str) for force in forces for f in force):
            return "body forces in formulas are not offered"
        return None


@dataclass(frozen=True)
class ForeignSolver:
    """What ``solver.toml`` says.

    Attributes
    ----------
    name : str
        Its folder's.
    title, licence, source : str
        What it is; its licence; the publication.
    module, version_of : str
        The module that must be importable; the distribution, or attribute ``module:name``, that
        has the version.
    install : Install
    takes : Takes
    parameters : dict
        Set by ``--set NAME.…``, with their defaults.
    choices : dict of str to list of str
        What they may be, where they are words.
    conforming : bool
        Whether the program wants the conforming mesh.
    """

    __pydantic_config__ = _STRICT
    name: str
    title: str
    licence: str
    module: str
    version_of: str
    install: Install
    takes: Takes
    source: str = ""
    parameters: dict[str, Any] = field(default_factory=dict)
    choices: dict[str, list[str]] = field(default_factory=dict)
    conforming: bool = False

    @property
    def folder(self) -> Path:
        """Folder of its program."""
        return PROGRAMS / self.name

    @property
    def lock(self) -> Path:
        """File of its packages with their hashes."""
        return self.folder / "requirements.lock"


def foreign_solvers() -> dict[str, ForeignSolver]:
    """All foreign solvers that the project has a program for, by name."""
    return {path.parent.name: _read(path) for path in sorted(PROGRAMS.glob("*/solver.toml"))}


def foreign_solver(name: str) -> ForeignSolver:
    """Return the record of one.

    Raises
    ------
    InputError
        If there is none of this name.
    """
    known = foreign_solvers()
    if name not in known:
        raise InputError(f"no foreign solver '{name}'{nearest(name, known)}")
    return known[name]


def _read(path: Path) -> ForeignSolver:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # no TOML, or no text: the former with its line
        raise InputError(str(error), str(path)) from None
    return checked(ForeignSolver, {"name": path.parent.name, **content}, "record", str(path))


def write_template(folder: Path) -> list[Path]:
    """Write the reader and writer of the exchange and the example into `folder`."""
    files = [folder / name for name in ("exchange_files.py", "example.py")]
    with asked_place(folder):
        for file in files:
            shutil.copyfile(PROGRAMS / file.name, file)
    return files


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
