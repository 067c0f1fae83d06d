"""Solves a batch of trials in one process: ``python -m verify.conformance.worker BATCH.json``.

Writes ``BATCH.ready`` once the solver is loaded, and an ``outcome.json`` after each trial; a trial
that kills the process is the first without one.
"""

import os
import sys
from pathlib import Path

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.processes import die_with_parent
from verify.runner.solve import solve_job
from verify.solvers import check_parameters, find_solver
from verify.solvers.named import solver_in


def main(batch_file: Path) -> None:
    """Solve the trials of a batch, in order."""
    die_with_parent()
    batch = read_json(batch_file)
    if ":" in batch["solver"]:
        sys.path.append(os.getcwd())
    try:
        name = solver_in(batch["solver"])
        check_parameters(name, find_solver(name), batch["parameters"])
    except InputError as error:
        write_json({"error": str(error)}, batch_file.with_suffix(".refused"))
        return
    batch_file.with_suffix(".ready").touch()
    for name in batch["trials"]:
        folder = batch_file.parent / name
        outcome = solve_job(read_json(folder / "job.json"), folder, timed=False)
        write_json(outcome, folder / "outcome.json")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
