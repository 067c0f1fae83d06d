"""The page of a study: findings as sentences, then tables and curves, then where it comes from."""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from verify.errors import InputError
from verify.json_files import read_json
from verify.printable import shown
from verify.report.blocks import Cell, Table, plain_table
from verify.report.overview import origin_facts
from verify.report.printing import print_page
from verify.report.study_views import study_view
from verify.report.template_sets import as_html, as_markdown
from verify.whole_files import write_whole

_STUDIES = ("slivers", "energy", "cost", "budget", "thesis", "calibration", "iterations")
_SCHEMA = 1
_FOLDED = 30  # findings beyond which those that came out as expected fold


def studies_in(directory: Path) -> list[str]:
    """Return the kinds of the studies whose records lie in `directory`."""
    return [kind for kind in _STUDIES if (directory / f"{kind}.json").is_file()]


def render_study(directory: Path, kind: str, form: str = "html") -> Path:
    """Write ``<kind>.html`` from ``<kind>.json``, or what `form` asks for: markdown or pdf.

    Raises
    ------
    InputError
        If the record is not there, is no record of this kind, or has another schema version;
        if PDF is asked for and no browser prints.
    OSError
        If the page cannot be written.
    """
    source = directory / f"{kind}.json"
    if not source.exists():
        raise InputError(f"no {kind}.json: the {kind} study has not run", str(directory))
    record = read_json(source)
    expected = {"schema": _SCHEMA, "kind": f"{kind} study"}
    for key, value in expected.items():
        if (found := record.get(key)) != value:
            raise InputError(f"{key} is {shown(found)}; expected {value!r}", str(source))
    view = {
        "kind": kind,
        "record": record,
        "counts": Counter(finding["verdict"] or "SHOWN" for finding in record["findings"]),
        "findings": _findings(record),
        "origin": origin_facts(record),
        **study_view(kind, record),
    }
    if form == "markdown":
        target = directory / f"{kind}.md"
        write_whole(target, as_markdown("study.j2", directory, f"{kind}-pictures", **view))
        return target
    page = directory / f"{kind}.html"
    write_whole(page, as_html("study.j2", **view))
    if form == "pdf":
        print_page(page, page.with_suffix(".pdf"))
        return page.with_suffix(".pdf")
    return page


def _findings(record: Mapping[str, Any]) -> list[tuple[Table, bool]]:
    """Return the findings as a table; where they are many, those that did not fail fold."""
    every = record["findings"]
    groups: dict[str, list[Any]] = {"Findings": every}
    if len(every) > _FOLDED:
        groups = {"Failed or undecided": [], "Passed": [], "Without a limit": []}
        for finding in every:
            verdict = finding["verdict"]
            place = {"PASS": "Passed", None: "Without a limit"}.get(verdict, "Failed or undecided")
            groups[place].append(finding)
    head = ["about", "finding", "limit or known result", "verdict"]
    tables = []
    for title, group in groups.items():
        rows = [
            [f["topic"], f["sentence"], f["expected"],
             Cell(verdict=f["verdict"]) if f["verdict"] else "shown"]
            for f in group
        ]  # fmt: skip
        folds = title in ("Passed", "Without a limit")
        tables.append((plain_table(title, head, rows, "verdicts"), folds))
    return [(table, folds) for table, folds in tables if table.rows]
