"""A solver with parameters is a solver of its own, with rows, verdicts and files beside others."""

import json

import pytest

from verify.cli import run_ranking
from verify.errors import InputError
from verify.solvers import named
from verify.study.variants import variant_of

GUEST = "fake_solvers:Straining"
TOO_FAR = f"{GUEST} strain=0.2"
FROZEN = "fake_solvers:Frozen"
CHECK = '\n[[acceptance]]\ncheck = "error"\nmetric = "displacement_l2"\nat_most = 1e-10\n'


def test_each_has_rows_verdicts_and_files_of_its_own_and_is_resumed(verify):
    solves, case = verify.folder / "solves", verify.folder / "square.toml"
    case.write_text(case.read_text() + CHECK)
    asked = ["--solver", f"{GUEST}  strain=0.2", "--solver", GUEST]
    command = ["run", "square.toml", *asked, "--out", "out", "--json"]
    done = verify(*command, COUNT_SOLVES=str(solves))
    (judged,) = json.loads(done.stdout)["cases"]
    verdicts = {(v["solver"], v["verdict"]) for v in judged["verdicts"]}
    assert verdicts == {(TOO_FAR, "FAIL"), (GUEST, "PASS")}
    (folder,) = (verify.folder / "out/cases").iterdir()
    given = {
        (k, level): json.loads((folder / f"{k}-{level}/record.json").read_text())["record"]
        for k in ("fake_solvers_Straining", "fake_solvers_Straining_strain_0.2")
        for level in (0, 1)
    }
    assert [one["parameters"] for one in given.values()] == 2 * [{}] + 2 * [{"strain": 0.2}]
    ranking = json.loads((verify.folder / "out/ranking.json").read_text())
    assert ranking["solvers"] == [TOO_FAR, GUEST]
    before = solves.read_text()
    verify(*command, COUNT_SOLVES=str(solves))
    assert solves.read_text() == before


def test_what_is_set_for_a_solver_holds_for_its_variants_unless_they_say_another(verify):
    rows = ["--solver", TOO_FAR, "--solver", f"{GUEST} way=across"]
    done = verify("run", "square.toml", *rows, "--set", f"{GUEST}.strain=0.3", "--out", "out")
    assert done.returncode == 0, done.stderr
    found = {name: record["parameters"] for (name, _), record in verify.records().items()}
    assert found == {
        "Straining strain=0.2": {"strain": 0.2},
        "Straining way=across": {"strain": 0.3, "way": "across"},
    }  # fmt: skip


BAD = [
    ("xfem step_factor=nan", "expected a finite value"),
    ("xfem tip=middle", "xfem.tip = 'middle'; expected one of"),
    ("xfem tip", "expected NAME PARAMETER=VALUE"),
    (f"{GUEST} way=up", "Straining.way = 'up'"),
    ("xfem tipp=partial", "did you mean 'tip'"),
    ("xfem tip=inside tip=partial", "each parameter once"),
    ("xfm tip=partial", "did you mean 'xfem'"),
    (f"{GUEST} strain=1/2,{GUEST} strain=1:2", "the same folder"),
]


@pytest.mark.parametrize(
    ("command", "asked", "said"),
    [*(("run", *bad) for bad in BAD), *(("conform", *bad) for bad in BAD[:3])],
)
def test_a_bad_one_is_said_before_anything_is_solved(verify, command, asked, said):
    before = ["run", "square.toml", "--out", "out", "--solver"]
    done = verify(*(before if command == "run" else [command]), asked)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (verify.folder / "out").exists()


def test_parameters_in_a_name_are_values_and_those_of_the_solver():
    assert named.parameters_in("a b=1 c=1e-3 d=.5 e=true f=text") == {
        "b": 1, "c": 1e-3, "d": 0.5, "e": True, "f": "text",
    }  # fmt: skip
    for asked in (
        "xfem order=2",
        "snapping qualty=0.3",
        "mass_spring fit=fine",
        "conforming degree=3",
    ):
        with pytest.raises(InputError, match=r"no parameter|expected one of"):
            variant_of(asked)
    known = variant_of("mass_spring  cut=removal scheme=implicit_euler fit=van_gelder")
    assert known.solver == known.found().name == "mass_spring"
    assert known.parameters == {"cut": "removal", "scheme": "implicit_euler", "fit": "van_gelder"}


def test_a_guest_that_cannot_be_changed_has_variants(verify):
    rows = ["--solver", f"{FROZEN} strain=0.2", "--solver", FROZEN]
    verify("run", "square.toml", *rows, "--out", "out")
    found = {name for (name, _), record in verify.records().items() if record["status"] == "solved"}
    assert found == {"Frozen strain=0.2", "Frozen"}


def test_a_guest_whose_file_changes_is_checked_for_conformance_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = []
    for text in ("class A: ...", "class A: pass"):
        (tmp_path / "guest_of_a_test.py").write_text(text)
        found.append(run_ranking._source_of_guest("guest_of_a_test:A x=1"))
    assert len({*found, ""}) == 3
    assert run_ranking._source_of_guest("xfem") == ""
