"""Runs of several rows: families, selections, variants of a solver."""

import json
from dataclasses import replace

import pytest

from verify.cli import ranking
from verify.errors import InputError
from verify.report.page import family_views
from verify.report.plots import Palette
from verify.report.run_directory import load_run
from verify.result import (
    CaseResult,
    Metric,
    ReferenceRecord,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
)
from verify.runner import selection
from verify.runner.selection import select_cases
from verify.runner.work import Families
from verify.scene import load_scene, load_scenes, loading
from verify.solvers import interface
from verify.study.measured_scenes import variant_of

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
    assert shown["parameter"] == "epsilon"
    assert "relative L² error of the displacement" in [part["title"] for part in shown["parts"]]
    assert list(shown["parts"][0]["found"]) == [0.5, 0.0]
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


CASES = {
    "statics/patch": ("F1 patch", ["demo", "quick"]),
    "statics/tissue": ("A hanging strip", ["demo"]),
    "statics/long": ("Fine Griffith crack", ["heavy"]),
    "dynamics/fall": ("Free fall", []),
}


@pytest.fixture(autouse=True)
def _project(tmp_path, monkeypatch, case_text):
    for name, (title, tags) in CASES.items():
        path = tmp_path / f"{name}.toml"
        path.parent.mkdir(exist_ok=True)
        text = case_text.replace("A stretched square", title).replace('["stretched"]', str(tags))
        path.write_text(text.replace("'", '"'))
    monkeypatch.setattr(loading, "case_folder", lambda: tmp_path)
    monkeypatch.setattr(selection, "list_cases", lambda: loading.list_cases(tmp_path))


def names(*arguments, **options):
    return {scene.name.partition("/")[2] for scene in select_cases(*arguments, **options)}


def test_by_default_all_but_the_heavy_ones_run():
    assert names() == {"patch", "tissue", "fall"}
    assert names(weight="quick") == {"patch"}
    assert names(weight="heavy") == {"patch", "tissue", "fall", "long"}


def test_a_case_that_is_named_runs_whatever_its_weight():
    assert names(["statics/long"]) == {"long"}
    assert names(["statics/tissue"], weight="quick") == {"tissue"}
    assert names(["statics/*"]) == {"patch", "tissue"}


@pytest.mark.parametrize(
    "expression, expected",
    [
        ("demo", {"patch", "tissue"}),
        ("DEMO and not tissue", {"patch"}),
        ("demo or fall", {"patch", "tissue", "fall"}),
        ("not demo", {"fall"}),
        ("not (demo or fall)", set()),
        ("not not demo and strip", {"tissue"}),
        ("strip or patch and fall", {"tissue"}),  # and binds tighter
        ("(strip or patch) and demo", {"patch", "tissue"}),
        ("hanging", {"tissue"}),
        ("dynamics/", {"fall"}),
        ("nothing", set()),
    ],
)
def test_an_expression_looks_into_name_title_and_tags(expression, expected):
    assert names([], expression) == expected


def test_two_cases_of_one_name_are_refused(tmp_path, monkeypatch):
    (tmp_path / "mine").mkdir()
    (tmp_path / "yours").mkdir()
    own = [tmp_path / folder / "own.toml" for folder in ("mine", "yours")]
    for file in own:
        file.write_text((tmp_path / "dynamics/fall.toml").read_text())
    # below the case folder paths tell them apart
    assert {load_scene(file).name for file in own} == {"mine/own", "yours/own"}
    monkeypatch.setattr(loading, "case_folder", lambda: tmp_path / "statics")
    with pytest.raises(InputError, match="another case is called"):
        select_cases([str(file) for file in own])


GUEST = "fake_solvers:Straining"
TOO_FAR = f"{GUEST} strain=0.2"
BOUND = '\n[[acceptance]]\ncheck = "error"\nmetric = "displacement_l2"\nat_most = 1e-10\n'


def test_each_has_rows_verdicts_and_files_of_its_own_and_is_resumed(verify):
    solves, case = verify.folder / "solves", verify.folder / "square.toml"
    case.write_text(case.read_text() + BOUND)
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
    [*(("run", *bad) for bad in BAD), ("conform", *BAD[1])],
)
def test_a_bad_one_is_said_before_anything_is_solved(verify, command, asked, said):
    before = ["run", "square.toml", "--out", "out", "--solver"]
    done = verify(*(before if command == "run" else [command]), asked)
    assert done.returncode == 2
    assert said in done.stderr
    assert not (verify.folder / "out").exists()


def test_parameters_in_a_name_are_values_and_those_of_the_solver():
    assert interface.parameters_in("a b=1 c=1e-3 d=.5 e=true f=text") == {
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


def test_a_guest_whose_file_changes_is_checked_for_conformance_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = []
    for text in ("class A: ...", "class A: pass"):
        (tmp_path / "guest_of_a_test.py").write_text(text)
        found.append(ranking._source_of_guest("guest_of_a_test:A x=1"))
    assert len({*found, ""}) == 3
    assert ranking._source_of_guest("xfem") == ""
