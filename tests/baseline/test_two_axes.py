"""The last own value and the independent value are two axes, and only the first ever moves."""

import json
from dataclasses import replace

import pytest
import runs

from verify.provenance import changes_of
from verify.result import CutRecord


@pytest.fixture
def saved(baseline, tmp_path):
    """The command, with one run saved."""
    baseline("save", runs.run(tmp_path / "old"))
    return baseline


def rows(answer, axis=None):
    return {
        (row["quantity"], row["axis"]): row["verdict"]
        for row in answer["rows"]
        if axis in (None, row["axis"])
    }


def stored(baseline):
    return json.loads(baseline.file.read_text())["cases"]["a/case"]


def test_the_same_run_again_is_within_every_tolerance(baseline, tmp_path):
    code, answer = baseline("save", runs.run(tmp_path / "old"))
    assert (code, answer["added"]) == (0, 4)  # three metrics of the finest level and a speed
    code, answer = baseline("check", tmp_path / "old")
    assert code == 0
    assert set(rows(answer).values()) == {"PASS"}
    assert len(answer["rows"]) == 3 + 3 + 1


def test_independent_values_and_tolerances_come_from_the_case_never_from_what_was_measured(
    saved, tmp_path
):
    quantities = stored(saved)["quantities"]
    energy = quantities["xfem/1/strain_energy"]["independent"]
    assert (energy["value"], energy["tolerance"], energy["source"]) == (2.0, 0.01, "a book")
    sag = quantities["xfem/1/sag"]["independent"]
    assert (sag["value"], sag["uncertainty"], sag["tolerance"]) == (-0.5, 0.001, 0.05)
    error = quantities["xfem/1/displacement_l2"]["independent"]
    assert (error["value"], error["tolerance"]) == (0.0, 0.02)
    assert quantities["xfem/1/sag"]["own"]["commit"] == "c0ffee"


def test_bounds_of_errors_are_asked_of_solvers_and_not_of_the_reference(baseline, tmp_path):
    """C6's, rounded in its bundle, balances its energy to 1.1e-10; solvers are asked for 1e-10."""
    reference = replace(runs.solve(error=0.05), solver="reference")
    code, _ = baseline("save", runs.run(tmp_path / "old", runs.result(runs.solve(), reference)))
    assert code == 0
    known = stored(baseline)["quantities"]
    assert known["reference/1/displacement_l2"]["independent"]["tolerance"] is None
    assert known["reference/1/strain_energy"]["independent"]["tolerance"] == 0.01  # of a book
    assert known["xfem/1/displacement_l2"]["independent"]["tolerance"] == 0.02


def test_a_value_that_moves_within_its_accuracy_fails_on_the_own_axis_only(saved, tmp_path):
    new = runs.run(tmp_path / "new", runs.result(runs.solve(energy=2.002)))
    code, answer = saved("check", new)
    assert code == 1
    found = rows(answer)
    assert found["xfem/1/strain_energy", "own"] == "FAIL"
    assert found["xfem/1/strain_energy", "independent"] == "PASS"
    assert found["xfem/1/sag", "own"] == "PASS"


@pytest.mark.parametrize(
    "sag, verdict",
    [(-0.523, "PASS"), (-0.5245, "UNDECIDED"), (-0.527, "FAIL")],  # 5 % of 0.5, known to 0.001
)
def test_the_independent_axis_knows_how_well_its_value_is_known(saved, tmp_path, sag, verdict):
    _, answer = saved("check", runs.run(tmp_path / "new", runs.result(runs.solve(sag=sag))))
    assert rows(answer)["xfem/1/sag", "independent"] == verdict


def test_a_reference_that_contradicts_the_stored_one_is_found(saved, tmp_path):
    within = runs.result(runs.solve(reference=-0.5015))  # uncertainties of 0.001 each
    _, answer = saved("check", runs.run(tmp_path / "near", within))
    assert rows(answer, "reference") == {}
    beyond = runs.result(runs.solve(reference=-0.5025))
    code, answer = saved("check", runs.run(tmp_path / "far", beyond))
    assert code == 1
    assert rows(answer, "reference") == {("xfem/1/sag", "reference"): "FAIL"}


def test_round_off_may_change_by_any_factor(baseline, tmp_path):
    baseline("save", runs.run(tmp_path / "old", runs.result(runs.solve(error=1e-15))))
    new = runs.run(tmp_path / "new", runs.result(runs.solve(error=7e-14)))
    _, answer = baseline("check", new)
    assert rows(answer)["xfem/1/displacement_l2", "own"] == "PASS"


def test_update_without_a_name_shows_the_difference_and_moves_nothing(saved, tmp_path):
    before = saved.file.read_bytes()
    new = runs.run(tmp_path / "new", runs.result(runs.solve(energy=2.002, sag=-0.521)))
    code, answer = saved("update", new)
    assert code == 0
    assert {(m["quantity"], m["state"]) for m in answer["moves"]} == {
        ("xfem/1/strain_energy", "differs"),
        ("xfem/1/sag", "differs"),
    }
    assert saved.file.read_bytes() == before


def test_update_moves_the_own_value_of_what_is_named_and_nothing_else(saved, tmp_path):
    before = stored(saved)
    changed = runs.solve(energy=2.002, sag=-0.521, reference=-0.5005)
    new = runs.run(tmp_path / "new", runs.result(changed), commit="beef")
    code, answer = saved("update", new, "--only", "a/case:strain_energy")
    assert (code, answer["moved"]) == (0, 1)
    after = stored(saved)
    own = after["quantities"]["xfem/1/strain_energy"]["own"]
    assert (own["value"], own["commit"]) == (2.002, "beef")
    # put the one moved axis back: all else is as it was, to the last character
    after["quantities"]["xfem/1/strain_energy"]["own"] = before["quantities"][
        "xfem/1/strain_energy"
    ]["own"]
    assert after == before


def test_update_refuses_a_value_that_contradicts_the_independent_one(saved, tmp_path):
    before = saved.file.read_bytes()
    new = runs.run(tmp_path / "new", runs.result(runs.solve(energy=2.2)))
    code, answer = saved("update", new, "--only", "a/case:xfem/1/strain_energy")
    assert code == 1
    assert answer["moves"][0]["state"] == "refused"
    assert "contradicts" in answer["moves"][0]["reason"]
    assert saved.file.read_bytes() == before


def test_another_scene_is_not_compared_and_never_passes(saved, tmp_path):
    soft = {"material": {"young": 0.9, "poisson": 0.3, "plane": "strain"}}
    new = runs.run(tmp_path / "new", runs.result(scene=soft))
    code, answer = saved("check", new)
    assert code == 3
    assert "scene" in answer["rows"][0]["reason"]
    assert saved("save", new)[0] == 2
    code, answer = saved("update", new, "--only", "a/case:sag")
    assert (code, answer["moved"], answer["moves"][0]["state"]) == (1, 0, "refused")


def test_what_was_not_looked_at_is_not_right(saved, tmp_path):
    failed = runs.SolveRecord("a/case", "xfem", 1, runs.Status.FAILED, "zero pivot")
    code, answer = saved("check", runs.run(tmp_path / "new", runs.result(failed)))
    assert code == 3
    assert {row["verdict"] for row in answer["rows"] if row["axis"] == "own"} == {"ERROR"}
    assert "failed: zero pivot" in answer["rows"][0]["reason"]
    other = runs.result()
    object.__setattr__(other, "case", "another/case")
    elsewhere = runs.run(tmp_path / "elsewhere", other)
    code, answer = saved("check", elsewhere)
    assert code == 3
    assert answer["rows"][0]["reason"] == "not in this run"
    assert saved("check", elsewhere, "--partial")[0] == 0
    assert saved("check", elsewhere, "--partial", "--strict")[0] == 5  # its values are new


@pytest.mark.parametrize(
    "change, said",
    [
        (lambda case: case["quantities"]["xfem/1/sag"]["own"].update(valeu=1.0), "valeu"),
        (lambda case: case["quantities"]["xfem/1/sag"]["own"].update(value="1"), "value"),
        (lambda case: case["quantities"]["xfem/1/sag"].pop("own"), "own: missing"),
        (lambda case: case["speed"]["xfem/1"].update(slower_at_most=0.5), "slower_at_most"),
    ],
)
def test_a_slip_of_the_hand_in_the_file_is_named(baseline, tmp_path, change, said):
    old = runs.run(tmp_path / "old")
    baseline("save", old)
    content = json.loads(baseline.file.read_text())
    change(content["cases"]["a/case"])
    baseline.file.write_text(json.dumps(content))
    code, error = baseline("check", old)
    assert code == 2
    assert said in error
    assert error.count("\n") == 1


REGION = {"supports": [{"where": "x < 0.3", "displacement": [0.0, 0.0]}]}


def of_region(energy=2.001):
    return runs.result(runs.solve(energy=energy), scene=REGION)


def test_a_number_that_means_something_else_than_the_stored_one_says_so_and_fails_nothing(
    baseline, tmp_path
):
    """A file from before revisions, of a case with a part of the boundary that a formula names."""
    baseline("save", runs.run(tmp_path / "old", of_region()))
    content = json.loads(baseline.file.read_text())
    for quantity in content["cases"]["a/case"]["quantities"].values():
        del quantity["own"]["meaning"], quantity["independent"]["meaning"]
    baseline.file.write_text(json.dumps(content))
    new = runs.run(tmp_path / "new", of_region(2.002), meaning=2)
    code, answer = baseline("check", new)
    assert code == 0
    found = {(r["quantity"], r["axis"]): r for r in answer["rows"]}
    changed = found["xfem/1/strain_energy", "meaning"]
    assert changed["verdict"] == "UNDECIDED"
    assert "since revision 2 loads and supports act on" in changed["reason"]
    assert "`update` it by name" in changed["reason"]
    assert found["xfem/1/sag", "meaning"]["verdict"] == "PASS"  # it has not moved
    assert found["xfem/1/strain_energy", "independent"]["verdict"] == "PASS"
    assert baseline("check", new, "--strict")[0] == 5
    baseline("update", new, "--only", "a/case:strain_energy")
    code, answer = baseline("check", new)
    assert rows(answer)["xfem/1/strain_energy", "own"] == "PASS"
    # and from then on it is held as ever
    later = runs.run(tmp_path / "later", of_region(2.003), meaning=2)
    assert rows(baseline("check", later)[1])["xfem/1/strain_energy", "own"] == "FAIL"


FINITE = {"kind": "dynamic", "kinematics": "finite_rotation"}


@pytest.mark.parametrize(("scene", "metric", "lateral", "count"), [
    ({}, "strain_energy", None, 0),
    (REGION, "strain_energy", None, 1),
    ({}, "energy_drift", None, 0),  # at rest
    ({"analysis": {"kind": "dynamic"}}, "energy_drift", None, 1),
    ({"analysis": {"kind": "dynamic"}}, "displacement_l2", None, 1),  # another scheme judges
    ({"analysis": FINITE}, "displacement_l2", None, 0),
    ({"analysis": {"kind": "dynamic"}, "cuts": [{"kind": "tool_path"}]}, "energy_norm", None, 0),
    ({"analysis": {"kind": "dynamic"}, "exact": {"solution": "x"}}, "energy_norm", None, 0),
    ({}, "displacement_l2", 0.1, 1),
    ({}, "displacement_l2", 0.001, 0),  # a faceted arc: nothing changed
])  # fmt: skip
def test_a_change_of_meaning_concerns_only_what_it_names(scene, metric, lateral, count):
    cut = lateral and CutRecord(2, lateral, 0.0, 0.0, 0.0, 0.0, 0.1, 0.01, None)
    solve = replace(runs.solve(), cut=cut or None)
    assert len(list(changes_of(metric, scene, solve, 1, 2))) == count
    assert not list(changes_of(metric, scene, solve, 2, 2))


@pytest.mark.parametrize(("support", "count"), [
    ({"displacement": [0.0, 0.1], "history": [[0.0, 0.0], [0.3, 1.0]]}, 1),
    ({"displacement": ["abs(t - 0.3)", 0.0]}, 1),
    ({"displacement": [0.0, "0.1*cos(x)"]}, 0),  # at rest: no work
])  # fmt: skip
def test_the_account_of_a_body_that_supports_draw_has_another_meaning(support, count):
    moving = {"analysis": {"kind": "dynamic"}, "supports": [support]}
    assert len(list(changes_of("energy_drift", moving, runs.solve(), 4, 5))) == count
    assert not list(changes_of("displacement_l2", moving, runs.solve(), 4, 5))
    assert not list(changes_of("energy_drift", {"supports": [support]}, runs.solve(), 4, 5))
