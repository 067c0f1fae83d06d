"""Records of the foreign solvers: a folder of ``programs/`` each.

::

    programs/NAME/solver.toml         what it is, how it is installed, what it takes
    programs/NAME/program.py          the program, run by its own Python
    programs/NAME/requirements.lock   its packages with their hashes, if it is installed from them
"""

import shutil
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict

from verify.errors import InputError
from verify.files import asked_place
from verify.result import checked
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
