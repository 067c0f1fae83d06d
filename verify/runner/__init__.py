"""Runs cases: every solve in a process of its own, with limits; failures are records.

The runner knows solvers by their names only and judges nothing: the comparison of a finished
case (`verify.study`) runs in a process of its own too. A process that only solves imports nothing
of what runs: names are looked up when they are asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

_PLACES = {"Options": "selection", "select_cases": "selection", "Progress": "work"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES.get(name, 'run')}"), name)
