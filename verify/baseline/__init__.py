"""Regression: whether anything got worse since the values that the user has committed.

Every quantity has two axes. *Own*: the last own value; `update` can move it. *Independent*: a
value that owes nothing to the solver (exact, published, or of the reference with its
uncertainty); only a hand that edits the file can move it.
"""

from verify.baseline.checking import (
    Move,
    Row,
    VerdictChange,
    check_run,
    exit_code_of,
    save_run,
    update_from,
    verdict_changes,
)
from verify.baseline.record import Baseline, FinishedRun, read_baseline, read_run, write_baseline
