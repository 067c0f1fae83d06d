"""Regression: whether anything got worse since the values that the user has committed.

Every quantity has two axes. *Own*: the last own value; `update` can move it. *Independent*: a
value that owes nothing to the solver (exact, published, or of the reference with its
uncertainty); only a hand that edits the file can move it.
"""

from verify.baseline.checking import Row, check_run, exit_code_of
from verify.baseline.difference import VerdictChange, verdict_changes
from verify.baseline.finished_run import FinishedRun, read_run
from verify.baseline.record import Baseline, read_baseline, write_baseline
from verify.baseline.updating import Move, save_run, update_from

__all__ = [
    "Baseline",
    "FinishedRun",
    "Move",
    "Row",
    "VerdictChange",
    "check_run",
    "exit_code_of",
    "read_baseline",
    "read_run",
    "save_run",
    "update_from",
    "verdict_changes",
    "write_baseline",
]
