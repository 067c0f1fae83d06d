"""Results and their files: written whole, read back, with their provenance."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import verify
from verify import provenance as module
from verify.errors import InputError
from verify.files import asked_place, whole_file, write_json, write_plain, write_whole
from verify.provenance import provenance, versions
from verify.result import (
    CaseResult,
    CutRecord,
    Metric,
    Rate,
    ReferenceRecord,
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
    cut = CutRecord(2, 0.1, 0.04, 0.0, 0.0, 0.01, 0.7, 0.06, None, {"jump_l2": 1.0})
    solves = [
        SolveRecord("statics/a", "xfem", 0, Status.SOLVED, timings={"solve": [0.1, 0.2]}, size=0.5,
                    metrics=[Metric("energy_norm", 0.25, "1", uncertainty=1e-3, source="exact")],
                    unknowns=8, cut=cut),
        SolveRecord("statics/a", "xfem", 1, Status.TIMEOUT, "killed after 3 s"),
    ]  # fmt: skip
    rates = [Rate("xfem", "energy_norm", None, 0.0, "too few levels: 1", [])]
    return CaseResult("statics/a", "A", "It shall hold.", "00", {"title": "A"},
                      ReferenceRecord("exact"), solves, rates, records)  # fmt: skip


def test_files_are_json_with_each_row_of_numbers_on_a_line(tmp_path):
    content = {"a": [[0.1, -2e-300], [], {}], "ε": {"b": True, "c": None}, "d": "\n", "e": [1, "x"]}
    write_json(content, tmp_path / "some.json")
    lines = (tmp_path / "some.json").read_text().splitlines()
    assert json.loads("\n".join(lines)) == content
    assert lines[2:5] == ["  [0.1, -2e-300],", "  [],", "  {}"]
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_plain([[float("nan")]], tmp_path / "nan.json")


def test_a_result_is_read_as_it_was_written(tmp_path):
    result = judged(*Verdict)
    write_result(result, tmp_path / "a" / "result.json")
    assert read_result(tmp_path / "a" / "result.json") == result
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["result.json"]
    older = json.loads((tmp_path / "a" / "result.json").read_text())
    del older["solves"][0]["cut"]
    (tmp_path / "a" / "result.json").write_text(json.dumps(older))
    assert read_result(tmp_path / "a" / "result.json").solves[0].cut is None


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


PASS, FAIL, UNDECIDED, ERROR = Verdict.PASS, Verdict.FAIL, Verdict.UNDECIDED, Verdict.ERROR


@pytest.mark.parametrize(
    "verdicts, lost, worst",
    [
        ([PASS], 0, PASS), ([PASS, UNDECIDED], 0, UNDECIDED), ([UNDECIDED, FAIL, PASS], 0, FAIL),
        ([ERROR, FAIL], 0, FAIL), ([ERROR, PASS], 0, ERROR), ([], 0, UNDECIDED),
        # a solver that could not be judged does not hide the others
        ([PASS], 2, UNDECIDED), ([PASS, UNDECIDED], 2, UNDECIDED), ([PASS, FAIL], 2, FAIL),
        ([PASS, ERROR], 2, ERROR),
    ],
)  # fmt: skip
def test_a_case_is_as_good_as_its_worst_verdict(verdicts, lost, worst):
    result = judged(*verdicts)
    others = [replace(v, solver="removal") for v in judged(*[ERROR] * lost).verdicts]
    assert replace(result, verdicts=[*result.verdicts, *others]).verdict is worst


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
)  # fmt: skip
def test_a_damaged_result_is_said_in_one_line(tmp_path, damage, fault):
    path = tmp_path / "result.json"
    write_result(judged(Verdict.PASS), path)
    damage(path)
    with pytest.raises(InputError, match=fault) as caught:
        read_result(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("end", [OSError, ValueError, KeyboardInterrupt])
def test_what_was_there_stays_if_writing_does_not_end(tmp_path, end):
    write_whole(tmp_path / "a.txt", "old")

    def begin():
        with whole_file(tmp_path / "a.txt") as partial:
            partial.write_text("ne")
            raise end

    with pytest.raises(end):
        begin()
    assert [file.read_text() for file in tmp_path.iterdir()] == ["old"]


def test_the_name_in_an_error_is_that_of_the_file_asked_for(tmp_path):
    (tmp_path / "folder").mkdir()
    for place in (tmp_path / "absent/a.txt", tmp_path / "folder"):
        with pytest.raises(OSError, match=f"'{place}'$"):
            write_whole(place, "a")
        with pytest.raises(InputError, match=f"^{place}: cannot be written"), asked_place(place):
            write_whole(place, "a")
    # what another file is to blame for keeps that file's name
    with pytest.raises(FileNotFoundError, match=r"other\.txt'$"), whole_file(tmp_path / "a.txt"):
        (tmp_path / "other.txt").read_text()


ROOT = Path(verify.__file__).parent.parent


def git(*arguments):
    return subprocess.run(
        ["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=True
    )


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_the_commit_is_that_of_the_checkout():
    origin = provenance()
    assert origin["commit"] == git("rev-parse", "HEAD").stdout.strip()
    assert isinstance(origin["dirty"], bool)


def test_a_repository_that_only_happens_to_be_around_us_is_not_ours(tmp_path, monkeypatch):
    """A virtual environment inside somebody's repository: its commit says nothing of our code."""
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    package = tmp_path / ".venv" / "lib" / "verify" / "__init__.py"
    monkeypatch.setattr(module.verify, "__file__", str(package))
    assert module._commit() in [(None, None)] or module._commit()[1] is False  # pip's own record


def test_versions_are_those_of_the_libraries_and_nothing_is_imported_for_them():
    import numpy

    assert versions()["numpy"] == numpy.__version__
    code = "import sys; from verify.provenance import provenance; provenance(); print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert {"numpy", "dolfinx", "petsc4py", "gmsh"}.isdisjoint(loaded.stdout.split())
