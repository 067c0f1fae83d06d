"""Reads a run directory, whole or left behind by a killed run.

What is missing or damaged becomes a sentence of the report, never an omission.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from verify.errors import InputError
from verify.json_files import read_json
from verify.printable import words_of
from verify.ranking import Ranking
from verify.result import CaseResult, SolveRecord
from verify.result_files import checked, folder_of_case, read_result

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
    """A run directory in memory: ``run.json``, the cases, and what is wrong with them.

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
    """Read the ranking of the run; one of other cases is that of an earlier run."""
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
    """Read the case in `folder`; what is missing or damaged is a defect of the entry."""
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
