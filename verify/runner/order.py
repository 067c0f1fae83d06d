"""Order in which the solves of a run are begun."""

from collections.abc import Sequence

from verify.runner.cost import case_cost
from verify.runner.job import Job
from verify.runner.options import Options
from verify.runner.plan import CasePlan
from verify.runner.reference_cache import REFERENCE


def order_of_solves(plans: Sequence[CasePlan], options: Options) -> list[Job]:
    """Return the solves of a run in the order in which they are begun.

    One after the other they keep the order of the plans. Side by side, the case that is expected
    to take longest is begun first, and in each case its reference, coarse to fine, which is most of
    it: what is short is left for the end, when it fills all processes to the last.

    A solve of a guest that was begun and left no record comes last: it may end the run once more.
    """
    return sorted(_order(plans, options), key=_left_no_record)


def _left_no_record(job: Job) -> bool:
    begun = (job.folder / "job.json").exists() and not (job.folder / "record.json").exists()
    return begun and job.solver != REFERENCE


def _order(plans: Sequence[CasePlan], options: Options) -> list[Job]:
    if options.jobs == 1 and not options.cluster:
        return [job for plan in plans for job in (*plan.jobs, *plan.models)]

    def spent(plan: CasePlan) -> float:
        return sum(row.seconds for row in case_cost(plan.scene, plan.solvers, options.repetitions))

    return [
        job
        for plan in sorted(plans, key=spent, reverse=True)
        for job in sorted((*plan.jobs, *plan.models), key=lambda job: job.solver != REFERENCE)
    ]
