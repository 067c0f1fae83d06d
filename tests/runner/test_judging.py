"""From the solves of a case to its verdicts, and to the exit code."""

import json

import pytest

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


def test_a_right_solver_passes_and_a_wrong_one_fails_whatever_else_died(verify):
    with_checks(verify, check(INSTANT), check(WRONG), check("fake_solvers:Raising"))
    solvers = [f"--solver={s}" for s in (INSTANT, WRONG, "fake_solvers:Raising")]
    done = verify(
        "run", "square.toml", "--out", "out", "--json", "-j", "2", "--no-conform", *solvers
    )
    found = verdicts(done)
    assert found[INSTANT][0] == "PASS"
    assert found[WRONG][0] == "FAIL"
    assert found["fake_solvers:Raising"][0] == "ERROR"
    assert "the pivot is zero" in found["fake_solvers:Raising"][1]
    assert done.returncode == json.loads(done.stdout)["exit"] == 1


RUN = ("run", "square.toml", "--out", "out", "--json", "-j", "2", "--no-conform")
BESIDE = (*RUN, f"--solver={INSTANT}", f"--solver={WRONG}", "--solver=fake_solvers:Refusing")


def test_a_check_without_a_solver_is_made_of_each_that_is_asked_and_does_not_refuse(verify):
    """A wrong solver beside a right one is not passed over."""
    with_checks(verify, check())
    done = verify(*BESIDE)
    assert {name: v for name, (v, _) in verdicts(done).items()} == {INSTANT: "PASS", WRONG: "FAIL"}
    assert done.returncode == 1
    again = verify(*BESIDE, "--judge", INSTANT)
    assert list(verdicts(again)) == [INSTANT]
    assert again.returncode == 0
    assert again.stderr.count("reused") == 4
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


@pytest.mark.parametrize(("options", "code"), [((), 0), (("--strict",), 5)])
def test_a_check_of_a_solver_that_was_not_asked_for_stays_undecided(verify, options, code):
    with_checks(verify, check(INSTANT), check("xfem"))
    done = verify("run", "square.toml", "--out", "out", "--json", "--solver", INSTANT, *options)
    assert verdicts(done)["xfem"] == ("UNDECIDED", "the run was not asked for solver 'xfem'")
    assert verdicts(done)[INSTANT][0] == "PASS"
    assert done.returncode == code


def test_changed_acceptance_is_judged_again_without_solving(verify):
    solves = verify.folder / "solves"
    command = ("run", "square.toml", "--out", "out", "--json", "--solver", WRONG)
    with_checks(verify, check(WRONG))
    assert verdicts(verify(*command, COUNT_SOLVES=str(solves)))[WRONG][0] == "FAIL"
    case = verify.folder / "square.toml"
    case.write_text(case.read_text().replace("at_most = 1e-10", "at_most = 10.0"))
    assert verdicts(verify(*command, COUNT_SOLVES=str(solves)))[WRONG][0] == "PASS"
    assert len(solves.read_text().splitlines()) == 2
