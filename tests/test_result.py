"""The result model: what is written is what is read; a damaged file is one clear line."""

import json

import pytest

from verify.errors import InputError
from verify.result import (
    CaseResult,
    Metric,
    Rate,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
    read_result,
    write_result,
)


def judged(*verdicts):
    records = [
        VerdictRecord("error", "xfem", "m", v, 0.1, 0.0, 0.2, "≤ 0.1", "?") for v in verdicts
    ]
    return CaseResult(
        case="statics/a",
        title="A",
        requirement="It shall hold.",
        scene_hash="00",
        scene={"title": "A"},
        reference={"kind": "exact"},
        solves=[
            SolveRecord(
                "statics/a", "xfem", 0, Status.SOLVED,
                metrics=[Metric("energy_norm", 0.25, "1", uncertainty=1e-3, source="exact: patch")],
                timings={"solve": [0.1, 0.2]}, size=0.5, unknowns=8,
            ),
            SolveRecord("statics/a", "xfem", 1, Status.TIMEOUT, "killed after 3 s"),
        ],
        rates=[Rate("xfem", "energy_norm", None, 0.0, "too few levels: 1", [])],
        verdicts=records,
    )  # fmt: skip


def test_a_result_is_read_as_it_was_written(tmp_path):
    result = judged(*Verdict)
    write_result(result, tmp_path / "a" / "result.json")
    assert read_result(tmp_path / "a" / "result.json") == result
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["result.json"]


@pytest.mark.parametrize(
    "verdicts, worst",
    [
        ([Verdict.PASS], Verdict.PASS),
        ([Verdict.PASS, Verdict.UNDECIDED], Verdict.UNDECIDED),
        ([Verdict.UNDECIDED, Verdict.FAIL, Verdict.PASS], Verdict.FAIL),
        ([Verdict.ERROR, Verdict.FAIL], Verdict.ERROR),
        ([], Verdict.UNDECIDED),
    ],
)
def test_a_case_is_as_good_as_its_worst_verdict(verdicts, worst):
    assert judged(*verdicts).verdict is worst


def test_a_metric_is_found_by_its_name():
    solve = judged().solves[0]
    assert solve.metric("energy_norm").value == 0.25
    assert solve.metric("jump_l2") is None


def damaged(change):
    def apply(path):
        record = json.loads(path.read_text())
        change(record)
        path.write_text(json.dumps(record))

    return apply


@pytest.mark.parametrize(
    "damage, fault",
    [
        (lambda path: path.unlink(), "no such file"),
        (lambda path: path.write_text(path.read_text()[:100]), "not a JSON file"),
        (lambda path: path.write_bytes(b"\xff\xff"), "not a JSON file"),
        (lambda path: path.write_text("[]"), "not a result of schema version 1"),
        (damaged(lambda r: r.update(schema=2)), "not a result of schema version 1"),
        (damaged(lambda r: r.pop("solves")), "not a readable result"),
        (
            damaged(lambda r: r["solves"][0].update(status="asleep")),
            "'asleep' is not a valid Status",
        ),
        (damaged(lambda r: r["solves"][0].update(colour="red")), "not a readable result"),
        (damaged(lambda r: r["verdicts"][0].pop("limit")), "not a readable result"),
    ],
    ids=["missing", "cut off", "binary", "list", "newer", "no solves", "status", "key", "limit"],
)
def test_a_damaged_result_is_said_in_one_line(tmp_path, damage, fault):
    path = tmp_path / "result.json"
    write_result(judged(Verdict.PASS), path)
    damage(path)
    with pytest.raises(InputError, match=fault) as caught:
        read_result(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
