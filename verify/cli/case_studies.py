"""The studies that solve scenes derived from a case, through the runner."""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from verify.result import CaseResult
    from verify.scene import Scene
    from verify.solution import Solution
    from verify.study.budget.links import Solved
    from verify.study.budget.study import BudgetStudy
    from verify.study.cost import CostStudy
    from verify.study.iterations import IterationsStudy
    from verify.study.thesis import ThesisStudy

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
    from verify.study.budget.study import budget_study

    scene = load_scene(arguments.case)
    repetitions = arguments.repetitions or (2 if arguments.quick else 5)
    folder = arguments.out / f"budget-{scene.name.replace('/', '__')}"

    def solve(
        scenes: "Sequence[Scene]",
        place: str,
        solvers: tuple[str, ...],
        parameters: Mapping[str, Mapping[str, Any]] | None = None,
        timed: bool = False,
    ) -> "list[Solved]":
        announce(f"{place}: {', '.join(solvers)} on {', '.join(s.name for s in scenes)}")
        given = {name: dict(values) for name, values in (parameters or {}).items() if values}
        return _solved(scenes, folder / place, solvers, repetitions if timed else 1, given)

    study = budget_study(
        scene, arguments.level, arguments.tolerance, arguments.metric, _exact(scene), solve,
        arguments.quick,
    )  # fmt: skip
    for missing in study.missing:
        announce(f"not available: {missing.source}: {missing.reason} ({missing.where})")
    return study


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


def iterations(arguments: argparse.Namespace, announce: Announce) -> "IterationsStudy":
    """Solve a motion by every number of iterations and substeps."""
    from verify.scene import load_scene
    from verify.study.iterations import Grid, iterations_study
    from verify.study.measured_scenes import variant_of

    truth = arguments.truth or f"{arguments.solver} step=solved"
    grid = Grid(arguments.iterations, arguments.substeps, tuple(arguments.names), arguments.most)
    return iterations_study(
        load_scene(arguments.case), variant_of(arguments.solver), variant_of(truth), grid,
        arguments.tolerance, announce,
    )  # fmt: skip


def _coarsest(scene: "Scene", levels: int) -> "Scene":
    assert scene.mesh.cells is not None
    mesh = scene.mesh.model_copy(update={"cells": scene.mesh.cells[:levels]})
    return scene.model_copy(update={"mesh": mesh})


def _exact(scene: "Scene") -> Any:
    from reference.exact import exact_of

    return exact_of(scene) if scene.judged_by_exact else None


def _run(
    scenes: "Sequence[Scene]",
    folder: Path,
    solvers: tuple[str, ...],
    repetitions: int,
    parameters: dict[str, dict[str, Any]] | None = None,
    judged: bool = True,
) -> "list[CaseResult]":
    from verify.cli.progress import progress_on
    from verify.runner import Options, run_cases
    from verify.runner.fingerprint import cache_folder

    options = Options(
        solvers=solvers,
        repetitions=repetitions,
        parameters=parameters or {},
        cache=cache_folder(),
        judged=judged,
    )
    with progress_on(sys.stderr) as progress:
        return run_cases(scenes, folder, options, progress).results


def _solved(
    scenes: "Sequence[Scene]",
    folder: Path,
    solvers: tuple[str, ...],
    repetitions: int,
    parameters: dict[str, dict[str, Any]],
) -> "list[Solved]":
    """Run scenes by some solvers and no reference beside them, and read the solutions back."""
    from verify.runner.directory import RunDirectory
    from verify.solution import read_solution
    from verify.study.budget.links import Solved

    place = RunDirectory(folder)
    found = []
    results = _run(scenes, folder, solvers, repetitions, parameters, judged=False)
    for scene, result in zip(scenes, results, strict=True):
        solutions: dict[str, dict[int, Solution]] = {}
        for record in result.solves:
            if record.status == "solved":
                stem = place.solve_folder(scene.name, record.solver, record.level) / "solution"
                solutions.setdefault(record.solver, {})[record.level] = read_solution(stem)
        kept: Mapping[str, Mapping[int, Solution]] = solutions
        found.append(Solved(scene, result, kept))
    return found
