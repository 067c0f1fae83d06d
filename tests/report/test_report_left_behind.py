"""Claims about runs that were killed or damaged: nothing is hidden, nothing is invented."""

import json
from dataclasses import asdict
from xml.etree import ElementTree

import pytest
from page_parser import parsed
from synthetic_run import make_run

from verify.report import load_run, render
from verify.result import SolveRecord, Status


@pytest.fixture
def root(tmp_path):
    return make_run(tmp_path / "run", pictures=False)


def said(root):
    return parsed(render(root).read_text(encoding="utf-8")).text


def result_of(root):
    return root / "cases" / "statics__f3_inclined" / "result.json"


def test_a_killed_run_lists_what_had_finished_and_what_had_not_started(root):
    record = json.loads((root / "run.json").read_text())
    record["finished"] = None
    record["cases"].append("statics/never_begun")
    (root / "run.json").write_text(json.dumps(record))
    folder = result_of(root).parent
    result_of(root).unlink()
    for level, status in enumerate((Status.SOLVED, Status.FAILED)):
        solve = SolveRecord("statics/f3_inclined", "xfem", level, status, "boom")
        (folder / f"xfem-{level}").mkdir()
        content = {"key": "k", "record": asdict(solve), "files": {}}
        (folder / f"xfem-{level}" / "record.json").write_text(json.dumps(content))
    text = said(root)
    assert "the run has not finished" in text
    assert "statics/f3_inclined: not judged: the run was stopped before its comparison" in text
    assert "1 of its solves had finished" in text
    assert "boom" in text
    assert "statics/never_begun: not started" in text
    suite = ElementTree.parse(root / "junit.xml").getroot()
    assert suite.get("errors") == "3"  # one of its own, the unjudged case, the one not begun


@pytest.mark.parametrize(
    "content, reason",
    [
        ("{", "not a JSON file"),
        ("", "not a JSON file"),
        ("[]", "object"),
        ('{"schema": 99}', "not a result of schema version 1"),
        ('{"schema": 1}', "not a readable result"),
        ("\ud800".encode("utf-8", "surrogatepass"), "not a JSON file"),
    ],
)
def test_a_damaged_result_is_a_row_with_its_reason(root, content, reason):
    result_of(root).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert reason in said(root)
    entry = load_run(root).entries[0]
    assert entry.result is None
    assert reason in entry.defect


def test_a_case_without_solves_checks_or_levels_renders(root):
    result = json.loads(result_of(root).read_text())
    result.update(solves=[], rates=[], verdicts=[], reference={}, scene={})
    result_of(root).write_text(json.dumps(result))
    text = said(root)
    assert "No check is stated for statics/f3_inclined" in text
    assert "No reference is recorded" in text
