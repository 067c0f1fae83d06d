"""The suite: every check on one solver, and what the whole says."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from verify.conformance.check import CheckResult, State, evaluate
from verify.conformance.checks import checks
from verify.conformance.trials import Outcome, Trial, solve_trials
from verify.errors import InputError
from verify.scene.strict import nearest
from verify.solvers.interface import parameters_in


def conform(
    solver: str,
    parameters: Mapping[str, Any] | None = None,
    timeout: float = 120.0,
    only: Sequence[str] = (),
) -> list[CheckResult]:
    """Check the solver called `solver`.

    Parameters
    ----------
    solver : str
        Name, or ``module:Class``; parameters may follow it.
    parameters : mapping, optional
        Parameters of its `solve`, under those that follow its name.
    timeout : float
        Wall seconds for each of the about 30 small solves.
    only : sequence of str
        Names of the checks wanted; default all.

    Returns
    -------
    list of CheckResult

    Raises
    ------
    InputError
        If there is no such solver or check, or the solver cannot be loaded.
    """
    given = {**(parameters or {}), **parameters_in(solver)}
    with tempfile.TemporaryDirectory(prefix="verify-") as place:
        folder = Path(place)
        every = {check.name: check for check in checks(folder)}
        for name in only:
            if name not in every:
                raise InputError(f"no check '{name}'{nearest(name, every)}")
        asked = [check for name, check in every.items() if not only or name in only]
        together: list[Trial] = []
        apart: list[Trial] = []
        for number, check in enumerate(asked):
            for trial in check.trials:
                where = apart if trial.name in check.separate else together
                where.append(replace(trial, name=f"{number}-{trial.name}"))
        outcomes: dict[str, Outcome] = {}
        for label, trials in (("together", together), ("apart", apart)):
            outcomes |= solve_trials(solver, given, trials, folder, timeout, label)
    return [
        evaluate(check, {t.name: outcomes[f"{number}-{t.name}"] for t in check.trials})
        for number, check in enumerate(asked)
    ]


def exit_code_of(results: Sequence[CheckResult]) -> int:
    """Return 1 if a check fails, else 3 for an error, 4 if nothing was done, else 0."""
    states = [result.state for result in results]
    if State.FAIL in states:
        return 1
    if State.ERROR in states:
        return 3
    # a solver that refuses everything also passes "refuses instead of crashing"
    return 0 if any(r.state is State.PASS and r.observed is not None for r in results) else 4
