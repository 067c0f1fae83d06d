"""The ranking of a finished run, ``ranking.json``; before it, the conformance of the ranked.

Conformance is a matter of a solver and its parameters, not of the cases: what was found stays in
the run directory and is reused as long as the code of the solver is the same.
"""

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.files import read_json, write_json
from verify.printable import words_of
from verify.result import CaseResult, Status, ranked_solvers
from verify.runner.fingerprint import code_digest, code_of_solver, digest_of, file_digest
from verify.solvers import solver_names
from verify.solvers.interface import solver_in

RANKING_FILE = "ranking.json"
_SECONDS = 120.0  # for each small solve of the suite
_UNASKED = 2  # so many solvers are ranked without being checked unasked


def rank_run(
    directory: Path,
    results: Sequence[CaseResult],
    parameters: Mapping[str, Mapping[str, Any]],
    conformance: bool | None,
    timeout: float,
    announce: Callable[[str], None],
) -> Path | None:
    """Rank the solvers of a run, if there are at least two.

    Parameters
    ----------
    directory : Path
        The run directory.
    results : sequence of CaseResult
    parameters : mapping
        Parameters by solver, as the run had them.
    conformance : bool or None
        Whether the suite runs before; None: if more than two solvers are ranked.
    timeout : float
        Wall seconds of a solve of the run; of the suite's small ones at most 120.
    announce : callable
        Told which solver is checked.

    Returns
    -------
    Path or None
        Of ``ranking.json``; None if there is nothing to rank.
    """
    target, solvers = directory / RANKING_FILE, ranked_solvers(results)
    if len(solvers) < 2:
        target.unlink(missing_ok=True)
        return None
    from verify.judge.ranks import rank_solvers  # a run of one solver does not wait for it

    wanted = len(solvers) > _UNASKED if conformance is None else conformance
    before = _stored(target)
    answered = {s.solver for r in results for s in r.solves if s.status is Status.SOLVED}
    found = {}
    for solver in solvers:
        own = dict(parameters.get(solver, {}))
        if solver_in(solver) not in solver_names() and ":" not in solver:
            found[solver] = {"unchecked": "imported answers: there is no solver to be asked"}
            continue
        code = [code_of_solver(solver), _source_of_guest(solver)]
        key = digest_of([solver, own, code, code_of_suite()])
        known = before.get(solver, {})
        if known.get("key") == key:
            found[solver] = known
        elif wanted and solver not in answered:
            found[solver] = {"unchecked": "not asked: it solved nothing in this run"}
        elif wanted:
            announce(f"conformance of {solver}")
            found[solver] = {"key": key, **_checked(solver, own, min(timeout, _SECONDS))}
        else:
            found[solver] = {"unchecked": "not asked for: --conform"}
    try:
        ranked = rank_solvers(results, found)
    except Exception as error:  # the report is made all the same
        announce(f"the solvers cannot be ranked: {words_of(error)}")
        target.unlink(missing_ok=True)
        return None
    write_json(ranked, target)
    return target


def _source_of_guest(solver: str) -> str:
    """Return the hash of the file of ``module:Class``, or an empty text."""
    module, _, attribute = solver_in(solver).partition(":")
    if not attribute:
        return ""
    places = [Path(root, *module.split(".")) for root in (*sys.path, os.getcwd())]
    files = (file for place in places for file in (place.with_suffix(".py"), place / "__init__.py"))
    return next((file_digest(file) for file in files if file.is_file()), "")


def code_of_suite() -> str:
    """Return the hash of all that the suite's findings depend on beside the solver."""
    return code_digest("verify.conformance.suite", "verify.conformance.trials")


def _stored(target: Path) -> dict[str, Any]:
    try:
        known = read_json(target).get("conformance", {})
    except InputError:
        return {}
    return {name: one for name, one in known.items() if isinstance(one, dict)}


def _checked(solver: str, parameters: dict[str, Any], timeout: float) -> dict[str, Any]:
    from verify.conformance import conform, exit_code_of  # most runs do without

    try:
        results = conform(solver, parameters, timeout)
    except InputError as problem:
        return {"unchecked": str(problem)}
    return {"exit": exit_code_of(results), "checks": [asdict(result) for result in results]}
