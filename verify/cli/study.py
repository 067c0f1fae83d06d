"""Measure what slivers do, what accuracy costs, where an error comes from, and more.

Examples
--------
  verify study slivers --quick --out studies
  verify study slivers --solver xfem --solver 'xfem slivers=merge' --out studies
  verify study energy --solver my_module:MySolver --out studies
  verify study thesis --quick --out studies
  verify study claims --out studies
  verify study calibration --quick --out studies
  verify study cost statics/tissue_strip --steps 4 --solver xfem --solver conforming --out studies
  verify study budget statics/tissue_strip --tolerance 0.05 --out studies
  verify study positions --solver xfem --solver conforming --out studies

Writes NAME.json, NAME.csv and NAME.html into the directory. Exit code 0 whatever the
findings say: they compare methods, most of which are known to fail somewhere.
"""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any, Literal

from verify.cli.signatures import Actions, Arg, Case, Out, Repetitions, count, positive, seed
from verify.cli.streams import command_line, print_answer
from verify.errors import InputError

if TYPE_CHECKING:
    from verify.scene import Scene
    from verify.study.measured_scenes import MeasuredStudy
    from verify.study.study import Making, Solved, Study

SLIVERS = ("slivers/*", "benchmark/c8_*")
_SOLVER = "'NAME [PARAMETER=VALUE …]'"
Quick = Annotated[bool, Arg(help="less of it, in under a minute")]
Tolerance = Annotated[float, Arg("T", read=positive, help="relative error that is good enough")]


@dataclass(frozen=True, kw_only=True)
class Answer:
    """Where a study writes, and how it says what it found.

    Attributes
    ----------
    as_json
        print the findings as JSON
    """

    out: Out
    as_json: Annotated[bool, Arg(flags=("--json",))] = False


@dataclass(frozen=True, kw_only=True)
class Measured:
    """What a study of measured scenes runs.

    Attributes
    ----------
    solvers
        solver, with parameters of its solves; repeat for several (default: xfem and conforming)
    processes
        processes side by side (default: all cores; nothing measured is a time)
    """

    solvers: Annotated[Sequence[str], Arg(_SOLVER, ("--solver",))] = ()
    processes: Annotated[int | None, Arg("N", ("-j", "--jobs"), count)] = None
    quick: Quick = False


def slivers(
    cases: Annotated[Sequence[str], Arg("CASE")] = (), *, measured: Measured, answer: Answer
) -> int:
    """Errors, conditioning and explicit steps of any solver, over families of scenes.

    Parameters
    ----------
    cases
        names, patterns or files; none: cases/slivers and C8
    """
    from verify.study.slivers import sliver_study

    return _over_scenes("slivers", sliver_study, cases or [*SLIVERS], None, measured, answer)


def energy(
    cases: Annotated[Sequence[str], Arg("CASE")] = (), *, measured: Measured, answer: Answer
) -> int:
    """What any solver keeps of energy and momenta, over cases that move.

    Parameters
    ----------
    cases
        names, patterns or files; none: those tagged energy
    """
    from verify.study.measured_scenes import energy_study

    tagged = None if cases else "energy"
    return _over_scenes("energy", energy_study, cases, tagged, measured, answer)


def thesis(*, quick: Quick = False, answer: Answer) -> int:
    """The tables and figures of the thesis measured again, its claims judged."""
    from verify.study.thesis import thesis_study

    return _written("thesis", answer, lambda making: thesis_study(making, quick))


def claims(*, answer: Answer) -> int:
    """Claims from the literature, measured where that can be done, and judged."""
    from verify.study.claims import claims_study

    return _written("claims", answer, claims_study)


def calibration(
    *, seed: Annotated[int, Arg("N", read=seed)] = 30, quick: Quick = False, answer: Answer
) -> int:
    """Stated uncertainty of the reference against its true error.

    Parameters
    ----------
    seed
        of the scenes
    """
    from verify.study.calibration import calibration_study

    return _written("calibration", answer, lambda making: calibration_study(making, quick, seed))


def cost(
    case: Case,
    *,
    steps: Annotated[int, Arg("N", read=count)] = 4,
    solvers: Annotated[Sequence[str], Arg("NAME", ("--solver",))] = (),
    metric: Literal["displacement_l2", "energy_norm", "jump_l2"] = "energy_norm",
    repetitions: Repetitions = 5,
    answer: Answer,
) -> int:
    """Work against precision while the first cut of a case grows, at equal accuracy.

    Parameters
    ----------
    steps
        steps of the cut
    solvers
        solver to compare; repeat for several (default: xfem and conforming, which remeshes at every
        step)
    metric
        the error that is held equal
    """
    from verify.result import folder_of_case
    from verify.runner.checking import check_solver_name
    from verify.scene import load_scene
    from verify.study.cost import cost_study, growing_scenes

    asked = tuple(dict.fromkeys(solvers)) or ("xfem", "conforming")

    def study(making: "Making") -> "Study":
        scene = load_scene(case)
        for name in asked:
            check_solver_name(name, "--solver")
        scenes = growing_scenes(scene, steps)
        # on the other mesh of this solver only the cut cells are made anew
        given = {"conforming": {"mesh": "remeshed"}} if "conforming" in asked else {}
        place = f"cost-{folder_of_case(scene.name)}"
        making.announce(f"{steps} steps of the cut '{scene.cuts[0].name}', into {place}")
        results = making.run(scenes, place, asked, repetitions, given)
        return cost_study(scene.name, results, metric)

    return _written("cost", answer, study)


def budget(
    case: Case,
    *,
    level: Annotated[int | None, Arg("K")] = None,
    tolerance: Tolerance = 0.05,
    metric: str | None = None,
    repetitions: Annotated[int | None, Arg("N", read=count)] = None,
    quick: bool = False,
    answer: Answer,
) -> int:
    """Where the error of the XFEM answer comes from, and the cheapest adequate model.

    Parameters
    ----------
    level
        mesh level that is taken apart (default: finest)
    metric
        displacement_l2, energy_norm (in motion their means, displacement_l2_mean, energy_norm_mean)
        or a quantity of the case (default: the first of these)
    repetitions
        timed repetitions of each solve (default: 5; with --quick 2)
    quick
        the two coarsest mesh levels, fewer models
    """
    from verify.result import folder_of_case
    from verify.scene import load_scene
    from verify.study.budget import budget_study

    timed_repetitions = repetitions or (2 if quick else 5)

    def study(making: "Making") -> "Study":
        scene, exact = load_scene(case), None
        if scene.judged_by_exact:
            from reference.exact import exact_of

            exact = exact_of(scene)

        def solve(
            scenes: "Sequence[Scene]",
            place: str,
            solvers: tuple[str, ...],
            parameters: Mapping[str, Mapping[str, Any]] | None = None,
            timed: bool = False,
        ) -> "list[Solved]":
            names = ", ".join(one.name for one in scenes)
            making.announce(f"{place}: {', '.join(solvers)} on {names}")
            times = timed_repetitions if timed else 1
            below = f"budget-{folder_of_case(scene.name)}/{place}"
            return making.solved(scenes, below, solvers, times, parameters)

        found = budget_study(scene, level, tolerance, metric, exact, solve, quick)
        for missing in found.missing:
            making.announce(f"not available: {missing.source}: {missing.reason} ({missing.where})")
        return found

    return _written("budget", answer, study)


def iterations(
    cases: Annotated[Sequence[str], Arg("CASE")],
    *,
    solver: Annotated[str, Arg(_SOLVER)] = "vbd",
    truth: Annotated[str | None, Arg(_SOLVER)] = None,
    iterations: Annotated[Sequence[int], Arg("N", read=count, nargs="+")] = (10, 40, 160),
    substeps: Annotated[Sequence[int], Arg("N", read=count, nargs="+")] = (1, 4),
    most: Annotated[int | None, Arg("N", read=count)] = None,
    work: Annotated[Sequence[int], Arg("N", read=count, nargs="+")] = (),
    names: Annotated[Sequence[str], Arg("PARAMETER", nargs=2)] = ("iterations", "substeps"),
    tolerance: Tolerance = 0.01,
    answer: Answer,
) -> int:
    """A solver in steps that stop by a count: its error over iterations and substeps.

    Parameters
    ----------
    cases
        names, patterns or files of cases that move or come to rest
    solver
        solver, with parameters of its solves
    truth
        who solves the same steps (default: the solver with step=solved)
    iterations
        values of the parameter 'iterations'
    substeps
        values of the parameter 'substeps'
    most
        leave out settings with more iterations than this in a step of the case
    work
        iterations in a step of the case to share out evenly over the substeps, beside --iterations
    names
        what the solver calls them
    """
    from verify.runner.selection import select_cases
    from verify.study.iterations import Grid, iterations_study
    from verify.study.measured_scenes import variant_of

    def study(making: "Making") -> "Study":
        scenes, own = select_cases(cases, None, "heavy"), variant_of(solver)
        steps = variant_of(truth or f"{solver} step=solved")
        grid = Grid(iterations, substeps, (names[0], names[1]), most, work)
        return iterations_study(scenes, own, steps, grid, tolerance, making)

    return _written("iterations", answer, study)


def positions(
    cases: Annotated[Sequence[str], Arg("CASE")] = (),
    *,
    solvers: Annotated[Sequence[str], Arg(_SOLVER, ("--solver",))] = (),
    positions: Annotated[int, Arg("N", read=count)] = 16,
    level: Annotated[int | None, Arg("K")] = None,
    answer: Answer,
) -> int:
    """How much of a difference of two solvers is where the cut passes the mesh.

    Parameters
    ----------
    cases
        names, patterns or files; none: six scenes of the study
    solvers
        solver, with parameters of its solves; repeat for several (default: xfem and conforming)
    positions
        meshes of each scene, up to 16
    level
        mesh level that is solved (default: the level of the study, else the coarsest)
    """
    from verify.runner.selection import select_cases
    from verify.scene.mesh_position import POSITIONS
    from verify.study.measured_scenes import variant_of
    from verify.study.positions import SCENES, positions_study

    if positions > POSITIONS:
        raise InputError(f"{positions}; a mesh has {POSITIONS}", "--positions")

    def study(making: "Making") -> "Study":
        names = list(dict.fromkeys(variant_of(s).label for s in solvers or ("xfem", "conforming")))
        levels = [
            (scene, SCENES.get(scene.name, 0) if level is None else level)
            for scene in select_cases(cases or list(SCENES), None, "heavy")
        ]
        return positions_study(levels, names, positions, making)

    return _written("positions", answer, study)


def _over_scenes(
    kind: str,
    made: "Callable[..., MeasuredStudy]",
    cases: Sequence[str],
    expression: str | None,
    measured: Measured,
    answer: Answer,
) -> int:
    """Make a study of measured scenes over the cases and solvers that are asked for."""
    from verify.runner.selection import select_cases
    from verify.study.measured_scenes import variant_of

    named = bool(cases) and list(cases) != [*SLIVERS]
    weight = "quick" if measured.quick and not named else "heavy"
    processes = measured.processes or len(os.sched_getaffinity(0))

    def study(making: "Making") -> "Study":
        scenes = select_cases(cases, expression, weight)
        variants = [variant_of(text) for text in measured.solvers or ("xfem", "conforming")]
        return made(scenes, variants, replace(making, processes=processes), measured.quick)

    return _written(kind, answer, study)


def _written(kind: str, answer: Answer, study: "Callable[[Making], Study]") -> int:
    """Make a study, write its record and table, render its page, and say what it found."""
    from verify.cli.progress import progress_on
    from verify.report.study_page import render_study
    from verify.study.study import Making, make_directory, write_study

    def announce(text: str) -> None:
        print(text, file=sys.stderr, flush=True)

    new, start = not answer.out.exists(), perf_counter()
    make_directory(answer.out)  # before minutes of work
    making = Making(answer.out, announce, progress=lambda: progress_on(sys.stderr))
    try:
        found = study(making)
        found = replace(found, seconds=perf_counter() - start)
    except InputError:
        if new:
            with suppress(OSError):  # something is in it
                answer.out.rmdir()
        raise
    written = write_study(answer.out, kind, found, command_line())
    page = render_study(answer.out, kind)
    lines = [
        f"{one.verdict or 'shown'}: {one.topic}: {one.sentence} [expected: {one.expected}]"
        for one in found.findings
    ]
    findings = [asdict(one) for one in found.findings]
    content = {"record": str(written), "report": str(page), "findings": findings}
    return print_answer(answer.as_json, content, [*lines, f"report: {page}"])


ACTIONS = Actions(
    (slivers, energy, thesis, claims, calibration, cost, budget, iterations, positions),
    metavar="STUDY",
)
