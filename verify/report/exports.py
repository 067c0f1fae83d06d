"""The report for programs: results as JSON, as CSV rows, and as JUnit test cases."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from statistics import median
from typing import Any
from xml.etree import ElementTree

from verify.printable import csv_text
from verify.report.curves import duration
from verify.report.notation import printable
from verify.report.run_directory import CaseEntry, Run
from verify.result import SolveRecord, Verdict, VerdictRecord, finest_of

EXPORT_SCHEMA = 1
COLUMNS = (
    "case", "solver", "level", "parameters", "status", "reason", "size", "unknowns", "metric",
    "value", "unit", "reference", "uncertainty", "source", "seconds_median", "seconds_min",
    "seconds_max", "meshing_median", "repetitions", "wall", "peak_memory", "reference_share",
)  # fmt: skip

_OF_A_SOLVE = ("level", "status", "size", "unknowns", "wall", "peak_memory")


def all_results(run: Run) -> dict[str, Any]:
    """Return all results of a run as one JSON document of schema version `EXPORT_SCHEMA`."""
    cases = [
        {"case": entry.name, "defect": entry.defect,
         "result": entry.result.content() if entry.result else None,
         "unjudged": [asdict(solve) for solve in entry.unjudged]}
        for entry in run.entries
    ]  # fmt: skip
    return {
        "schema": EXPORT_SCHEMA, "kind": "verification results", "run": run.record,
        "defects": run.defects, "ranking": run.ranking, "cases": cases,
    }  # fmt: skip


def csv_rows(run: Run) -> str:
    """Return one row per case, solver, level and metric; one without metric for failed solves.

    A notice is a row whose status is its kind, without level and value. `reference_share` stands
    beside the number that a check judges.
    """
    return csv_text(COLUMNS, (row for entry in run.entries for row in _rows_of(entry)))


def _rows_of(entry: CaseEntry) -> Iterator[dict[str, Any]]:
    for solve in entry.result.solves if entry.result else entry.unjudged:
        yield from _rows(entry, solve)
    for notice in entry.result.notices if entry.result else []:
        yield {
            "case": printable(entry.name),
            "solver": printable(notice.solver or ""),
            "status": str(notice.kind),
            "metric": printable(notice.about),
            "reason": printable(notice.text),
        }


def junit_document(run: Run) -> str:
    """Return one test case per verdict, and one per case that has none."""
    root = ElementTree.Element("testsuites", name="verification")
    for entry in run.entries:
        suite = ElementTree.SubElement(root, "testsuite", name=printable(entry.name))
        if entry.result is None:
            _testcase(suite, entry, "result", Verdict.ERROR, entry.defect)
        elif not entry.result.verdicts:
            _testcase(suite, entry, "result", Verdict.UNDECIDED, "the case states no check")
        else:
            for record in entry.result.verdicts:
                name, badge = _test_name(record), record.badge
                _testcase(suite, entry, name, record.verdict, record.reason, record.known, badge)
        _count(suite)
        if entry.result and entry.result.notices:
            said = "\n".join(
                f"{n.kind}: {n.about}{f' ({n.solver})' if n.solver else ''}: {n.text}"
                for n in entry.result.notices
            )
            ElementTree.SubElement(suite, "system-out").text = printable(said)
        walls = [
            solve.wall for solve in (entry.result.solves if entry.result else []) if solve.wall
        ]
        suite.set("time", f"{sum(walls):.3f}")
    _count(root)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(root, "unicode") + "\n"


def _rows(entry: CaseEntry, solve: SolveRecord) -> Iterator[dict[str, Any]]:
    time = duration(solve)
    common = {
        "case": printable(entry.name),
        "solver": printable(solve.solver),
        "parameters": json.dumps(solve.parameters, sort_keys=True) if solve.parameters else "",
        "reason": printable(solve.reason),
        **{key: getattr(solve, key) for key in _OF_A_SOLVE},
    }
    result = entry.result
    last = result is not None and finest_of(result.solves)[solve.solver] is solve
    shares = {
        record.metric: record.reference_share
        for record in (result.verdicts if result and last else [])
        if record.solver == solve.solver
    }
    if meshing := solve.timings.get("meshing"):
        common["meshing_median"] = median(meshing)
    if time:
        common |= {"seconds_median": time.median, "seconds_min": time.low,
                   "seconds_max": time.high, "repetitions": time.repetitions}  # fmt: skip
    for metric in solve.metrics:
        own = {key: printable(getattr(metric, key)) for key in ("unit", "source")}
        numbers = {key: getattr(metric, key) for key in ("value", "reference", "uncertainty")}
        numbers["reference_share"] = shares.get(metric.name)
        yield common | {"metric": printable(metric.name)} | own | numbers
    if not solve.metrics:
        yield common


def _test_name(record: VerdictRecord) -> str:
    return f"{record.check} {record.metric} of {record.solver or 'nobody'}: {record.limit}"


def _testcase(
    suite: ElementTree.Element,
    entry: CaseEntry,
    name: str,
    verdict: Verdict,
    reason: str,
    known: str = "",
    badge: str = "",
) -> None:
    """Add a verdict; a known finding does not count as a failure, as in the exit code."""
    classname = printable(entry.name).replace("/", ".")
    case = ElementTree.SubElement(suite, "testcase", name=printable(name), classname=classname)
    elements = {Verdict.FAIL: "failure", Verdict.ERROR: "error", Verdict.UNDECIDED: "skipped"}
    if verdict in elements:
        said = f"{verdict}: {printable(reason) or 'no reason given'}"
        said = f"{said} [{badge}]" if badge else said
        if known:
            said = f"known finding ({printable(known)}): {said}"
        ElementTree.SubElement(case, "skipped" if known else elements[verdict], message=said)
    elif badge:
        ElementTree.SubElement(case, "system-out").text = badge


def _count(element: ElementTree.Element) -> None:
    element.set("tests", str(len(element.findall(".//testcase"))))
    for kind, name in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        element.set(kind, str(len(element.findall(f".//{name}"))))
