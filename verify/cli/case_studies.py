"""The studies that solve scenes derived from a case, through the runner."""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from verify.errors import InputError

if TYPE_CHECKING:
    from verify.result import CaseResult
    from verify.scene import Scene
    from verify.solution import Solution
    from verify.study.budget import BudgetStudy, Solved
    from verify.study.cost import CostStudy
    from verify.study.thesis import ThesisStudy

__all__ = ["budget", "cost", "thesis"]

Announce = Callable[[str], None]


def cost(arguments: argparse.Namespace, announce: Announce) -> "CostStudy":
    """Solve every step of a growing cut, and compare at equal accuracy."""
    from verify.runner.checking import check_solver_name
    from verify.scene import load_scene
    from verify.study.cost import cost_study, growing_scenes

    scene = load_scene(arguments.case)
    solvers = tuple(dict.fromkeys(arguments.solvers)) or ("xfem", "conforming")
    for name in solvers:
        check_solver_name(name, "--solver")
    scenes = growing_scenes(scene, arguments.steps)
    # on the other mesh of this solver only the cut cells are made anew
    parameters = {"conforming": {"mesh": "remeshed"}} if "conforming" in solvers else {}
    start = perf_counter()
    folder = arguments.out / f"cost-{scene.name.replace('/', '__')}"
    announce(f"{len(scenes)} steps of the cut '{scene.cuts[0].name}', into {folder}")
    results = _run(scenes, folder, solvers, arguments.repetitions, parameters)
    return cost_study(scene.name, results, arguments.metric, perf_counter() - start)


def budget(arguments: argparse.Namespace, announce: Announce) -> "BudgetStudy":
    """Solve the links of the chain, and take the error apart."""
    from verify.scene import load_scene
    from verify.study.budget import (
        budget_study,
        is_realised_as_asked,
        on_realised_cut,
        with_kinematics,
    )

    scene = load_scene(arguments.case)
    where = str(scene.file or scene.name)
    if scene.dimension != 2 or scene.analysis.kind != "static":
        raise InputError("the budget is offered for plane, static scenes", where)
    level = scene.mesh.count - 1 if arguments.level is None else arguments.level
    if not 0 <= level < scene.mesh.count:
        raise InputError(f"level {level}; expected 0..{scene.mesh.count - 1}", "--level")
    exact = _exact(scene)
    own = scene.analysis.kinematics
    kinds = ["linear"] if exact is not None else ["corotational", "linear"]
    folder = arguments.out / f"budget-{scene.name.replace('/', '__')}"
    start = perf_counter()
    announce(f"the problem as asked, {' and '.join(kinds)}, into {folder}")
    solvers = ("xfem", "conforming")
    asked = dict(
        zip(kinds, _solved([with_kinematics(scene, k) for k in kinds], folder / "asked", solvers,
                           arguments.repetitions), strict=True)
    )  # fmt: skip
    judged = asked[own].solutions.get("xfem", {}).get(level)
    realised = None
    if judged is not None and not is_realised_as_asked(scene, judged):
        links = list(dict.fromkeys([kinds[0], own]))
        announce(f"the cut as level {level} realised it, {' and '.join(links)}")
        scenes = [on_realised_cut(scene, judged.cut_facets, level, k) for k in links]
        found = _solved(scenes, folder / f"realised-{level}", ("conforming", "reference"), 1)
        realised = dict(zip(links, found, strict=True))
    return budget_study(
        scene, level, arguments.tolerance, arguments.metric, asked, realised, exact,
        perf_counter() - start,
    )  # fmt: skip


def thesis(arguments: argparse.Namespace, announce: Announce) -> "ThesisStudy":
    """Measure the tables of the thesis again, and judge its claims."""
    from verify.scene import load_scene
    from verify.study.thesis import CASES, SOLVERS, thesis_study

    quick = arguments.quick
    folder = arguments.out / "thesis-cases"
    names, solvers = (CASES[:2], SOLVERS[:4]) if quick else (CASES, SOLVERS)
    scenes = [_coarsest(load_scene(name), 2 if quick else 3) for name in names]
    announce(f"{len(solvers)} solvers on {', '.join(names)}, into {folder}")
    start = perf_counter()
    results = _run(scenes, folder, solvers, 1 if quick else 3)
    return thesis_study(scenes, results, quick, announce, perf_counter() - start)


def _coarsest(scene: "Scene", levels: int) -> "Scene":
    assert scene.mesh.cells is not None
    mesh = scene.mesh.model_copy(update={"cells": scene.mesh.cells[:levels]})
    return scene.model_copy(update={"mesh": mesh})


def _exact(scene: "Scene") -> Any:
    if not scene.judged_by_exact or scene.exact is None:
        return None
    from reference.exact import exact_solution

    return exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)


def _run(
    scenes: "Sequence[Scene]",
    folder: Path,
    solvers: tuple[str, ...],
    repetitions: int,
    parameters: dict[str, dict[str, Any]] | None = None,
) -> "list[CaseResult]":
    from verify.cli.progress import progress_on
    from verify.runner import Options, run_cases
    from verify.runner.reference_cache import cache_folder

    options = Options(
        solvers=solvers,
        repetitions=repetitions,
        parameters=parameters or {},
        cache=cache_folder(),
    )
    with progress_on(sys.stderr) as progress:
        return run_cases(scenes, folder, options, progress).results


def _solved(
    scenes: "Sequence[Scene]", folder: Path, solvers: tuple[str, ...], repetitions: int
) -> "list[Solved]":
    """Run scenes, and read the solutions back."""
    from verify.runner.directory import RunDirectory
    from verify.solution import read_solution
    from verify.study.budget import Solved

    place = RunDirectory(folder)
    found = []
    for scene, result in zip(scenes, _run(scenes, folder, solvers, repetitions), strict=True):
        solutions: dict[str, dict[int, Solution]] = {}
        for record in result.solves:
            if record.status == "solved":
                stem = place.solve_folder(scene.name, record.solver, record.level) / "solution"
                solutions.setdefault(record.solver, {})[record.level] = read_solution(stem)
        kept: Mapping[str, Mapping[int, Solution]] = solutions
        found.append(Solved(scene, result, kept))
    return found
