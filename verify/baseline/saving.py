"""Adding to a baseline what it does not know; what it knows stays as it is."""

from verify.baseline.finished_run import FinishedRun, physics_of
from verify.baseline.measured import finest, quantities_of, speed_entry, speed_of
from verify.baseline.record import Baseline, CaseBaseline
from verify.errors import InputError
from verify.result import Status


def save_run(baseline: Baseline, run: FinishedRun) -> tuple[Baseline, list[str]]:
    """Add the cases, quantities and speeds of `run` that `baseline` does not have.

    The independent axis is filled from what the case states (a value with its source, or a
    bound of the error) and from the run's reference; its tolerance is never taken from what
    was measured.

    Returns
    -------
    baseline : Baseline
    notes : list of str
        What was left out, and why.

    Raises
    ------
    InputError
        If a case of the baseline has another scene now.
    """
    cases, notes = dict(baseline.cases), []
    cpu = str(run.provenance.get("cpu", ""))
    for name, result in run.results.items():
        physics = physics_of(result)
        known = cases.get(name, CaseBaseline(physics=physics))
        if known.physics != physics:
            raise InputError(
                f"'{name}' is another scene than the one in the baseline; remove its entry from "
                "the file, then save"
            )
        speeds = {}
        for solve in finest(result):
            key = f"{solve.solver}/{solve.level}"
            if solve.status is not Status.SOLVED:
                notes.append(f"{name}:{key}: left out, {solve.status}: {solve.reason}")
                continue
            measured = speed_of(solve)
            if measured.reason:
                notes.append(f"{name}:{key}: no speed, {measured.reason}")
            else:
                speeds[key] = speed_entry(measured, cpu, run.origin)
        cases[name] = CaseBaseline(
            physics=physics,
            quantities={**quantities_of(result, run.origin), **known.quantities},
            speed={**speeds, **known.speed},
        )
    return Baseline(cases=cases), notes
