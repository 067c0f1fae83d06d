"""Work of a run: solves and comparisons that wait, run or are done."""

import os
from bisect import insort
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from time import sleep
from typing import Any, Protocol

from verify.errors import InputError
from verify.files import read_json, write_json, write_whole
from verify.printable import one_line
from verify.processes import memory_limit
from verify.result import FORECAST, LOG, WITHIN, CaseResult, SolveRecord, Status, write_result
from verify.runner.child import POLL_SECONDS, Child, Ending, death
from verify.runner.comparing import Comparison, comparison_label, stored_result
from verify.runner.cost import forecast_text
from verify.runner.directory import (
    LEVELS,
    Job,
    RunDirectory,
    emptied,
    load_record,
    outcome_in,
    reported_levels,
    store_record,
    stored_record,
)
from verify.runner.engines import ClusterEngine, RemoteSolve, solving
from verify.runner.fingerprint import code_of_comparison, digest_of
from verify.runner.plan import (
    CasePlan,
    forecast_levels,
    late_levels,
    next_level,
    start_order,
    unneeded_levels,
)
from verify.runner.references import REFERENCE, ReferenceBundle, ReferenceCache
from verify.runner.selection import Options
from verify.scene import RatioCheck, Scene, scene_content

Running = Child | RemoteSolve


class Families:
    """The scenes of a run, and which of them wait for which.

    Parameters
    ----------
    scenes : iterable of Scene
    judge_only : sequence of str
        Solvers that are judged; empty: all.
    """

    def __init__(self, scenes: Iterable[Scene], judge_only: Sequence[str] = ()) -> None:
        self._judge_only = judge_only
        self._scenes = {scene.name: scene for scene in scenes}
        self._rows: dict[str, dict[float, str]] = {}
        for name, scene in self._scenes.items():
            if scene.row is not None:
                self._rows.setdefault(scene.row.family, {})[scene.row.value] = name
        self._compared: dict[str, CaseResult] = {}
        self._waiting: dict[str, CaseResult] = {}

    def ready(self, result: CaseResult) -> list[CaseResult]:
        """Take a result of the comparison; return those that are judged in full by now."""
        self._compared[result.case] = self._waiting[result.case] = result
        done = []
        for name, waiting in list(self._waiting.items()):
            rows = self._needed(self._scenes[name])
            if all(row in self._compared for row in rows.values()):
                del self._waiting[name]
                others = {value: self._compared[row] for value, row in rows.items()}
                done.append(self._judged(name, waiting, others))
        return done

    def _needed(self, scene: Scene) -> dict[float, str]:
        """Names of the rows of this run that `scene` is compared with, by their value."""
        if scene.row is None:
            return {}
        rows = self._rows[scene.row.family]
        return {value: rows[value] for value in _rows_asked(scene) if value in rows}

    def _judged(self, name: str, result: CaseResult, others: dict[float, CaseResult]) -> CaseResult:
        scene = self._scenes[name]
        # without a reference its comparison failed, and its verdicts say so
        if not _rows_asked(scene) or result.reference.kind is None:
            return result
        from verify.judge.verdict import with_verdicts  # loads the comparison: only where needed

        return with_verdicts(scene, result, self._judge_only, others)


def _rows_asked(scene: Scene) -> set[float]:
    checks = [check for check in scene.acceptance if isinstance(check, RatioCheck)]
    return {check.row for check in checks if check.row is not None}


class Progress(Protocol):
    """Receiver of the progress of a run."""

    def planned(self, solves: int, cases: int) -> None:
        """Report how much there is to do; repeated when that changes."""

    def started(self, label: str) -> None:
        """Report that a solve or a comparison begins."""

    def solved(self, label: str, record: SolveRecord, reused: bool) -> None:
        """Report that a solve ended."""

    def judged(self, result: CaseResult) -> None:
        """Report that a case is compared and judged."""


class Work:
    """The state of a run."""

    def __init__(
        self,
        plans: list[CasePlan],
        directory: RunDirectory,
        options: Options,
        origin: dict[str, Any],
        progress: Progress,
        bundle: ReferenceBundle | None,
        cluster: ClusterEngine | None,
    ) -> None:
        cache = ReferenceCache(options.cache) if options.cache else None
        self.references: ReferenceBundle | ReferenceCache | None = bundle or cache
        self.directory, self.options, self.origin = directory, options, origin
        self.progress, self.reused = progress, 0
        self.plans = {plan.scene.name: plan for plan in plans}
        self.start_order = start_order(plans, options)
        self.waiting: list[Job] = []
        self.running: dict[Running, Job] = {}
        for plan in plans:
            self._wait(job for job in (*plan.jobs, *plan.models) if job not in plan.held)
        self.to_judge = [name for name in self.plans if not self._is_open(name)]
        self.comparing: list[Comparison] = []
        self.results: dict[str, CaseResult] = {}
        self.families = Families((plan.scene for plan in plans), options.judge_only)
        self.records: dict[Path, bytes] = {}  # as they were written
        self.again: set[Path] = set()
        side_by_side = max(1, min(options.jobs, sum(plan.count for plan in plans)))
        self.memory = memory_limit(options.memory, side_by_side)
        self.cluster = cluster

    def until_done(self, check: Callable[[], None]) -> list[CaseResult]:
        """Run everything; kill what runs if that fails, or if `check`, called in turn, raises."""
        self._say_plan()
        try:
            for plan in self.plans.values():
                self._prepare(plan)
            while self._unfinished():
                check()
                while self._has_room():
                    self._start()
                self._take_from_bundle()
                for solve, job in list(self.running.items()):
                    if (ending := solve.poll()) is not None:
                        del self.running[solve]
                        self._ended(job, solve, ending)
                for comparison in list(self.comparing):
                    if (result := comparison.poll()) is not None:
                        self.comparing.remove(comparison)
                        self._case_done(result)
                sleep(POLL_SECONDS)
            check()  # asked while the last of it ended
        finally:
            for solve in self.running:
                solve.kill()
            for comparison in self.comparing:
                comparison.kill()
            if self.cluster is not None:
                self.cluster.close()
        return [self.results[name] for name in self.plans]

    def _say_plan(self) -> None:
        self.progress.planned(sum(plan.count for plan in self.plans.values()), len(self.plans))

    def _wait(self, jobs: Iterable[Job]) -> None:
        """Have jobs wait for their turn."""
        for job in jobs:
            insort(self.waiting, job, key=self.start_order)

    def _is_open(self, case: str) -> bool:
        """Whether a solve of a case is to come or to end."""
        return any(job.case == case for job in (*self.waiting, *self.running.values()))

    def _unfinished(self) -> bool:
        return any((self.waiting, self.to_judge, self.running, self.comparing))

    def _has_room(self) -> bool:
        """Whether something can be started: solves run where the engine is, all else here."""
        if self._has_room_here():
            return True
        if self.cluster is not None:
            return bool(self.waiting) and len(self.running) < self.cluster.width
        return bool(self.waiting) and self._here() < self.options.jobs

    def _has_room_here(self) -> bool:
        return bool(self.to_judge) and self._here() < self.options.jobs

    def _here(self) -> int:
        """Count the processes that run here."""
        solves = 0 if self.options.cluster else len(self.running)
        return solves + len(self.comparing)

    def _prepare(self, plan: CasePlan) -> None:
        self._restore(plan, ())
        for job, record in plan.refused:
            self._kept(job, record)
            self.progress.solved(job.label, record, reused=False)

    def _start(self) -> None:
        if self._has_room_here():
            first = min(self.to_judge, key=list(self.plans).index)
            self.to_judge.remove(first)
            self._judge(first)
        else:
            self._begin(self.waiting.pop(0))

    def _take_from_bundle(self) -> None:
        """Unpack one reference while all processes are busy: cases that need one come no later."""
        for job in self.waiting:
            if job.solver == REFERENCE and not job.model and self.plans[job.case].bundle:
                self.waiting.remove(job)
                self._begin(job)
                break

    def _begin(self, job: Job) -> None:
        """Take over a solve that is known, or start it."""
        if (record := stored_record(job)) is not None:
            self.reused += 1
            self.records[job.folder] = (job.folder / "record.json").read_bytes()
            self._solve_done(job, record, reused=True)
            return
        emptied(job.folder)
        if (record := self._known(job)) is not None:
            self.reused += 1
            self._solve_done(job, self._kept(job, record), reused=True)
            return
        content = {
            "scene": scene_content(self.plans[job.case].scene_of(job)),
            "solver": job.solver,
            "level": job.level,
            "repetitions": job.repetitions,
            "parameters": job.parameters,
            "ranks": self.options.ranks if job.solver == REFERENCE else 1,
            "tell_levels": not (job.level or job.model),
        }
        write_json(content, job.folder / "job.json")
        if self.cluster is not None:
            solve: Running = self.cluster.start(content, job.folder)
        else:
            solve = solving(content, job.folder, self.options.timeout, self.memory)
        self.running[solve] = job
        self.progress.started(job.label)

    def _known(self, job: Job) -> SolveRecord | None:
        """Take a reference from the bundle or the cache."""
        plan = self.plans[job.case]
        scene, kept = plan.scene_of(job), self.references if job.model else plan.bundle
        kept = kept or self.references
        if job.solver != REFERENCE or kept is None:
            return None
        record = kept.take(scene, job)
        if record is not None and not job.level:
            write_whole(job.folder / LEVELS, str(kept.levels(scene)))
        return record

    def _ended(self, job: Job, solve: Running, ending: Ending) -> None:
        record = self._record(job, solve, ending)
        if job.solver == REFERENCE and isinstance(self.references, ReferenceCache):
            trouble = self.references.keep(self.plans[job.case].scene_of(job), job, record)
            if trouble:
                record.notes["cache"] = trouble
        self._note_forecast(job, record)
        record = self._kept(job, record)
        self._solve_done(job, record, reused=False)

    def _note_forecast(self, job: Job, record: SolveRecord) -> None:
        """Note what finer levels of a reference will take, and whether its elements are larger."""
        plan = self.plans[job.case]
        if finer := forecast_levels(plan, job, record):
            limits = self.options.timeout, self.memory
            record.notes[FORECAST] = forecast_text(plan.scene, finer, *limits)
        if plan.coarser > 1 and job.solver == REFERENCE:
            times = f"elements {plan.coarser} times as large as the case asks"
            record.notes[WITHIN] = f"{times}: --within {self.options.within:g}"

    def _kept(self, job: Job, record: SolveRecord) -> SolveRecord:
        """Store a record; its solution may be gone, or be removed by a solver later."""
        job.folder.mkdir(parents=True, exist_ok=True)
        try:
            store_record(job, record)
        except (InputError, FileNotFoundError) as error:
            reason = f"its solution is not there any more ({one_line(error)})"
            record = job.blank(Status.FAILED, reason)
            store_record(job, record)
        self.records[job.folder] = (job.folder / "record.json").read_bytes()
        return record

    def _record(self, job: Job, child: Running, ending: Ending) -> SolveRecord:
        if (outcome := outcome_in(job.folder)) is None:
            blank = job.blank(*death(child.log, ending, self.options.timeout, self.memory))
            record = replace(blank, wall=ending.wall, peak_memory=ending.peak)
        else:
            peak = max(ending.peak, outcome.pop("peak_memory", None) or 0.0)
            blank = job.blank(outcome.pop("status"), outcome.pop("reason"))
            record = replace(blank, wall=ending.wall, peak_memory=peak, **outcome)
            if ending.killed_for:
                record.notes["ended"] = f"had answered, and was killed for its {ending.killed_for}"
        if note := self._contention():
            record.notes["timing"] = note
        if record.status in (Status.FAILED, Status.TIMEOUT, Status.MEMORY):
            record.notes[LOG] = self._relative(child.log)
        return record

    def _relative(self, path: Path) -> str:
        return os.path.relpath(path, self.directory.root)

    def _contention(self) -> str:
        if self.options.cluster:
            return f"on a worker of {self.options.cluster}: other solves may have run beside it"
        if self.options.jobs > 1:
            return f"contended: up to {self.options.jobs} processes at the same time"
        if self.origin["load"] > self.origin["cores"]:
            return f"contended: load {self.origin['load']} on {self.origin['cores']} cores"
        return ""

    def _solve_done(self, job: Job, record: SolveRecord, reused: bool) -> None:
        self.progress.solved(job.label, record, reused)
        plan = self.plans[job.case]
        before = plan.count
        self._wait(plan.following(job, record, reported_levels(job)))
        if plan.count != before:
            self._say_plan()
        left_out = unneeded_levels(plan, job, record, self.waiting)
        if job.solver == REFERENCE and "cache" not in record.notes:
            left_out += late_levels(plan, job, self._levels_until(job, plan), self.waiting)
        for other, without in left_out:
            self.waiting.remove(other)
            self.progress.solved(other.label, self._kept(other, without), reused=False)
        if not self._is_open(job.case):
            self.to_judge.append(job.case)

    def _levels_until(self, job: Job, plan: CasePlan) -> list[SolveRecord]:
        """Read the records of the levels of a reference that are solved, up to one."""
        own = [one for one in plan.ordered() if one.solver == job.solver and one.level <= job.level]
        records = [load_record(one.folder) for one in own if one.folder in self.records]
        return [record for record in records if record.status is Status.SOLVED]

    def _restore(self, plan: CasePlan, jobs: Sequence[Job]) -> None:
        """Write the scene and records of jobs, anew if a solver has removed or changed them."""
        folder = self.directory.case_folder(plan.scene.name)
        folder.mkdir(parents=True, exist_ok=True)
        write_json(scene_content(plan.scene), folder / "scene.json")
        for job in jobs:
            job.folder.mkdir(parents=True, exist_ok=True)
            write_whole(job.folder / "record.json", self.records[job.folder])

    def _lost(self, jobs: Sequence[Job]) -> list[Job]:
        """Those whose solution a solver has removed or changed; to be solved again, once."""
        lost = [
            job
            for job in jobs
            if job.folder not in self.again
            and load_record(job.folder).status is Status.SOLVED
            and stored_record(job) is None
        ]
        self.again |= {job.folder for job in lost}
        return lost

    def _judge(self, case: str) -> None:
        plan, folder = self.plans[case], self.directory.case_folder(case)
        own = plan.ordered()
        jobs = [*own, *plan.models]
        self._restore(plan, jobs)
        if lost := self._lost(jobs):
            self._wait(lost)
            return
        folders = [*(job.folder for job in own), *plan.imported]
        compared = [*folders, *(job.folder for job in plan.models)]
        records = [digest_of(read_json(one / "record.json")) for one in compared]
        judge_only = self.options.judge_only
        key = digest_of([records, scene_content(plan.scene), judge_only, code_of_comparison()])
        if (result := stored_result(folder, key)) is not None:
            self._case_done(result)
            return
        models = {
            model: [self._relative(one.folder) for one in plan.models if one.model == model]
            for model in plan.other_scenes
        }
        question = {
            "key": key,
            "judge_only": list(judge_only),
            "folders": list(map(self._relative, folders)),
            "models": models,
            "root": str(self.directory.root.resolve()),
            "provenance": self.origin,
        }
        limits = self.options.timeout, self.memory
        self.comparing.append(Comparison(plan.scene, folder, question, *limits))
        self.progress.started(comparison_label(case))

    def _case_done(self, result: CaseResult) -> None:
        if (job := next_level(self.plans[result.case], result)) is not None:
            self._wait([job])
            self._say_plan()
            return
        for done in self.families.ready(result):
            folder = self.directory.case_folder(done.case)
            if done is not result:
                write_result(done, folder / "result.json")
            self.results[done.case] = done
            self.progress.judged(done)
