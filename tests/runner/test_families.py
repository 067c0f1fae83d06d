"""Rows of a family: run as cases of their own, judged by each other, shown together."""

import json
from dataclasses import replace

import pytest

from verify.reference_record import ReferenceRecord
from verify.report.family_view import family_views
from verify.report.figures.style import Palette
from verify.report.run_directory import load_run
from verify.result import CaseResult, Metric, SolveRecord, Status, Verdict, VerdictRecord
from verify.runner.families import Families
from verify.scene import load_scenes

ROWS = "\n[parameters]\nepsilon = [0.5, 0.0]\n"
CHECK = """
[[acceptance]]
when = "epsilon > 0"
check = "ratio"
metric = "displacement_l2"
row = 0.0
within = 0.05
"""


def family(verify):
    case = verify.folder / "square.toml"
    text = case.read_text().replace("young = 1.0", 'young = "1.0 + epsilon"')
    assert "epsilon" in text
    case.write_text(text + CHECK + ROWS)


def test_rows_are_run_judged_by_each_other_and_reported(verify):
    """The error of the same wrong field is the same in both rows: a ratio of one."""
    family(verify)
    run = ("run", "square.toml", "--out", "out", "--json", "-j", "2", "--no-conform",
           "--solver=fake_solvers:Wrong")  # fmt: skip
    done = verify(*run)
    cases = {case["case"]: case for case in json.loads(done.stdout)["cases"]}
    assert list(cases) == ["square[epsilon=0.5]", "square[epsilon=0]"]
    (compared,) = [v for v in cases["square[epsilon=0.5]"]["verdicts"] if v["check"] == "ratio"]
    assert compared["verdict"] == "PASS"
    assert compared["observed"] == pytest.approx(1.0)
    (shown,) = family_views(load_run(verify.folder / "out"), Palette())
    tables = [table for table, _ in shown.parts]
    assert "relative L² error of the displacement" in [table.caption for table in tables]
    assert all(table.head[0].text == "epsilon =" for table in tables)
    assert [row[0].text for row in tables[0].rows] == ["0.5", "0"]
    again = verify(*run)
    assert json.loads(again.stdout)["cases"] == json.loads(done.stdout)["cases"]
    alone = verify(*[arg.replace("square.toml", "square.toml[epsilon=0.5]") for arg in run[:3]],
                   "one", *run[4:])  # fmt: skip
    assert len(json.loads(alone.stdout)["cases"]) == 2  # and the row that it is compared with


def result(scene, error, verdicts=()):
    solve = SolveRecord(
        scene.name, "own", 0, Status.SOLVED, size=0.1,
        metrics=[Metric("displacement_l2", error, "1")],
    )  # fmt: skip
    row = vars(scene.row)
    exact = ReferenceRecord("exact")
    return CaseResult(scene.name, "", "", "", {}, exact, [solve], [], list(verdicts), row=row)


@pytest.mark.parametrize(
    ("error", "verdict"), [(0.0104, Verdict.PASS), (0.0106, Verdict.FAIL), (0.0094, Verdict.FAIL)]
)
def test_a_row_waits_for_the_one_that_it_is_compared_with(tmp_path, verify, error, verdict):
    family(verify)
    case = verify.folder / "square.toml"
    near, base = load_scenes(case)
    own = [c for c in near.acceptance if c.check == "ratio"]
    near = near.model_copy(update={"acceptance": own})
    base = base.model_copy(update={"acceptance": []})
    waits = VerdictRecord("ratio", "own", "displacement_l2", Verdict.UNDECIDED, None, None, None,
                          "", "")  # fmt: skip
    families = Families([near, base])
    assert families.ready(result(near, error, [waits])) == []
    first, second = families.ready(result(base, 0.01))
    assert (first.case, second.case) == (near.name, base.name)
    assert first.verdicts[0].verdict is verdict
    alone = Families([near]).ready(result(near, error, [waits]))[0]
    assert alone.verdicts[0].verdict is Verdict.UNDECIDED
    assert "is not part of this run" in alone.verdicts[0].reason
    failed = replace(result(near, error, [waits]), reference=ReferenceRecord())
    assert Families([near]).ready(failed)[0].verdicts == [waits]
