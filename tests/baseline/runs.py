"""Finished runs made by hand, so that what changed between two of them is known."""

import json
from dataclasses import replace

import scenes

from verify.provenance import KERNEL
from verify.result import (
    CaseResult,
    Metric,
    ReferenceRecord,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
    write_result,
)

SCENE = {
    "mesh": {"cells": [[4, 4], [8, 8]]},
    "quantities": [
        {"kind": "strain_energy"},
        {"kind": "displacement", "name": "sag", "point": [0.5, 0.2], "component": "y"},
    ],
    "acceptance": [
        {"check": "value", "metric": "strain_energy", "equals": 2.0, "relative_tolerance": 0.01,
         "source": "a book"},
        {"check": "error", "metric": "sag", "at_most": 0.05},
        {"check": "error", "metric": "displacement_l2", "at_most": 0.02},
    ],
}  # fmt: skip

QUIET = f"kernel {KERNEL}: 0.0100 0.0101 0.0100 0.0101 0.0100"


def metrics(energy=2.001, sag=-0.52, error=0.01, reference=-0.5, width=0.001):
    source = "conforming P2, 3 levels, GCI"
    return [
        Metric("displacement_l2", error, "1", None, 0.001, source),
        Metric("strain_energy", energy, "J/m", 2.0005, 0.0005, source),
        Metric("sag", sag, "m", reference, width, source),
    ]


def solve(level=1, seconds=(0.100, 0.101, 0.102), calibration=QUIET, **values):
    times = {name: [0.5 * s for s in seconds] for name in ("assembly", "solve")}
    return SolveRecord("a/case", "xfem", level, Status.SOLVED, size=0.25 / 2**level, timings=times,
                       metrics=metrics(**values), notes={"calibration": calibration})  # fmt: skip


def result(*solves, scene=None, verdicts=()):
    asked = scenes.scene(**SCENE | (scene or {}))
    content = asked.model_dump(mode="json", by_alias=True)
    return CaseResult("a/case", "a test", "it shall hold", "0123", content, ReferenceRecord(),
                      list(solves) or [solve(0), solve(1)], [], list(verdicts))  # fmt: skip


def verdict(check, metric, what, observed=1.0):
    return VerdictRecord(check, "xfem", metric, Verdict(what), observed, 0.0, 2.0, "≤ 2", "so")


def run(
    folder, *results, cpu="a CPU", finished="2026-01-02", date="2026-01-01", commit="c0ffee", **more
):
    """Write the directory of a run."""
    results = list(results) or [result()]
    for one in results:
        write_result(replace(one), folder / "cases" / one.case.replace("/", "__") / "result.json")
    origin = {"commit": commit, "dirty": False, "date": date, "cpu": cpu, **more}
    cases = [one.case for one in results]
    record = {"schema": 1, "cases": cases, "finished": finished, "provenance": origin}
    (folder / "run.json").write_text(json.dumps(record))
    return folder
