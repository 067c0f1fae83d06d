"""The exit code of a run.

A failed verdict (1) goes before a failed solve (3): a FAIL is only given when the whole interval
of what is known violates the limit, so it stands whatever the missing solves would have said,
and a script that repeats a run on code 3 must not take a wrong answer for a bad day of the
machine. A FAIL that its case lists as a known finding does not count.
"""

from collections.abc import Sequence

from verify.result import COMPARISON_FAILED, CaseResult, Status, Verdict

ALL_PASS = 0
VERDICT_FAILED = 1
BAD_INPUT = 2
SOLVER_FAILED = 3
NOTHING_RAN = 4
ONLY_WARNINGS = 5

_BROKEN = (Status.FAILED, Status.TIMEOUT, Status.MEMORY)


def exit_code(results: Sequence[CaseResult], strict: bool = False) -> int:
    """Return the exit code of a run that ended with `results`.

    Parameters
    ----------
    results : sequence of CaseResult
    strict : bool
        Whether an undecided verdict, a refusal, a warning, or a case without any verdict counts.
    """
    judged = [record for result in results for record in result.verdicts]
    verdicts = [record.verdict for record in judged]
    statuses = [solve.status for result in results for solve in result.solves]
    if any(record.counts_as_failed for record in judged):
        return VERDICT_FAILED
    uncompared = [solve.not_compared for result in results for solve in result.solves]
    if (
        Verdict.ERROR in verdicts
        or any(status in _BROKEN for status in statuses)
        or any(why.startswith(COMPARISON_FAILED) for why in uncompared)
    ):
        return SOLVER_FAILED
    if Status.SOLVED not in statuses:
        return NOTHING_RAN
    doubtful = Verdict.UNDECIDED in verdicts or Status.REFUSED in statuses
    doubtful |= any(not result.verdicts or result.warnings for result in results)
    return ONLY_WARNINGS if strict and doubtful else ALL_PASS
