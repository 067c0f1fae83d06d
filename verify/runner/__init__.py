"""Runs cases: every solve in a process of its own, with limits; failures are records.

The runner knows solvers by their names only and judges nothing: the comparison of a finished
case (`verify.study`) runs in a process of its own too.
"""

from verify.runner.run import RunSummary, exit_code, run_cases
from verify.runner.selection import Options, select_cases
from verify.runner.work import Progress

__all__ = [
    "Options",
    "Progress",
    "RunSummary",
    "exit_code",
    "run_cases",
    "select_cases",
]
