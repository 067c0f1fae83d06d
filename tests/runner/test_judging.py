"""Verdicts of a run: who is judged, exit codes, error fields, critical steps of rivals."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from verify.judge import accuracy
from verify.result import (
    CRITICAL_STEP,
    CaseResult,
    ReferenceRecord,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
)
from verify.runner import judging
from verify.runner.directory import MEASURED
from verify.runner.run import exit_code
from verify.runner.solve import solve_job
from verify.scene import load_scene, scene_content

INSTANT, WRONG = "fake_solvers:Instant", "fake_solvers:Wrong"


def check(solver=None, metric="displacement_l2", at_most=1e-10):
    named = "" if solver is None else f'solver = "{solver}"\n'
    return f'\n[[acceptance]]\ncheck = "error"\n{named}metric = "{metric}"\nat_most = {at_most}\n'


def with_checks(verify, *checks):
    case = verify.folder / "square.toml"
    case.write_text(case.read_text() + "".join(checks))


def verdicts(done):
    (case,) = json.loads(done.stdout)["cases"]
    return {v["solver"]: (v["verdict"], v["reason"]) for v in case["verdicts"]}


RUN = ("run", "square.toml", "--out", "out", "--json", "-j", "2", "--no-conform")
BESIDE = (*RUN, *(f"--solver={s}" for s in (INSTANT, WRONG, "fake_solvers:Refusing")))


def test_a_check_without_a_solver_is_made_of_each_that_is_asked_and_does_not_refuse(verify):
    """A wrong solver beside a right one is not passed over."""
    with_checks(verify, check())
    done = verify(*BESIDE)
    assert {name: v for name, (v, _) in verdicts(done).items()} == {INSTANT: "PASS", WRONG: "FAIL"}
    assert done.returncode == 1
    again = verify(*BESIDE, "--judge", INSTANT)
    assert list(verdicts(again)) == [INSTANT]
    assert again.returncode == 0
    assert again.stderr.count("reused") == 5  # four solves and a refusal
    none = verify(*BESIDE, "--judge", "fake_solvers:Wrnog")
    assert none.returncode == 2
    assert "--judge: solver 'fake_solvers:Wrnog' is not asked; did you mean" in none.stderr


def test_a_known_finding_stays_failed_and_leaves_the_exit_code_to_the_others(verify):
    known = f'''
[[known_findings]]
solver = "{WRONG}"
check = "error"
metric = "displacement_l2"
reason = "It stretches twice as much."
'''
    with_checks(verify, check(), known)
    done = verify(*BESIDE)
    (case,) = json.loads(done.stdout)["cases"]
    (found,) = [v for v in case["verdicts"] if v["solver"] == WRONG]
    assert (case["verdict"], found["verdict"]) == ("FAIL", "FAIL")
    assert found["known"] == "It stretches twice as much."
    assert done.returncode == 0
    with_checks(verify, check(metric="strain_energy", at_most=1e-9))
    assert verify(*BESIDE).returncode == 1  # another check that it fails is not known


def test_who_died_or_was_not_asked_for_leaves_the_verdicts_of_the_others(verify):
    died = "fake_solvers:Raising"
    with_checks(verify, check(INSTANT), check(died), check("xfem"))
    asked = ("run", "square.toml", "--out", "out", "--json", "--solver", INSTANT)
    for options, code in (((), 0), (("--strict",), 5), (("--solver", died, "--no-conform"), 3)):
        if died in options:
            asked = (*asked[:3], "two", *asked[4:])
        done = verify(*asked, *options)
        found = verdicts(done)
        assert found["xfem"] == ("UNDECIDED", "the run was not asked for solver 'xfem'")
        assert found[INSTANT][0] == "PASS"
        assert done.returncode == json.loads(done.stdout)["exit"] == code
    assert found[died][0] == "ERROR"
    assert "the pivot is zero" in found[died][1]


def test_changed_acceptance_is_judged_again_without_solving(verify):
    solves = verify.folder / "solves"
    command = ("run", "square.toml", "--out", "out", "--json", "--solver", WRONG)
    with_checks(verify, check(WRONG))
    assert verdicts(verify(*command, COUNT_SOLVES=str(solves)))[WRONG][0] == "FAIL"
    case = verify.folder / "square.toml"
    case.write_text(case.read_text().replace("at_most = 1e-10", "at_most = 10.0"))
    assert verdicts(verify(*command, COUNT_SOLVES=str(solves)))[WRONG][0] == "PASS"
    assert len(solves.read_text().splitlines()) == 2


def test_a_comparison_that_was_stopped_goes_on_at_the_solve_that_it_was_at(verify, monkeypatch):
    """No finished pair of solution and reference is measured twice, and the result is the same."""
    with_checks(verify, check())
    assert verify(*BESIDE).returncode == 1
    (question,) = verify.folder.glob("out/cases/*/judge.json")
    folder, measure, calls = question.parent, accuracy._measure, []
    whole = json.loads((folder / "result.json").read_text())
    assert not (folder / MEASURED).exists()  # it is over
    (folder / "judged.json").unlink()

    def stopped(record, *others):
        calls.append((record.solver, record.level))
        if len(calls) == 3:
            raise KeyboardInterrupt
        return measure(record, *others)

    monkeypatch.setattr(judging, "die_with_parent", lambda: None)
    monkeypatch.setattr(accuracy, "_measure", stopped)
    with pytest.raises(KeyboardInterrupt):
        judging.main(question)
    assert len(calls) == 3
    judging.main(question)
    assert sorted(set(calls)) == sorted([*calls[:2], *calls[3:]])  # the third once more
    assert calls[2] == calls[3]
    assert json.loads((folder / "result.json").read_text()) == whole
    # of another key nothing is taken
    (folder / MEASURED).mkdir()
    kept = judging._Measurements(folder, "one")
    kept.keep(SolveRecord("c", INSTANT, 0, Status.SOLVED))
    assert kept.measured(SolveRecord("c", INSTANT, 0, Status.SOLVED)) is not None
    other = judging._Measurements(folder, "two")
    assert other.measured(SolveRecord("c", INSTANT, 0, Status.SOLVED)) is None


def result(verdicts=(), statuses=()):
    judged = [VerdictRecord("value", "xfem", "m", v, 1, 1, 1, "", "") for v in verdicts]
    solves = [SolveRecord("c", "xfem", i, status) for i, status in enumerate(statuses)]
    return CaseResult("c", "", "", "", {}, ReferenceRecord(), solves, [], judged)


PASS, FAIL, UNDECIDED, ERROR = Verdict.PASS, Verdict.FAIL, Verdict.UNDECIDED, Verdict.ERROR
SOLVED, REFUSED = Status.SOLVED, Status.REFUSED


@pytest.mark.parametrize(
    "verdicts, statuses, normal, strict",
    [
        ([PASS], [SOLVED], 0, 0),
        ([PASS, UNDECIDED], [SOLVED], 0, 5),
        ([PASS], [SOLVED, REFUSED], 0, 5),
        ([], [SOLVED], 0, 5),
        ([PASS, FAIL], [SOLVED], 1, 1),
        ([ERROR], [SOLVED], 3, 3),
        ([PASS], [SOLVED, Status.TIMEOUT], 3, 3),
        ([PASS], [SOLVED, Status.MEMORY], 3, 3),
        ([PASS], [SOLVED, Status.FAILED], 3, 3),
        ([FAIL, ERROR], [SOLVED, Status.FAILED], 1, 1),
        ([], [REFUSED], 4, 4),
        ([], [], 4, 4),
    ],
)
def test_the_exit_code_of_one_case(verdicts, statuses, normal, strict):
    assert exit_code([result(verdicts, statuses)]) == normal
    assert exit_code([result(verdicts, statuses)], strict=True) == strict


def test_a_known_finding_does_not_count_and_another_failure_does():
    case = result([PASS, FAIL], [SOLVED])
    case.verdicts[1] = replace(case.verdicts[1], known="its reason")
    assert case.verdict is FAIL
    assert exit_code([case], strict=True) == 0
    assert exit_code([case, result([FAIL], [SOLVED])]) == 1


def test_the_order_of_the_cases_does_not_matter():
    cases = [result([FAIL], [SOLVED]), result([ERROR], [Status.FAILED]), result([PASS], [SOLVED])]
    assert {exit_code(list(order)) for order in itertools.permutations(cases)} == {1}
    assert {exit_code(list(order)) for order in itertools.permutations(cases[1:])} == {3}


DEPTH = 0.0137


def text(case):
    """A case as TOML."""
    return "".join(f"{key} = {value(part)}\n" for key, part in case.items())


def value(part):
    if isinstance(part, dict):
        return "{" + ", ".join(f"{key} = {value(one)}" for key, one in part.items()) + "}"
    return f"[{', '.join(map(value, part))}]" if isinstance(part, list) else json.dumps(part)


def test_every_rival_of_a_motion_says_its_critical_step(tmp_path):
    """Subdivision makes slivers elements of their own: its step is shorter; springs have none."""
    steps = {}
    for case in ("cutting/plate_crossed_quick", "statics/f1_patch"):
        for name in ("xfem", "subdivision", "mass_spring")[: 3 if case.startswith("cut") else 1]:
            job = {"scene": scene_content(load_scene(case)), "solver": name, "level": 0}
            outcome = solve_job({**job, "repetitions": 1, "parameters": {}}, tmp_path, store=False)
            steps[name, case[:3]] = outcome["notes"].get(CRITICAL_STEP)
            assert "calibration" not in outcome["notes"]  # one repetition has no speed
    own, split = (float(steps[n, "cut"].removesuffix(" s")) for n in ("xfem", "subdivision"))
    assert 0.0 < split < 0.9 * own
    assert "springs" in steps["mass_spring", "cut"]
    assert steps["xfem", "sta"] is None  # at rest


def pressed_case():
    """Two halves of a unit cube, pressed rigidly into one another by `DEPTH`."""
    normal = np.array([-0.27, 0.14, 0.95])
    normal /= np.linalg.norm(normal)
    frame = np.linalg.svd(normal[None])[2][1:]  # along the cut
    ends = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    side = {"normal": normal.tolist(), "shift": [[0.0, 0.0, -DEPTH], [0.0] * 3],
            "point": [0.47] * 3, "strain": [[0.0, 0.0]] * 2}  # fmt: skip
    shared = {"metric": "overlap_depth", "solver": "xfem"}
    return {
        "title": "Pressed halves", "requirement": "Faces shall overlap by the depth given.",
        "geometry": {"kind": "box", "lower": [0.0] * 3, "upper": [1.0] * 3},
        "mesh": {"cells": [[5, 4, 3]]}, "material": {"young": 1.0, "poisson": 0.3},
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "cuts": [{"kind": "polygon", "points": [(0.47 + 2 * e @ frame).tolist()
                                                for e in map(np.array, ends)]}],
        "contact": {"expected": "overlap"},
        "exact": {"solution": "solid_patch", "parameters": side},
        "acceptance": [
            {**shared, "check": "value", "equals": DEPTH, "relative_tolerance": 1e-6,
             "source": "prescribed"},
            {**shared, "check": "error", "at_most": 1.001 * DEPTH},
            {**shared, "check": "error", "at_most": 0.999 * DEPTH},
        ],
    }  # fmt: skip


def test_the_depth_of_an_overlap_is_judged_and_its_rate_refused_with_what_can_be_asked(verify):
    (verify.folder / "pressed.toml").write_text(text(pressed_case()))
    done = verify("run", "pressed.toml", "--out", "out", "--json", "--solver", "xfem")
    (case,) = json.loads(done.stdout)["cases"]
    found = [(v["verdict"], v["observed"]) for v in case["verdicts"]]
    assert [verdict for verdict, _ in found] == ["PASS", "PASS", "FAIL"]
    assert found[0][1] == pytest.approx(DEPTH, rel=1e-9)
    case = pressed_case() | {"mesh": {"cells": [[2] * 3, [4] * 3, [8] * 3]}}
    case["acceptance"] = [{"check": "rate", "metric": "overlap_depth", "at_least": 1.0}]
    (verify.folder / "pressed.toml").write_text(text(case))
    done = verify("check", "pressed.toml")
    assert done.returncode == 2
    assert "overlap_depth has no rate; expected a check 'error' (at most, m)" in done.stderr
