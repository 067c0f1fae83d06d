"""The result model: what is written is what is read; a damaged file is one clear line."""

import json
import math
from dataclasses import replace

import pytest

from verify.errors import InputError
from verify.reference_record import ReferenceRecord
from verify.result import CaseResult, Metric, Rate, SolveRecord, Status, Verdict, VerdictRecord
from verify.result_files import read_result, write_result


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
        reference=ReferenceRecord("exact"),
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


def strict(path):
    """Read as readers do that know JSON's words only."""

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    return json.loads(path.read_text(), parse_constant=refuse)


def test_numbers_that_are_not_finite_are_null_and_named_and_come_back(tmp_path):
    odd = Metric("a~/b", math.nan, "1", None, math.inf)
    solve = replace(judged().solves[0], metrics=[odd], account={"~/": [0.0, -math.inf]})
    rate = Rate("xfem", "energy_norm", None, 0.0, "floor", [2.0, math.nan])
    path = tmp_path / "result.json"
    write_result(replace(judged(), solves=[solve], rates=[rate]), path)
    written, found = strict(path), read_result(path)
    assert written["solves"][0]["metrics"][0]["value"] is None
    assert written["not_finite"] == {
        "/solves/0/metrics/0/value": "nan",
        "/solves/0/metrics/0/uncertainty": "inf",
        "/solves/0/account/~0~1/1": "-inf",
        "/rates/0/pairwise/1": "nan",
    }
    metric = found.solves[0].metrics[0]
    assert math.isnan(metric.value)
    assert metric.reference is None
    assert metric.uncertainty == math.inf
    assert found.solves[0].account == {"~/": [0.0, -math.inf]}
    assert math.isnan(found.rates[0].pairwise[1])


@pytest.mark.parametrize(
    "verdicts, worst",
    [
        ([Verdict.PASS], Verdict.PASS),
        ([Verdict.PASS, Verdict.UNDECIDED], Verdict.UNDECIDED),
        ([Verdict.UNDECIDED, Verdict.FAIL, Verdict.PASS], Verdict.FAIL),
        ([Verdict.ERROR, Verdict.FAIL], Verdict.FAIL),
        ([Verdict.ERROR, Verdict.PASS], Verdict.ERROR),
        ([], Verdict.UNDECIDED),
    ],
)
def test_a_case_is_as_good_as_its_worst_verdict(verdicts, worst):
    assert judged(*verdicts).verdict is worst


@pytest.mark.parametrize(
    "beside, whole",
    [
        (Verdict.PASS, Verdict.UNDECIDED),
        (Verdict.UNDECIDED, Verdict.UNDECIDED),
        (Verdict.FAIL, Verdict.FAIL),
        (Verdict.ERROR, Verdict.ERROR),
    ],
)
def test_a_solver_that_could_not_be_judged_does_not_hide_the_others(beside, whole):
    lost = [replace(v, solver="removal") for v in judged(Verdict.ERROR, Verdict.ERROR).verdicts]
    result = judged(Verdict.PASS, beside)
    assert replace(result, verdicts=[*result.verdicts, *lost]).verdict is whole


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
        (lambda path: path.write_text("[]"), "object"),
        (damaged(lambda r: r.update(schema=2)), "not a result of schema version 1"),
        (damaged(lambda r: r.pop("solves")), "not a readable result"),
        (
            damaged(lambda r: r["solves"][0].update(status="asleep")),
            "solves.0.status: Input should be 'solved'",
        ),
        (damaged(lambda r: r["solves"][0].update(colour="red")), "not a readable result"),
        (damaged(lambda r: r["verdicts"][0].pop("limit")), "not a readable result"),
        (damaged(lambda r: r.update(not_finite={"/solves/9/size": "nan"})), "not a readable"),
        (damaged(lambda r: r.update(not_finite={"/case": "many"})), "not a readable result"),
    ],
    ids=["missing", "cut off", "binary", "list", "newer", "no solves", "status", "key", "limit",
         "no such place", "no number"],
)  # fmt: skip
def test_a_damaged_result_is_said_in_one_line(tmp_path, damage, fault):
    path = tmp_path / "result.json"
    write_result(judged(Verdict.PASS), path)
    damage(path)
    with pytest.raises(InputError, match=fault) as caught:
        read_result(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
