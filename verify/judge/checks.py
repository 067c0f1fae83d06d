"""Acceptance checks and the solvers that each is made of."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from verify.result import (
    REFERENCE,
    CaseResult,
    ReferenceRecord,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
    meshes_charged,
)
from verify.scene import BoundCheck, RateCheck, RatioCheck, Scene, ValueCheck, scene_hash

if TYPE_CHECKING:  # who only lists checks does not load the comparison
    from verify.judge.intervals import Interval


@dataclass(frozen=True)
class AppliedCheck:
    """A check, made of one solver.

    Parameters
    ----------
    check : acceptance check of a scene
        Its `solver` is set; it is empty if there is nobody whom the check is made of.
    not_judged : str
        Why nothing can be said, in one sentence; empty if the check can be judged.
    """

    check: Any
    not_judged: str = ""


def judged_by(check: Any, solvers: Sequence[str]) -> list[str]:
    """Return those of `solvers` that `check` is made of.

    That is the one that it names, else all but the reference, and but the one that it compares
    with.
    """
    if check.solver is not None:
        return [check.solver]
    aside = {REFERENCE, check.compared}
    return [name for name in solvers if name not in aside]


def applied_checks(
    checks: Sequence[Any], records: Sequence[SolveRecord], judge_only: Sequence[str] = ()
) -> Iterator[AppliedCheck]:
    """Make every check of each solver that it holds for.

    Parameters
    ----------
    checks : sequence of acceptance checks
    records : sequence of SolveRecord
        All solves of the case; a solver without any was not asked. One all of whose solves were
        refused is judged only where a check names it.
    judge_only : sequence of str
        Solvers that are judged; empty: all. The reference is judged wherever a check names it.

    Yields
    ------
    AppliedCheck
        In the order of the checks, then of the solvers in `records`; one with an empty solver for
        a check that holds for nobody.
    """
    asked = dict.fromkeys(record.solver for record in records)
    answering = {record.solver for record in records if record.status is not Status.REFUSED}
    judged = [n for n in asked if n in answering and (not judge_only or n in judge_only)]
    for check in checks:
        names = judged_by(check, judged)
        if not names:
            reason = "no solver of this run is judged by this check"
            if not answering - {REFERENCE}:
                reason = "every solver that was asked refuses the case"
            yield AppliedCheck(check.model_copy(update={"solver": ""}), reason)
        for name in names:
            one = check.model_copy(update={"solver": name})
            needed = [name, *([check.compared] if check.compared else [])]
            if judge_only and name not in (*judge_only, REFERENCE):
                yield AppliedCheck(one, f"this run judges only {', '.join(judge_only)}")
            elif missing := [other for other in needed if other not in asked]:
                yield AppliedCheck(one, f"the run was not asked for solver '{missing[0]}'")
            else:
                yield AppliedCheck(one)


def verdict_record(
    check: Any, verdict: Verdict, reason: str, found: "Interval | None" = None
) -> VerdictRecord:
    """Return the verdict on a check, made of one solver, and what was observed, if anything was."""
    value, low, high = (None, None, None) if found is None else (found.value, found.low, found.high)
    solver, limit = check.solver or "", limit_text(check)
    return VerdictRecord(
        check.check, solver, check.metric, verdict, value, low, high, limit, reason
    )


def result_of(
    scene: Scene, reference: ReferenceRecord, solves: list[SolveRecord], **known: Any
) -> CaseResult:
    """Return the result of a case with what is `known`, by the fields of a `CaseResult`."""
    return CaseResult(
        case=scene.name,
        title=scene.title,
        requirement=scene.requirement,
        scene_hash=scene_hash(scene),
        scene=scene.model_dump(mode="json", by_alias=True),
        reference=reference,
        solves=meshes_charged(solves),
        row=asdict(scene.row) if scene.row else None,
        **{"rates": [], "verdicts": [], **known},
    )


def result_without_verdicts(
    scene: Scene,
    solves: list[SolveRecord],
    reason: str,
    provenance: dict[str, Any],
    judge_only: Sequence[str] = (),
) -> CaseResult:
    """Return what is known of a case that could not be compared: an ERROR per check.

    Parameters
    ----------
    scene : Scene
    solves : list of SolveRecord
    reason : str
        Why there is no comparison, in one sentence.
    provenance : dict
    judge_only : sequence of str
        As of `applied_checks`.
    """
    applied = applied_checks(scene.acceptance, solves, judge_only)
    verdicts = [verdict_record(one.check, Verdict.ERROR, reason) for one in applied]
    known = {"verdicts": verdicts, "provenance": provenance}
    return result_of(scene, ReferenceRecord(), solves, **known)


def limit_text(check: Any) -> str:
    """Say what a check demands."""
    match check:
        case RateCheck(at_least=float(least)):
            return f"order ≥ {least:g}"
        case RateCheck():
            return f"order {check.equals:g} ± {check.within:g}"
        case BoundCheck(metric="overlap_depth"):
            return f"overlap ≤ {check.at_most:g} m"
        case BoundCheck(metric="contact_overlap"):
            return f"overlap ≤ {check.at_most:g} p h/E"
        case BoundCheck():
            return f"relative error ≤ {check.at_most:g}"
        case RatioCheck(at_most=float(most)):
            return f"error ≤ {most:g} × that of {_other(check)}, on every level"
        case RatioCheck():
            return f"error ratio to {_other(check)} within 1 ± {check.within:g}, on every level"
        case ValueCheck():
            return f"{check.equals:.10g} ± {check.relative_tolerance:g} (relative)"
    raise TypeError(f"{check!r} is no acceptance check")


def _other(check: RatioCheck) -> str:
    return check.to if check.row is None else f"the row {check.row:g}"
