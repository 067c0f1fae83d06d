"""From cases to solves: which solvers, which levels, in which order.

The reference gets more levels than its scene names while they are needed. It also solves the other
models of a case with an [adequacy] table.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from verify.errors import InputError, UnsupportedSceneError
from verify.printable import duration_text
from verify.result import CaseResult, SolveRecord, Status
from verify.runner.cost import LevelCost, case_cost, coarser_reference, finer_costs
from verify.runner.directory import Job, RunDirectory, load_record, stored_record
from verify.runner.fingerprint import code_of_solver, digest_of, physics_digest, reference_digest
from verify.runner.loading import Loaded
from verify.runner.references import REFERENCE, ReferenceBundle, bundle_of_case
from verify.runner.selection import Options
from verify.scene import Scene
from verify.scene.strict import nearest
from verify.solvers.interface import is_installed, parameters_of

_FEWEST = 3  # levels from which a reference has an error bar


@dataclass
class CasePlan:
    """The solves of one case.

    Level 0 of each solver is laid out at once; it says whether the solver takes the case, and how
    many levels there are, and the others follow then. The reference is held back until a solver
    has not refused the case: if all do, there is nothing to be judged.

    Attributes
    ----------
    scene : Scene
    solvers : list of str
        The reference last.
    job_of : callable
        Makes a job from solver and level.
    jobs : list of Job
        All that run, have run or are held back.
    refused : list of (Job, SolveRecord)
        The records of those that are known not to run.
    spare : list of Job
        Levels of the reference that are solved only if the others do not suffice.
    most_levels : int
        Of the reference, with spare ones.
    models : list of Job
        Of other models, whose scenes are `other_scenes`.
    held : list of Job
        Those that wait for a solver that does not refuse.
    awaited : dict of str to int
        How many levels are expected to follow level 0, by solver.
    bundle : ReferenceBundle or None
        That the reference is taken from: of the run, or beside the case.
    within : float or None
        Seconds within which the levels of the reference that are solved shall end.
    coarser : int
        How many times as large as the case asks the elements of its reference are, to that end.
    imported : list of Path
        Folders of answers of other programs, compared with the solves.
    """

    scene: Scene
    solvers: list[str]
    job_of: Callable[[str, int], Job]
    jobs: list[Job] = field(default_factory=list)
    refused: list[tuple[Job, SolveRecord]] = field(default_factory=list)
    spare: list[Job] = field(default_factory=list)
    most_levels: int = 0
    models: list[Job] = field(default_factory=list)
    other_scenes: dict[str, Scene] = field(default_factory=dict)
    held: list[Job] = field(default_factory=list)
    awaited: dict[str, int] = field(default_factory=dict)
    bundle: ReferenceBundle | None = None
    within: float | None = None
    coarser: int = 1
    imported: list[Path] = field(default_factory=list)

    @property
    def count(self) -> int:
        """Number of solves that are known or expected."""
        known = len(self.jobs) + len(self.refused) + len(self.models)
        return known + sum(self.awaited.values())

    def scene_of(self, job: Job) -> Scene:
        """Return the scene that a job solves: the case, or another model of it."""
        return self.other_scenes.get(job.model, self.scene)

    def ordered(self) -> list[Job]:
        """Return the case's own jobs by solver and level."""
        jobs = [*self.jobs, *(job for job, _ in self.refused)]
        return sorted(jobs, key=lambda job: (self.solvers.index(job.solver), job.level))

    def following(self, job: Job, record: SolveRecord, levels: int) -> list[Job]:
        """Return what may begin now that a job has ended: after level 0, the other levels.

        Parameters
        ----------
        job : Job
        record : SolveRecord
            Of `job`.
        levels : int
            Of the solver; 0 if it has not reported them.
        """
        if job.level or job.model or job.solver not in self.awaited:
            return []
        del self.awaited[job.solver]
        new = [self.job_of(job.solver, level) for level in range(1, levels)]
        if job.solver == REFERENCE and levels:
            more = range(levels, max(levels, self.most_levels))
            self.spare = [self.job_of(REFERENCE, level) for level in more]
        while self.spare and stored_record(self.spare[0]) is not None:
            new.append(self.spare.pop(0))  # an interrupted or earlier run has solved it
        self.jobs += new
        if record.status is not Status.REFUSED:
            new, self.held = new + self.held, []
        elif self.held and set(self.awaited) == {REFERENCE}:  # all have refused
            self.jobs = [own for own in self.jobs if own not in self.held]
            self.held, self.models, self.other_scenes, self.awaited = [], [], {}, {}
        return new


def solvers_of(scene: Scene, options: Options) -> list[str]:
    """Return the names of the solvers that a run of `scene` takes, the reference last."""
    named = _named(scene, options)
    if options.judged and not scene.judged_by_exact and REFERENCE not in named:
        named.append(REFERENCE)
    return named


def _named(scene: Scene, options: Options) -> list[str]:
    """Names of the solvers that the command line or else the checks ask for."""
    compared = [check.compared for check in scene.acceptance if check.compared]
    if options.imported:
        installed = [name for name in compared if is_installed(name)]
        beside = dict.fromkeys([*options.solvers, *installed])
        return [name for name in beside if name not in options.imported]
    checks = [check.solver for check in scene.acceptance if check.solver is not None]
    return list(dict.fromkeys(options.solvers or ("xfem", "conforming", *checks, *compared)))


def check_judged(scenes: Sequence[Scene], options: Options) -> None:
    """Raise `InputError` if a solver that shall be judged is asked in none of `scenes`."""
    asked = sorted({name for scene in scenes for name in solvers_of(scene, options)})
    for name in options.judge_only:
        if name not in asked:
            raise InputError(f"solver '{name}' is not asked{nearest(name, asked)}", "--judge")


def stored_beside(scene: Scene, options: Options) -> ReferenceBundle | None:
    """Return the bundle beside a case, if a run with `options` takes its reference from there."""
    as_stored = options.cache and not parameters_of(REFERENCE, options.parameters)
    return bundle_of_case(scene) if as_stored else None


def plan_case(
    scene: Scene,
    options: Options,
    loaded: Mapping[str, Loaded],
    directory: RunDirectory,
    bundle: ReferenceBundle | None = None,
) -> CasePlan:
    """Lay out the solves of `scene` that are known before any has run."""
    kept = bundle or stored_beside(scene, options)
    coarser = 1
    if options.within and kept is None:
        scene, coarser = coarser_reference(scene, options.within)
    solvers = solvers_of(scene, options)
    asked, judging = physics_digest(scene), reference_digest(scene)
    found = {name: loaded.get(name, Loaded()) for name in solvers}

    def job_of(name: str, level: int) -> Job:
        parameters = parameters_of(name, options.parameters)
        code = [code_of_solver(name), found[name].source]
        physics = judging if name == REFERENCE else asked
        repetitions, folder = options.repetitions, directory.solve_folder(scene.name, name, level)
        key = digest_of([physics, name, level, repetitions, parameters, code])
        if kept and name == REFERENCE:
            key = kept.key(scene, level)
        return Job(scene.name, name, level, repetitions, key, folder, parameters)

    within = None if kept else options.within
    plan = CasePlan(scene, solvers, job_of, bundle=kept, within=within, coarser=coarser)
    plan.imported = [
        folder for name in options.imported for folder in directory.solves(scene.name, name)
    ]
    for name in plan.solvers:
        job = job_of(name, 0)
        if (error := found[name].error) and not (kept and name == REFERENCE):
            plan.refused.append((job, job.blank(Status.FAILED, error)))
            continue
        plan.jobs.append(job)
        expected = scene.reference.levels if name == REFERENCE else scene.mesh.count
        plan.awaited[name] = expected - 1
    if kept is None and not scene.judged_by_exact and not within:
        plan.most_levels = scene.reference.max_levels or 0
    if options.judged and bundle is None and scene.adequacy.models:
        folder = directory.case_folder(scene.name)
        plan.models, plan.other_scenes = model_jobs(scene, folder)
    others = [job for job in plan.jobs if job.solver != REFERENCE]
    answered = any(load_record(one).status is Status.SOLVED for one in plan.imported)
    if plan.refused or answered or REFERENCE in _named(scene, options):
        return plan
    if others:
        plan.held = [*(job for job in plan.jobs if job.solver == REFERENCE), *plan.models]
    elif plan.imported:  # a program that does not take the case
        plan.jobs, plan.models, plan.other_scenes, plan.awaited = [], [], {}, {}
    return plan


def start_order(plans: Sequence[CasePlan], options: Options) -> Callable[[Job], tuple[Any, ...]]:
    """Return the key by which the solves of a run are sorted as they are begun.

    One after the other they keep the order of the plans. Side by side, the longest case by the
    forecast is begun first: short ones then fill all processes to the end. In each case level 0 of
    each solver comes first, then the reference from coarse to fine.

    A solve of a guest that was begun and left no record comes last: it may end the run once more.
    """
    one_by_one = options.jobs == 1 and not options.cluster

    def spent(plan: CasePlan) -> float:
        solved = [name for name in plan.solvers if name != REFERENCE or plan.bundle is None]
        return sum(row.seconds for row in case_cost(plan.scene, solved, options.repetitions))

    ordered = plans if one_by_one else sorted(plans, key=spent, reverse=True)
    place = {p.scene.name: (i, [*p.solvers, REFERENCE]) for i, p in enumerate(ordered)}

    def key(job: Job) -> tuple[Any, ...]:
        begun = (job.folder / "job.json").exists() and not (job.folder / "record.json").exists()
        case, solvers = place[job.case]
        own = (bool(job.model), solvers.index(job.solver), job.level)
        first = 0 if one_by_one else 1 if job.solver == REFERENCE else 2 if job.level else 0
        return (begun and job.solver != REFERENCE, case, first, *own)

    return key


def model_jobs(scene: Scene, folder: Path) -> tuple[list[Job], dict[str, Scene]]:
    """Lay out the reference's solves of the other models of a scene.

    Parameters
    ----------
    scene : Scene
    folder : Path
        Of the case.

    Returns
    -------
    jobs : list of Job
        Each with its ``model``.
    scenes : dict of str to Scene
        By model.
    """
    # commands that only read cases shall not wait for the comparison that this imports
    from verify.judge.models import other_scene

    jobs, scenes = [], {}
    for model in scene.adequacy.models:
        try:
            other = other_scene(scene, model)
        except UnsupportedSceneError:  # the comparison says so
            continue
        scenes[model] = other
        physics, code = reference_digest(other), code_of_solver(REFERENCE)
        for level in range(other.reference.levels):
            key = digest_of([physics, REFERENCE, level, 1, {}, code])
            place = folder / f"{REFERENCE}_{model}-{level}"
            jobs.append(Job(scene.name, REFERENCE, level, 1, key, place, model=model))
    return jobs, scenes


def next_level(plan: CasePlan, result: CaseResult) -> Job | None:
    """Take the next level of the reference out of the plan's spare ones, if it is needed.

    It is needed if all levels so far are solved and the half-width of the reference is above a
    tenth of an error.

    Parameters
    ----------
    plan : CasePlan
        Changed: the level that is returned is one of its jobs from then on.
    result : CaseResult
        The judgement by the levels so far.
    """
    if not plan.spare or result.reference.suffices is not False:
        return None
    own = [solve for solve in result.solves if solve.solver == REFERENCE]
    if any(solve.status is not Status.SOLVED for solve in own):
        return None
    plan.jobs.append(plan.spare.pop(0))
    return plan.jobs[-1]


def unneeded_levels(
    plan: CasePlan, failed: Job, record: SolveRecord, waiting: Collection[Job]
) -> list[tuple[Job, SolveRecord]]:
    """List the levels of a reference that need not be solved, each with a record that says so.

    These wait when one has failed and too few are left for the reference to have an error bar:
    nothing is judged by it then.

    Parameters
    ----------
    plan : CasePlan
        Of the case; references of other models and of exact cases are left alone.
    failed : Job
    record : SolveRecord
        Of `failed`.
    waiting : collection of Job
        Of all cases.
    """
    if (
        failed.solver != REFERENCE
        or record.status is Status.SOLVED
        or plan.scene.judged_by_exact
        or failed not in plan.jobs
    ):
        return []
    levels = [job for job in plan.jobs if job.solver == REFERENCE]
    if len(levels) > _FEWEST:
        return []
    reason = (
        f"not tried: level {failed.level} has no answer ({record.status}), and a reference "
        f"needs {_FEWEST} levels"
    )
    return [(job, job.blank(Status.FAILED, reason)) for job in levels if job in waiting]


def forecast_levels(plan: CasePlan, solved: Job, record: SolveRecord) -> list[LevelCost]:
    """Forecast the finer levels of a case's own reference when one is solved."""
    own = solved.solver == REFERENCE and not solved.model and not plan.scene.judged_by_exact
    if not own or record.status is not Status.SOLVED:
        return []
    return finer_costs(plan.scene, record, plan.scene.reference.levels)


def late_levels(
    plan: CasePlan, solved: Job, records: Sequence[SolveRecord], waiting: Collection[Job]
) -> list[tuple[Job, SolveRecord]]:
    """List the levels of a reference that would end too late, each with a record that says so.

    Parameters
    ----------
    plan : CasePlan
    solved : Job
        A level of its reference.
    records : sequence of SolveRecord
        Of all levels that are solved, `solved` last.
    waiting : collection of Job
        Of all cases.
    """
    if plan.within is None or not records:
        return []
    spent = sum(record.wall or 0.0 for record in records)
    late: list[tuple[Job, SolveRecord]] = []
    for row in forecast_levels(plan, solved, records[-1]):
        spent += row.seconds
        job = plan.job_of(REFERENCE, row.level)
        if job in waiting and (late or spent > plan.within):
            reason = (
                f"left out: levels to {row.level} are expected to take {duration_text(spent)}, and "
                f"--within asks for {duration_text(plan.within)}"
            )
            late.append((job, job.blank(Status.REFUSED, reason)))
    return late
