"""Levels that a reference gets beside those that its scene names, as long as they are needed."""

from verify.result import CaseResult, Status
from verify.runner.job import Job, stored_record
from verify.runner.plan import CasePlan
from verify.runner.reference_cache import REFERENCE

__all__ = ["further_level", "take_up_known_levels"]


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
    if not plan.spare or result.reference.get("suffices", True):
        return None
    own = [solve for solve in result.solves if solve.solver == REFERENCE]
    if any(solve.status is not Status.SOLVED for solve in own):
        return None
    plan.jobs.append(plan.spare.pop(0))
    return plan.jobs[-1]


def take_up_known_levels(plan: CasePlan) -> None:
    """Make jobs of the spare levels that an interrupted or earlier run has solved already."""
    while plan.spare and stored_record(plan.spare[0]) is not None:
        plan.jobs.append(plan.spare.pop(0))
