"""A run directory in memory, and the same for programs: JSON, CSV rows, JUnit test cases."""

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import median
from typing import Any
from xml.etree import ElementTree

from pydantic import TypeAdapter

from verify.errors import InputError
from verify.files import read_json
from verify.printable import csv_text, words_of
from verify.report.curves import duration
from verify.report.notation import printable
from verify.result import (
    CaseResult,
    Ranking,
    SolveRecord,
    Verdict,
    VerdictRecord,
    checked,
    finest_of,
    folder_of_case,
    read_result,
)
from verify.solution import Solution, read_solution

_RANKING = TypeAdapter(Ranking)


@dataclass(frozen=True)
class CaseEntry:
    """One case of a run.

    Parameters
    ----------
    name : str
    folder : Path
    result : CaseResult or None
        None if it is missing or damaged.
    defect : str
        Why there is no result; empty if there is one.
    unjudged : list of SolveRecord
        Solves that finished before the run was killed, if there is no result.
    """

    name: str
    folder: Path
    result: CaseResult | None
    defect: str = ""
    unjudged: list[SolveRecord] = field(default_factory=list)


@dataclass(frozen=True)
class Run:
    """A run directory in memory: ``run.json``, the cases, and their defects.

    `ranking` is what ``ranking.json`` holds, None if there is none.
    """

    root: Path
    record: dict[str, Any]
    entries: list[CaseEntry]
    defects: list[str]
    ranking: dict[str, Any] | None = None

    @property
    def results(self) -> list[CaseResult]:
        """The results that could be read."""
        return [entry.result for entry in self.entries if entry.result is not None]


def load_run(directory: Path) -> Run:
    """Read the run in `directory`.

    Raises
    ------
    InputError
        If there is no such directory, or neither a readable ``run.json`` nor a case in it.
    """
    if not directory.is_dir():
        raise InputError("no such directory; expected the directory of a run", str(directory))
    record, defects = load_record(directory)
    folder = directory / "cases"
    folders = sorted(path for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
    if not record and not folders:
        raise InputError(f"holds no run ({defects[0]})", str(directory))
    found = {entry.folder.name: entry for entry in map(load_entry, folders)}
    entries = []
    for name in record.get("cases", []):
        path = folder / folder_of_case(name)
        entry = found.pop(path.name, None)
        if entry is None:
            defect = "not started: the run was stopped before it, or its folder was removed"
            entry = CaseEntry(name, path, None, defect)
        entries.append(entry if entry.result else replace(entry, name=name))
    entries += found.values()
    if record and not record.get("finished"):
        defects.append("the run has not finished: it was stopped, or is still going on")
    ranking, trouble = _ranking(directory / "ranking.json", [e.name for e in entries])
    return Run(directory, record, entries, defects + trouble, ranking)


def _ranking(path: Path, cases: list[str]) -> tuple[dict[str, Any] | None, list[str]]:
    """Read the ranking of the run; a ranking of other cases is of an earlier run."""
    if not path.is_file():
        return None, []
    try:
        found = read_json(path)
        _RANKING.validate_python(found)
    except ValueError as error:  # InputError and ValidationError are
        return None, [f"ranking.json cannot be read ({words_of(error)})"]
    if set(found["cases"]) != set(cases):
        return None, ["ranking.json is of other cases: no ranking is shown"]
    return found, []


def load_record(directory: Path) -> tuple[dict[str, Any], list[str]]:
    """Return the content of ``run.json`` in a form that can be relied on, and its defects."""
    path = directory / "run.json"
    try:
        record = read_json(path)
    except InputError as error:
        said = f"cannot be read ({error.what})" if path.exists() else "is missing"
        return {}, [f"run.json {said}"]
    if record.get("schema") != 1:
        return {}, ["run.json is not of schema version 1"]
    for key in ("options", "provenance"):
        if not isinstance(record.get(key, {}), dict):
            record = {**record, key: {}}
    names = record.get("cases")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return {**record, "cases": []}, ["run.json has no list of case names"]
    return record, []


def load_entry(folder: Path) -> CaseEntry:
    """Read the case in `folder`; a missing or damaged file is a defect of the entry."""
    name = folder.name.replace("__", "/")
    try:
        result = read_result(folder / "result.json")
    except InputError as error:
        defect = str(error.what)
        if not (folder / "result.json").exists():
            defect = "not judged: the run was stopped before its comparison"
    else:
        return CaseEntry(result.case, folder, result)
    return CaseEntry(name, folder, None, defect, _finished_solves(folder))


def _finished_solves(folder: Path) -> list[SolveRecord]:
    """Read the records of single solves; damaged ones are as good as unfinished."""
    records = []
    for path in sorted(folder.glob("*/record.json")):
        try:
            records.append(checked(SolveRecord, read_json(path).get("record"), "record", str(path)))
        except InputError:
            continue
    return sorted(records, key=lambda record: (record.solver, record.level))


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
        walls = (solve.wall or 0.0 for solve in (entry.result.solves if entry.result else ()))
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
    suite: ElementTree.Element, entry: CaseEntry, name: str, verdict: Verdict, reason: str,
    known: str = "", badge: str = "",
) -> None:  # fmt: skip
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


def read_stored(root: Path, path: str) -> Solution:
    """Read the solution stored under `path` in the run directory `root`.

    Raises
    ------
    InputError
        If it is not there, not readable, or not inside the run directory.
    """
    target = (root / path).resolve()
    if not target.is_relative_to(root.resolve()):
        raise InputError("the solution lies outside the run directory", path)
    # a record may name the file, its path without ending, or its folder
    target = target / "solution" if target.is_dir() else target
    if target.suffix not in (".json", ".vtu"):
        target = target.with_name(target.name + ".json")
    try:
        return read_solution(target)
    except OSError as error:
        raise InputError(f"the solution cannot be read ({error.strerror})", path) from None
