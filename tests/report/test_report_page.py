"""The page: well formed, closed to hostile words, complete after a death; its exports."""

import csv
import io
import json
import random
import re
import subprocess
import sys
from concurrent.futures.process import BrokenProcessPool
from contextlib import nullcontext
from dataclasses import asdict, replace
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from page_parser import parsed
from synthetic_run import HOSTILE, make_run

from verify.cli.run_text import verdict_lines
from verify.report import rendering
from verify.report.rendering import render
from verify.report.run_directory import COLUMNS, load_run
from verify.result import SolveRecord, Status, Verdict, read_result, write_result


def page_of(root):
    return (root / "report.html").read_text(encoding="utf-8")


def test_the_page_is_well_formed_and_fetches_nothing(pictured_run):
    text = page_of(pictured_run)
    page = parsed(text)
    assert {a["href"][1:] for a in page.all("a")} <= set(page.ids)
    addresses = [
        a[k] for _, a in page.elements for k in ("src", "href", "srcset", "data") if k in a
    ]
    assert addresses
    assert all(a.startswith(("#", "data:image/")) for a in addresses)
    style = re.search("<style>(.*)</style>", text, re.DOTALL)[1]
    assert "url(" not in style
    assert "@import" not in style
    assert page.all("script") == [{}]  # its own: folding and filtering
    assert not page.all("link")


def test_hostile_words_in_every_text_of_a_result_stay_text(tmp_path):
    root = make_run(tmp_path / "run", pictures=False)
    file = root / "cases" / "statics__griffith_inside" / "result.json"

    def poisoned(value, key=""):
        if isinstance(value, dict):
            return {k: poisoned(v, k) for k, v in value.items()}
        if isinstance(value, list):
            return [poisoned(v, key) for v in value]
        keep = ("case", "status", "verdict", "unit", "solution")
        return HOSTILE + value if isinstance(value, str) and key not in keep else value

    file.write_text(json.dumps(poisoned(json.loads(file.read_text()))))
    record = json.loads((root / "run.json").read_text())
    (root / "run.json").write_text(json.dumps(poisoned({**record, "cases": []})))
    page = parsed(page_of(render(root).parent))
    assert len(page.all("script")) == 1
    assert "griffith_inside" in page.text


def test_rendering_again_gives_the_same_bytes(plain_run):
    names = ("report.html", "results.json", "results.csv", "junit.xml")
    before = [(plain_run / name).read_bytes() for name in names]
    render(plain_run)
    assert [(plain_run / name).read_bytes() for name in names] == before
    assert not list(plain_run.glob("*.partial"))


def test_the_report_needs_no_solver():
    code = (
        "import sys, verify.report\n"
        "wrong = {'dolfinx', 'gmsh', 'petsc4py', 'mpi4py', 'numba', 'reference', 'verify.xfem',"
        " 'verify.compare', 'verify.solvers', 'pyvista', 'vtk'} & set(sys.modules)\n"
        "sys.exit(f'imported {wrong}' if wrong else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_junit_has_one_test_case_per_verdict_with_its_outcome(plain_run):
    root = ElementTree.parse(plain_run / "junit.xml").getroot()
    counts = {key: root.get(key) for key in ("tests", "failures", "errors", "skipped")}
    assert counts == {"tests": "6", "failures": "1", "errors": "1", "skipped": "1"}
    assert "0.38 is below 0.45" in root.find(".//failure").get("message")
    assert "level 3 timed out" in root.find(".//error").get("message")
    assert "is not clearly below" in root.find(".//skipped").get("message")
    assert len(root.findall("testsuite")) == 3


def test_a_reference_that_is_not_clearly_better_than_what_it_judges_stands_beside_its_pass(
    tmp_path,
):
    root = make_run(tmp_path / "run", False, "f3_inclined")
    file = root / "cases/statics__f3_inclined/result.json"
    result = read_result(file)
    (at, passed) = next((i, v) for i, v in enumerate(result.verdicts) if v.verdict is Verdict.PASS)
    result.verdicts[at] = replace(passed, reference_share=0.493)
    write_result(result, file)
    said = "reference: 0.49 of the error"
    page = render(root).read_text(encoding="utf-8")
    # on the first screen, beside the verdict of the case with its check as a tip, beside the check
    assert page.count(said) == 4
    assert render(root, "markdown").read_text(encoding="utf-8").count(said) == 3
    junit = ElementTree.parse(root / "junit.xml").getroot()
    assert [one.text for one in junit.findall(".//testcase/system-out")] == [said]
    rows = csv.DictReader(io.StringIO((root / "results.csv").read_text()))
    shares = {(r["solver"], r["level"], r["metric"]) for r in rows if r["reference_share"]}
    assert shares == {("xfem", "3", passed.metric)}
    (line, *_) = verdict_lines([read_result(file)])
    assert line.endswith(f"[{said} ({passed.metric} of xfem)]")
    result.verdicts[at] = replace(passed, reference_share=0.1)
    assert said not in next(iter(verdict_lines([result])))


def test_a_line_of_the_terminal_has_the_interval_of_the_report(tmp_path):
    root = make_run(tmp_path / "run", pictures=False)
    file = root / "cases/statics__f3_inclined/result.json"
    result = read_result(file)
    failed = replace(
        result.verdicts[0], verdict=Verdict.FAIL, check="error", observed=0.27912, low=0.2777,
        high=0.2805,
    )  # fmt: skip
    write_result(replace(result, verdicts=[failed]), file)
    page = render(root, "markdown").read_text(encoding="utf-8")
    assert "0.2791 [0.2777, 0.2805]" in page.replace("\\", "")
    _, line, *_ = verdict_lines([replace(result, verdicts=[failed], notices=[])])
    assert ": 0.2791 [0.2777, 0.2805], wanted " in line


@pytest.mark.parametrize("many", [False, True])
def test_few_failures_are_told_in_words_and_many_are_counted(tmp_path, many):
    """Of 40 solvers that fail in a case the first screen has a short line, no list of checks."""
    root = make_run(tmp_path / "run", pictures=False)
    file = root / "cases/statics__griffith_inside/result.json"
    result = read_result(file)
    (failed,) = [v for v in result.verdicts if v.verdict is Verdict.FAIL]
    names = [f"solver_{k}" for k in range(40 if many else 2)]
    own = [replace(failed, solver=name) for name in names]
    twice = [replace(one, metric="displacement_l2") for one in own[:1]]
    passed = [replace(failed, solver=names[0], metric="jump_l2", verdict=Verdict.PASS)]
    result.verdicts[:] = [*own, *twice, *passed]
    write_result(result, file)
    text = render(root, "summary").read_text(encoding="utf-8")
    (line,) = [one for one in text.splitlines() if one.startswith("**Failed**")]
    assert ("statics/griffith_inside (order" in line) is not many
    if many:
        assert line.startswith("**Failed**: 41 checks, by solver: solver_0 2 of 3, solver_1 1 of 1")
        assert len(line) < 25 * len(names)


def test_csv_has_a_row_per_metric_and_one_per_failed_solve(plain_run):
    rows = list(csv.DictReader(io.StringIO((plain_run / "results.csv").read_text())))
    assert tuple(rows[0]) == COLUMNS
    solve = json.loads((plain_run / "results.json").read_text())["cases"][0]["result"]["solves"][0]
    assert float(rows[0]["value"]) == solve["metrics"][0]["value"]  # to the last digit
    totals = sorted(sum(values) for values in zip(*solve["timings"].values(), strict=True))
    assert float(rows[0]["seconds_median"]) == pytest.approx(totals[1], rel=1e-15)
    # 8 solves × 2 metrics; 7 × 3 and two that failed; 8 × 2 and a reference without metrics
    assert len(rows) == 16 + 21 + 2 + 16 + 1
    ended = [row for row in rows if row["status"] in ("timeout", "refused")]
    assert [row["reason"] for row in ended] == [
        "killed after 60 s",
        "cannot do a tip inside an element",
    ]
    assert all(row["value"] == "" for row in ended)


def test_a_mesh_that_conforms_to_the_cut_is_part_of_the_time_that_is_compared(plain_run):
    rows = list(csv.DictReader(io.StringIO((plain_run / "results.csv").read_text())))
    times = {(r["solver"], r["level"]): r for r in rows if r["case"] == "statics/f3_inclined"}
    xfem, conforming = times["xfem", "2"], times["conforming", "2"]
    meshing = float(conforming["meshing_median"])
    assert xfem["meshing_median"] == ""
    assert meshing > 0
    paid = float(xfem["seconds_median"]) + meshing
    assert float(conforming["seconds_median"]) == pytest.approx(paid, rel=1e-12)


def test_every_table_has_rows_of_one_width_and_holds_the_numbers_of_the_page(pictured_run):
    root = pictured_run
    text = (root / "report.md").read_text(encoding="utf-8")
    render(root, "summary")
    page = parsed((root / "report.html").read_text(encoding="utf-8"))
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    assert len(tables) == len(page.all("table"))
    for table in tables:
        rows = table.splitlines()
        widths = {len(re.findall(r"(?<!\\)\|", row)) for row in rows}
        assert len(widths) == 1, rows[0]
    for words in ("8.0787579", "UNDECIDED", "killed after 60 s", "×10⁻"):
        assert words in text
    named = re.findall(r"\]\((report-pictures/[^)]+)\)", text)  # a summary leaves them
    assert named
    assert all((root / name).is_file() for name in named)


ABSURD = (
    0.0, -0.0, 1.0, -1.0, 1e300, -1e300, 1.7976931348623157e308, 5e-324, 1e-300, 1e17, 10**30, -5,
    None,
)  # fmt: skip
LOST = ("nan", "inf", "-inf")


def spoilt(value, chance, rng, place, lost):
    """Numbers of a result replaced by others, some of them by what JSON has no word for."""
    if isinstance(value, dict):
        return {
            k: v if k == "level" else spoilt(v, chance, rng, f"{place}/{_key(k)}", lost)
            for k, v in value.items()
        }
    if isinstance(value, list):
        return [spoilt(v, chance, rng, f"{place}/{i}", lost) for i, v in enumerate(value)]
    if isinstance(value, bool) or not isinstance(value, int | float) or rng.random() > chance:
        return value
    if isinstance(value, float) and rng.random() < 0.3:
        lost[place] = rng.choice(LOST)
        return None
    return rng.choice([n for n in ABSURD if isinstance(value, float) or isinstance(n, int)])


def _key(key):
    return key.replace("~", "~0").replace("/", "~1")


def spoil(root, seed):
    rng = random.Random(seed)
    chance = rng.choice((0.02, 0.2, 1.0))
    for file in sorted(root.glob("cases/*/result.json")):
        content, lost = json.loads(file.read_text()), {}
        kept = {key: content[key] for key in ("schema", "scene")}
        content = spoilt(content, chance, rng, "", lost) | kept
        lost = {place: word for place, word in lost.items() if not place.startswith("/scene/")}
        file.write_text(json.dumps({**content, "not_finite": lost}))


def assert_whole(text):
    assert "</html>" in text
    assert "cannot be shown" not in text
    assert "pictures of this case failed" not in text


@pytest.mark.parametrize("seed", range(2))
def test_numbers_of_any_size_are_reported(tmp_path, seed):
    root = make_run(tmp_path / "run", pictures=False)
    spoil(root, seed)
    assert_whole(render(root).read_text())


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
    assert reason != "object" or reason in said(root)
    entry = load_run(root).entries[0]
    assert entry.result is None
    assert reason in entry.defect


def test_cases_that_processes_draw_side_by_side_make_the_same_page(plain_run, monkeypatch):
    alone = (plain_run / "report.html").read_bytes()
    monkeypatch.setattr(rendering, "_FEWEST", 1)

    def not_here(*arguments):
        raise AssertionError("a case that another process draws was drawn here")

    with monkeypatch.context() as patch:
        patch.setattr(rendering, "case_view", not_here)
        assert render(plain_run, jobs=2).read_bytes() == alone

    def dying(draw, *rows):
        yield draw(*next(zip(*rows, strict=True)))
        raise BrokenProcessPool

    pool = nullcontext(SimpleNamespace(map=dying))
    monkeypatch.setattr(rendering, "ProcessPoolExecutor", lambda *_: pool)
    assert render(plain_run, jobs=2).read_bytes() == alone
