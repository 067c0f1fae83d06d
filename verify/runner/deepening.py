"""Levels that a reference gets beside those that its scene names, as long as they are needed."""

from collections.abc import Collection

from verify.result import CaseResult, SolveRecord, Status
from verify.runner.job import Job
from verify.runner.plan import CasePlan
from verify.runner.reference_cache import REFERENCE

_FEWEST = 3  # levels from which a reference has an error bar


def further_level(plan: CasePlan, result: CaseResult) -> Job | None:
    """Take the next level of the reference out of the plan's spare ones, if it is needed.

    It is if the case was judged by levels of the reference, each of them solved, whose
    uncertainty is above a tenth of an error that it judges.

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


def levels_in_vain(
    plan: CasePlan, failed: Job, record: SolveRecord, waiting: Collection[Job]
) -> list[tuple[Job, SolveRecord]]:
    """List the levels of a reference that need not be solved, each with a record that says so.

    Those that wait when one has failed, and too few are left for the reference to have an error
    bar: nothing is judged by it then.

    Parameters
    ----------
    plan : CasePlan
        Whose own reference it is; those of other models and of exact cases are not looked at.
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
