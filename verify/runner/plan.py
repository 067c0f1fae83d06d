"""From cases to solves: which solvers, which levels, what they refuse."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from time import sleep
from typing import Any

from verify.errors import InputError
from verify.result import SolveRecord, Status
from verify.runner.asking import Asking
from verify.runner.child import POLL_SECONDS
from verify.runner.directory import RunDirectory
from verify.runner.fingerprint import code_of_solver, digest_of, physics_digest
from verify.runner.interruption import StopRequest
from verify.runner.job import Job
from verify.runner.options import Options
from verify.runner.reference_bundle import ReferenceBundle
from verify.runner.reference_cache import REFERENCE
from verify.scene import Scene
from verify.scene.nearest import nearest
from verify.solvers.named import parameters_of

Survey = dict[str, dict[str, Any]]


@dataclass
class CasePlan:
    """The solves of one case, and the records of those that are known not to run.

    `spare` are levels of the reference that are solved only if the others do not suffice, `models`
    those of other models, whose scenes are `other_scenes`.
    """

    scene: Scene
    solvers: list[str]
    jobs: list[Job] = field(default_factory=list)
    refused: list[tuple[Job, SolveRecord]] = field(default_factory=list)
    spare: list[Job] = field(default_factory=list)
    models: list[Job] = field(default_factory=list)
    other_scenes: dict[str, Scene] = field(default_factory=dict)

    def scene_of(self, job: Job) -> Scene:
        """Return the scene that a job solves: that of the case, or of another model of it."""
        return self.other_scenes.get(job.model, self.scene)


def solvers_of(scene: Scene, options: Options) -> list[str]:
    """Return the names of the solvers that a run of `scene` takes, the reference last."""
    named = [check.solver for check in scene.acceptance if check.solver is not None]
    named += [check.compared for check in scene.acceptance if check.compared]
    names = list(dict.fromkeys(options.solvers or ("xfem", "conforming", *named)))
    if options.judged and not scene.judged_by_exact and REFERENCE not in names:
        names.append(REFERENCE)
    return names


def check_judged(scenes: Sequence[Scene], options: Options) -> None:
    """Raise `InputError` if a solver that shall be judged is asked in none of `scenes`."""
    asked = sorted({name for scene in scenes for name in solvers_of(scene, options)})
    for name in options.judge_only:
        if name not in asked:
            raise InputError(f"solver '{name}' is not asked{nearest(name, asked)}", "--judge")


def survey_solvers(
    scenes: Sequence[Scene],
    options: Options,
    stop: StopRequest,
    bundle: ReferenceBundle | None = None,
) -> Survey:
    """Ask each solver, in a process of its own, what it refuses and how many levels it has.

    The reference is not asked if there is a `bundle`, so that it need not be installed.

    Raises
    ------
    InputError
        If a scene names something bad (a mesh file), the bundle lacks a scene, or `options`
        name a solver that does not work here, or a parameter that it does not have. A solver
        that only the cases want may be missing: its solves fail, with that reason. One that hangs,
    dies or answers nonsense when it is asked fails on that case.
    RunStoppedError
        If a signal came.
    """
    asked: dict[str, list[Scene]] = {}
    for scene in scenes:
        for name in solvers_of(scene, options):
            asked.setdefault(name, []).append(scene)
    answers: Survey = {}
    if bundle is not None and (judged := asked.pop(REFERENCE, [])):
        levels = {scene.name: bundle.levels(scene) for scene in judged}
        cases = {name: {"levels": n, "refusal": None} for name, n in levels.items()}
        answers[REFERENCE] = {"error": None, "cases": cases}
    with tempfile.TemporaryDirectory(prefix="verify-") as folder:
        waiting = list(asked)
        running: dict[str, Asking] = {}
        try:
            while waiting or running:
                stop.check()
                while waiting and len(running) < options.jobs:
                    name = waiting.pop(0)
                    running[name] = Asking(
                        name,
                        asked[name],
                        parameters_of(name, options.parameters),
                        Path(folder, str(len(asked) - len(waiting))),
                        options.timeout,
                        options.memory,
                    )
                for name, asking in list(running.items()):
                    if (answer := asking.poll()) is not None:
                        answers[name] = answer
                        del running[name]
                sleep(POLL_SECONDS)
        finally:
            for asking in running.values():
                asking.kill()
    for name, answer in answers.items():
        if answer["error"] and name in options.solvers:
            raise InputError(answer["error"], "--solver")
        if bad := answer.get("bad_parameter"):
            raise InputError(bad, "--solver" if " " in name else "--set")
        for scene in asked.get(name, []):
            bad = answer.get("cases", {}).get(scene.name, {}).get("bad_input")
            if bad:
                raise InputError(
                    bad, "" if str(scene.file) in bad else str(scene.file or scene.name)
                )
    return answers


def plan_case(
    scene: Scene,
    options: Options,
    survey: Survey,
    directory: RunDirectory,
    bundle: ReferenceBundle | None = None,
) -> CasePlan:
    """Lay out the solves of `scene`, coarse to fine."""
    plan = CasePlan(scene, solvers_of(scene, options))
    physics = physics_digest(scene)
    for name in plan.solvers:
        answer = survey[name]
        parameters = parameters_of(name, options.parameters)
        code = [code_of_solver(name), answer.get("source", "")]
        asked = answer.get("cases", {}).get(scene.name, {})
        planned = asked.get("levels", 0)
        most = planned
        if name == REFERENCE and bundle is None and not scene.judged_by_exact:
            most = max(planned, scene.reference.max_levels or 0)
        jobs = [
            Job(
                case=scene.name,
                solver=name,
                level=level,
                repetitions=options.repetitions,
                key=bundle.key(scene, level)
                if bundle is not None and name == REFERENCE
                else digest_of([physics, name, level, options.repetitions, parameters, code]),
                folder=directory.solve_folder(scene.name, name, level),
                parameters=parameters,
            )
            for level in range(max(most, 1))
        ]
        if answer["error"]:
            plan.refused.append((jobs[0], jobs[0].blank(Status.FAILED, answer["error"])))
        elif failure := asked.get("failure"):
            status = Status(asked.get("status", Status.FAILED))
            plan.refused.append((jobs[0], jobs[0].blank(status, failure)))
        elif asked["refusal"]:
            plan.refused.append((jobs[0], jobs[0].blank(Status.REFUSED, asked["refusal"])))
        else:
            plan.jobs += jobs[:planned]
            plan.spare += jobs[planned:most]
    if options.judged and bundle is None and scene.adequacy.models:
        # what only reads cases shall not wait for the comparison that this imports
        from verify.runner.models import model_jobs

        folder = directory.case_folder(scene.name)
        plan.models, plan.other_scenes = model_jobs(scene, folder)
    return plan
