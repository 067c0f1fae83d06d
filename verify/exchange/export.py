"""A case as files for programs that are not written in Python, run as solvers or read back.

::

    DIR/case.json                 the case: material, cuts, quantities, levels (`EXPORT_SCHEMA`)
    DIR/cuts.vtu                  the cuts as asked: lines or triangles
    DIR/level-0/mesh.vtu          background mesh, ignorant of the cuts
    DIR/level-0/problem.json      held nodes and loads on that mesh
    DIR/level-0/conforming.vtu    the same mesh with the cuts imprinted and opened, if asked for
    DIR/level-0/conforming.json   held nodes and loads on it
    DIR/level-0/solution.json     the answer of a program goes here, with its VTU

Every field of the JSON files is described in ``docs/guide/your-solver.md``.
"""

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numpy as np

from verify.compare.hooke import hooke
from verify.errors import InputError, UnsupportedSceneError
from verify.exchange.problem import HeldNodes, Load, Problem, problem_of
from verify.files import asked_place, read_json, whole_file, write_json
from verify.printable import last_error, one_line
from verify.result import Status
from verify.runner.fingerprint import physics_digest
from verify.scene import Scene
from verify.solution import Solution, read_solution
from verify.solvers import check_parameters

EXPORT_SCHEMA = 1

_TAIL = 300
_FRAME = re.compile(r'File "([^"]+)", line (\d+), in (.+)')


def level_folder(root: Path, level: int) -> Path:
    """Folder of a mesh level below that of an exported case."""
    return root / f"level-{level}"


def export_case(
    scene: Scene, out: Path, levels: Sequence[int] | None = None, conforming: bool = False
) -> list[Path]:
    """Write `scene` for other programs.

    Parameters
    ----------
    scene : Scene
    out : Path
        A directory that does not exist, is empty, or holds an export, whole or not; answers in it
        stay.
    levels : sequence of int, optional
        Mesh levels; default all.
    conforming : bool
        Whether to write conforming meshes too.

    Returns
    -------
    list of Path
        The files written, ``case.json`` last: its presence means that the export is whole.

    Raises
    ------
    InputError
        If `out` holds something else or may not be written, or a level is not one of the case.
    UnsupportedSceneError
        If a conforming mesh is asked for that is not offered.
    """
    chosen = list(range(scene.mesh.count) if levels is None else dict.fromkeys(levels))
    for level in chosen:
        if not 0 <= level < scene.mesh.count:
            raise InputError(f"mesh level {level}; {scene.name} has 0..{scene.mesh.count - 1}")
    with asked_place(out):
        _check_place(out)
    files: list[Path] = []
    entries = []
    for level in chosen:
        folder = level_folder(out, level)
        models = (scene.material.model,)  # the case file names it
        problems = {"mesh": problem_of(scene, level, models=models)}
        if conforming:
            problems["conforming"] = problem_of(scene, level, conforming=True, models=models)
        with asked_place(folder):
            folder.mkdir(parents=True, exist_ok=True)
            for name, problem in problems.items():
                files += _write_problem(problem, folder, name)
        background, entry = problems["mesh"], {"level": level, "folder": folder.name}
        counts = {"nodes": len(background.points), "cells": len(background.cells)}
        entries.append({**entry, "size": background.size, **counts})
    with asked_place(out):
        if scene.cuts:
            _write_cuts(scene, out / "cuts.vtu")
            files.append(out / "cuts.vtu")
        write_json(_case(scene, entries), out / "case.json")
    return [*files, out / "case.json"]


def _check_place(out: Path) -> None:
    if out.exists() and not out.is_dir():
        raise InputError("is a file; expected a directory for the export", str(out))
    if out.is_dir() and not (out / "case.json").is_file() and any(map(_is_foreign, out.iterdir())):
        raise InputError("not empty and not an export; give --out a new directory", str(out))
    (out / "case.json").unlink(missing_ok=True)


def _is_foreign(path: Path) -> bool:
    """Whether it is none of an export's own, which lie alone where one has ended early."""
    return re.fullmatch(r"level-\d+|cuts\.vtu(\.partial)?", path.name) is None


def _case(scene: Scene, levels: list[dict[str, Any]]) -> dict[str, Any]:
    content = scene.model_dump(mode="json", by_alias=True)
    return {
        "schema": EXPORT_SCHEMA,
        "case": scene.name,
        "physics": physics_digest(scene),
        "title": scene.title,
        "requirement": scene.requirement,
        "dimension": scene.dimension,
        "material": _material(scene),
        "analysis": content["analysis"],
        "output_times": list(scene.analysis.output_times),
        "initial": content["initial"],
        "cuts": [_cut(cut, asked) for cut, asked in zip(scene.cuts, content["cuts"], strict=True)],
        "quantities": content["quantities"],
        "levels": levels,
        "scene": content,
    }


def _material(scene: Scene) -> dict[str, Any]:
    """One material; of several only their list, so that none is taken for that of the body."""
    constants = []
    for one in scene.material.each:
        law = hooke(one)
        content = one.model_dump(mode="json", exclude={"regions"})
        constants.append({**content, "lame": law.lame, "shear": law.shear})
    return constants[0] if scene.material.is_uniform else {"each": constants}


def _cut(cut: Any, asked: dict[str, Any]) -> dict[str, Any]:
    points, facets = cut.facets()
    content = {
        "name": cut.name,
        "kind": cut.kind,
        "opens_at": getattr(cut, "opens_at", 0.0),
        "points": points.tolist(),
        "asked": asked,
    }
    return content if facets.shape[1] == 2 else {**content, "triangles": facets.tolist()}


def _write_problem(problem: Problem, folder: Path, name: str) -> list[Path]:
    import meshio

    d = problem.scene.dimension
    mesh, conditions = folder / f"{name}.vtu", folder / f"{name}.json"
    if name == "mesh":
        conditions = folder / "problem.json"
    points = np.zeros((len(problem.points), 3))
    points[:, :d] = problem.points
    cell_type = {2: "triangle", 3: "tetra"}[problem.scene.cell_dimension]
    with whole_file(mesh) as partial:
        numbers = [problem.material_number().astype(np.int32)]
        data = {} if problem.scene.material.is_uniform else {"material": numbers}
        blocks = [(cell_type, problem.cells)]
        meshio.Mesh(points, blocks, cell_data=data).write(partial, file_format="vtu")
    content = {
        "schema": EXPORT_SCHEMA,
        "mesh": mesh.name,
        "conforming": problem.conforming,
        "size": problem.size,
        "boundary": problem.boundary,
        "cut_facets": problem.cut_facets,
        "held": [_held(entry) for entry in problem.held],
        "loads": [_load(load, problem.cells.shape[1]) for load in problem.loads],
    }
    if problem.conforming:  # on a background mesh they would ignore the cuts
        content["nodal_forces"] = problem.nodal_forces()
        content["free_pieces"] = problem.free_pieces()
        content["cut_opens"] = problem.cut_opens()
    write_json(content, conditions)
    return [mesh, conditions]


def _held(entry: HeldNodes) -> dict[str, Any]:
    asked = entry.support
    in_time: dict[str, Any] = {}
    if asked is not None and asked.history is not None:
        turn = None if asked.rotation is None else asked.rotation.model_dump()
        in_time = {"history": asked.history, "shift": asked.displacement, "rotation": turn}
    return {
        **in_time,
        "nodes": entry.nodes,
        "components": entry.components,
        "ended": [{"facet": facet, "corners": corners} for facet, corners in entry.ended],
        "values": entry.values,
        "across": [
            {"node": node, "side_point": side, "values": values}
            for node, side, values in entry.across
        ],
    }


def _load(load: Load, corners: int) -> dict[str, Any]:
    on_cells = load.simplices.shape[1] == corners
    content: dict[str, Any] = {"kind": "body_force" if on_cells else "traction"}
    if load.history is not None:
        content["history"] = load.history
    if not on_cells:
        content["facets"] = load.simplices
    if load.uniform is not None and load.corners is None:
        return {**content, "uniform": load.uniform}
    if load.corners is not None:
        content |= {"corners": load.corners}
    if load.uniform is not None:
        content |= {"value": load.uniform}
    return {**content, "points": load.points, "weights": load.weights, "values": load.values}


def _write_cuts(scene: Scene, path: Path) -> None:
    """Write each cut as lines or triangles, with its index as cell data ``cut``."""
    import meshio

    points, blocks, index, first = [], [], [], 0
    for i, cut in enumerate(scene.cuts):
        vertices, facets = cut.facets()
        blocks.append(({2: "line", 3: "triangle"}[facets.shape[1]], first + facets))
        index.append(np.full(len(facets), i, dtype=np.int32))
        points.append(np.pad(vertices, ((0, 0), (0, 3 - vertices.shape[1]))))
        first += len(vertices)
    mesh = meshio.Mesh(np.vstack(points), blocks, cell_data={"cut": index})
    with whole_file(path) as partial:
        mesh.write(partial, file_format="vtu")


@dataclass(frozen=True)
class Answers:
    """Solutions by level; for the other levels, how they ended and why.

    Attributes
    ----------
    solutions : dict of int to Solution
    missing : dict of int to (Status, str)
    """

    solutions: dict[int, Solution] = field(default_factory=dict)
    missing: dict[int, tuple[Status, str]] = field(default_factory=dict)


def read_answers(scene: Scene, folder: Path) -> Answers:
    """Read ``level-<k>/solution.json`` and its VTU files below `folder`.

    A program that cannot do a level answers ``{"schema": 1, "refused": "why"}``. A level whose
    answer is missing, damaged or of the wrong dimension has failed; the others count.

    Parameters
    ----------
    scene : Scene
    folder : Path
        Of the layout that `export_case` makes; it may be the exported directory itself.

    Raises
    ------
    InputError
        If there is no answer at all, or the folder was exported from another version of the case.
    """
    if not folder.is_dir():
        text = "no such directory; expected answers in level-<k>/solution.json"
        raise InputError(text, str(folder))
    _check_same_case(scene, folder)
    paths = [level_folder(folder, k) / "solution.json" for k in range(scene.mesh.count)]
    if not any(path.is_file() for path in paths):
        text = f"holds no answer; expected level-0/solution.json … for {len(paths)} levels"
        raise InputError(text, str(folder))
    answers = Answers()
    for level, path in enumerate(paths):
        if not path.is_file():
            reason = f"no answer for level {level} (no file {path.parent.name}/{path.name})"
            answers.missing[level] = Status.FAILED, reason
            continue
        try:
            if refusal := read_json(path).get("refused"):
                answers.missing[level] = Status.REFUSED, one_line(refusal)
                continue
            solution = read_solution(path.with_suffix(""))
            if solution.dimension != scene.dimension:
                text = f"a {solution.dimension}D solution; the case has {scene.dimension}"
                raise InputError(text, str(path))
        except InputError as error:
            answers.missing[level] = Status.FAILED, str(error)
        else:
            answers.solutions[level] = solution
    return answers


def answers_of(scenes: Sequence[Scene], folder: Path) -> dict[str, Answers]:
    """Read the answers to each of several scenes below ``folder/<scene>``; to one, in `folder`.

    A scene that has no folder is one that the program does not take.

    Raises
    ------
    InputError
        As `read_answers`; or if no scene has a folder.
    """
    if len(scenes) == 1:
        return {scenes[0].name: read_answers(scenes[0], folder)}
    found = {}
    for scene in scenes:
        place = folder / scene.name
        blank = Status.REFUSED, f"no answers: no folder '{scene.name}'"
        without = Answers(missing=dict.fromkeys(range(scene.mesh.count), blank))
        found[scene.name] = read_answers(scene, place) if place.is_dir() else without
    if not any((folder / name).is_dir() for name in found):
        text = f"holds no answer; expected {scenes[0].name}/level-0/solution.json …"
        raise InputError(text, str(folder))
    return found


def _check_same_case(scene: Scene, folder: Path) -> None:
    """Refuse answers to another version of the case, where the export says which it was."""
    file = folder / "case.json"
    if not file.is_file():
        return
    exported = read_json(file)
    if exported.get("physics") != physics_digest(scene):
        raise InputError(
            f"was exported from '{exported.get('case')}', which is another case than "
            f"'{scene.name}' is now: export it again and solve that",
            str(file),
        )


class ProgramSolver:
    """A solver that is a program; subclass it and say how the program is called.

    Attributes
    ----------
    name : str
    command : sequence of str
        The program and its arguments. ``{folder}`` becomes the exported case, ``{level}`` the
        mesh level to solve; the program writes ``level-<k>/solution.json`` and its VTU there.
    conforming : bool
        Whether it wants the conforming meshes.
    parameters : mapping
        Names of the parameters that it takes, with their defaults.
    repeats : bool
        Whether it times its repetitions itself; else it is called as often.

    Notes
    -----
    The program finds ``request.json`` in the folder: ``level``, ``repetitions`` and all
    ``parameters``.
    A program that cannot do a case answers ``{"schema": 1, "refused": "why"}``. Its own
    ``timings`` are used if it gives some; else its wall time, start-up included, is taken and
    that is said in the notes.
    """

    name: str = "program"
    command: Sequence[str] = ()
    conforming: bool = False
    parameters: Mapping[str, Any] = {}
    repeats: ClassVar[bool] = False

    def refuses(self, scene: Scene) -> str | None:
        """Refuse nothing; the program itself may, and a subclass that knows better."""
        return None

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels of the scene."""
        return scene.mesh.count

    def solve(self, scene: Scene, level: int, repetitions: int = 1, **parameters: Any) -> Solution:
        """Export `scene`, run the program, read its answer.

        Raises
        ------
        UnsupportedSceneError
            If the program refuses the scene.
        InputError
            If the program is not there, or its answer is missing or bad.
        RuntimeError
            If the program fails; with the end of what it said.
        """
        check_parameters(self.name, self, parameters)
        with tempfile.TemporaryDirectory(prefix="verify-") as place:
            folder = Path(place)
            export_case(scene, folder, [level], self.conforming)
            asked = {"level": level, "repetitions": repetitions if self.repeats else 1}
            handed = {**self.parameters, **parameters}
            write_json({**asked, "parameters": handed}, folder / "request.json")
            calls = 1 if self.repeats else repetitions
            walls = [self._run(folder, level) for _ in range(calls)]
            answers = read_answers(scene, folder)
        if level in answers.missing:
            status, why = answers.missing[level]
            if status is Status.REFUSED:
                raise UnsupportedSceneError(why)
            raise InputError(f"'{self.name}': {why}")
        solution = answers.solutions[level]
        if not solution.timings:
            solution.timings["program"] = walls
            solution.notes["timed"] = "wall time of the program, its start-up included"
        return solution

    def environment(self) -> dict[str, str]:
        """Return the environment that the program is run in."""
        return dict(os.environ)

    def _run(self, folder: Path, level: int) -> float:
        words = [word.format(folder=folder, level=level) for word in self.command]
        if not words or shutil.which(words[0]) is None:
            raise InputError(f"'{self.name}': no program '{words[0] if words else ''}'")
        start = perf_counter()
        done = subprocess.run(
            words, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            env=self.environment(), errors="replace",
        )  # fmt: skip
        wall = perf_counter() - start
        if done.returncode:
            said = done.stderr.strip() or done.stdout.strip()
            text = f"'{self.name}': {words[0]} ended with {done.returncode}"
            why = last_error(said)[-_TAIL:] or "said nothing"
            raise RuntimeError(f"{text}: {why}{_raised_at(said)}")
        return wall


def _raised_at(said: str) -> str:
    """Where a program in Python raised: its last own line, not one of what it is built on."""
    frames = [frame.groups() for frame in _FRAME.finditer(said)]
    own = [frame for frame in frames if "site-packages" not in frame[0]]
    return " ({}:{} in {})".format(*(own or frames)[-1]) if frames else ""
