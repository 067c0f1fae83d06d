"""Claims about the files for programs."""

import csv
import io
import json
from xml.etree import ElementTree

import pytest

from verify.report.exports import COLUMNS


def test_junit_has_one_test_case_per_verdict_with_its_outcome(plain_run):
    root = ElementTree.parse(plain_run / "junit.xml").getroot()
    counts = {key: root.get(key) for key in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "6", "failures": "1", "errors": "1", "skipped": "1"}
    assert "0.38 is below 0.45" in root.find(".//failure").get("message")
    assert "level 3 timed out" in root.find(".//error").get("message")
    assert "is not clearly below" in root.find(".//skipped").get("message")
    assert len(root.findall("testsuite")) == 3


def test_csv_has_a_row_per_metric_and_one_per_failed_solve(plain_run):
    rows = list(csv.DictReader(io.StringIO((plain_run / "results.csv").read_text())))
    assert tuple(rows[0]) == COLUMNS
    # 8 solves × 2 metrics; 7 × 3 and two that failed; 8 × 2 and a reference without metrics
    assert len(rows) == 16 + 21 + 2 + 16 + 1
    ended = [row for row in rows if row["status"] in ("timeout", "refused")]
    assert [row["reason"] for row in ended] == [
        "killed after 60 s",
        "cannot do a tip inside an element",
    ]
    assert all(row["value"] == "" for row in ended)


def test_csv_and_json_hold_the_numbers_to_the_last_digit(plain_run):
    row = next(csv.DictReader(io.StringIO((plain_run / "results.csv").read_text())))
    document = json.loads((plain_run / "results.json").read_text())
    solve = document["cases"][0]["result"]["solves"][0]
    assert float(row["value"]) == solve["metrics"][0]["value"]
    timings = solve["timings"]
    totals = sorted(sum(values) for values in zip(*timings.values(), strict=True))
    assert float(row["seconds_median"]) == pytest.approx(totals[1], rel=1e-15)


def test_meshing_is_no_part_of_the_time_that_is_compared(plain_run):
    rows = list(csv.DictReader(io.StringIO((plain_run / "results.csv").read_text())))
    times = {(r["solver"], r["level"]): r for r in rows if r["case"] == "statics/f3_inclined"}
    xfem, conforming = times["xfem", "2"], times["conforming", "2"]
    assert xfem["seconds_median"] == conforming["seconds_median"]
    assert xfem["meshing_median"] == ""
    assert float(conforming["meshing_median"]) > 0
