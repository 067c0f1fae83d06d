"""Cases go out as files, answers come back, and are judged as those of the own solvers are."""

import json
import stat
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
from case_texts import body_text, support_text, weight_text

from reference.exact import exact_solution
from verify.cli import main
from verify.errors import InputError
from verify.exchange import ProgramSolver, export_case, problem_of, read_answers
from verify.exchange.comparison import _judged_scenes
from verify.result import Status, Verdict, read_result
from verify.scene import load_scene
from verify.solution import write_solution
from verify.solvers.xfem import XfemSolver

CASE = "statics/f1_patch"


def answer(folder, level, factor=1.0):
    """Answer the patch test exactly, by the field itself at the nodes of the conforming mesh."""
    scene = load_scene(CASE)
    problem = problem_of(scene, level, conforming=True)
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    near = np.zeros_like(problem.points)
    near[problem.cells] = problem.points[problem.cells].mean(axis=1)[:, None]
    u = factor * exact.displacement(problem.points, near)
    place = folder / f"level-{level}"
    place.mkdir(parents=True, exist_ok=True)
    points, values = (np.pad(a, ((0, 0), (0, 1))) for a in (problem.points, u))
    mesh = meshio.Mesh(points, [("triangle", problem.cells)], {"displacement": values})
    mesh.write(place / "solution.vtu")
    record = {"schema": 1, "files": ["solution.vtu"], "dimension": 2, "order": 1}
    (place / "solution.json").write_text(json.dumps(record | {"size": problem.size}))


def test_an_exported_case_holds_mesh_cuts_supports_and_material(tmp_path):
    scene = load_scene(CASE)
    files = export_case(scene, tmp_path / "f1", conforming=True)
    assert all(file.is_file() for file in files)
    case = json.loads((tmp_path / "f1/case.json").read_text())
    assert case["cuts"][0]["points"] == [[-0.1, 0.3], [1.1, 0.7]]
    assert case["material"]["shear"] == pytest.approx(1 / 2.6)
    assert [level["nodes"] for level in case["levels"]] == [81, 289]
    assert case["scene"]["requirement"] == scene.requirement
    mesh = meshio.read(tmp_path / "f1/level-0/mesh.vtu")
    assert len(mesh.cells_dict["triangle"]) == 128
    opened = json.loads((tmp_path / "f1/level-0/conforming.json").read_text())
    points = meshio.read(tmp_path / "f1/level-0" / opened["mesh"]).points
    expected = problem_of(scene, 0, conforming=True)
    np.testing.assert_array_equal(points[:, :2], expected.points)
    np.testing.assert_array_equal(opened["held"][0]["values"], expected.held[0].values)
    cut = meshio.read(tmp_path / "f1/cuts.vtu")
    np.testing.assert_array_equal(cut.points[:, :2], [[-0.1, 0.3], [1.1, 0.7]])


SPACE = (
    body_text(
        "A cube that falls apart", "It shall fall.", [1.0] * 3, [[2, 2, 2]], "1e4", density="1000.0"
    )
    + '[analysis]\nkind = "dynamic"\nduration = 0.4\ntime_step = 0.1\noutputs = 3\n'
    + '[initial]\nkind = "equilibrium"\n'
    + support_text("top", [0, 0, 0.1])
    + "history = [[0.0, 0.0], [0.4, 1.0]]\n"
    + weight_text(3)
    + '[[cuts]]\nkind = "disc"\ncentre = [0.5, 0.5, 0.45]\nnormal = [0.0, 0.0, 1.0]\nradius = 3.0\n'
    + "opens_at = 0.2\n"
    + '[[quantities]]\nkind = "displacement"\nname = "fall"\n'
    + 'point = [0.5, 0.5, 0.1]\ncomponent = "z"\n'
)


def test_a_motion_in_space_goes_out_and_its_time_series_comes_back(tmp_path):
    """Another program's answer: here the compact solver's, through the files alone."""
    (tmp_path / "fall.toml").write_text(SPACE)
    scene = load_scene(tmp_path / "fall.toml")
    export_case(scene, tmp_path / "out")
    case = json.loads((tmp_path / "out/case.json").read_text())
    assert case["output_times"] == [0.0, 0.2, 0.4]
    assert case["initial"] == {"kind": "equilibrium", "cuts": "closed"}
    (cut,) = case["cuts"]
    assert (cut["opens_at"], cut["kind"]) == (0.2, "disc")
    assert np.shape(cut["triangles"])[1] == np.shape(cut["points"])[1] == 3
    drawn = meshio.read(tmp_path / "out/cuts.vtu")
    assert len(drawn.cells_dict["triangle"]) == len(cut["triangles"])
    problem = json.loads((tmp_path / "out/level-0/problem.json").read_text())
    assert problem["held"][0]["history"] == [[0.0, 0.0], [0.4, 1.0]]
    assert meshio.read(tmp_path / "out/level-0/mesh.vtu").cells_dict["tetra"].shape == (48, 4)

    solved = XfemSolver().solve(scene, 0, 0)
    write_solution(solved, tmp_path / "out/level-0/solution")
    answers = read_answers(scene, tmp_path / "out")
    assert not answers.missing
    back = answers.solutions[0]
    np.testing.assert_array_equal(back.times, [0.0, 0.2, 0.4])
    for name in ("displacement", "velocity", "points", "cut_facets"):
        np.testing.assert_array_equal(getattr(back, name), getattr(solved, name))
    for name, column in solved.ledger.items():
        np.testing.assert_array_equal(back.ledger[name], column)


def test_right_answers_pass_and_wrong_ones_fail_the_checks_that_the_case_makes(tmp_path, capsys):
    for factor, name in ((1.0, "right"), (1.01, "wrong")):
        for level in (0, 1):
            answer(tmp_path / name, level, factor)
    out = ["--out", str(tmp_path / "run")]
    right = main(["import", CASE, str(tmp_path / "right"), "--solver", "right", *out, "--json"])
    captured = capsys.readouterr()
    said = json.loads(captured.out)
    assert (right, {v["verdict"] for v in said["cases"][0]["verdicts"]}) == (0, {"PASS"})
    assert {v["solver"] for v in said["cases"][0]["verdicts"]} == {"right"}
    # judged once, with the answers
    assert "not judged" not in captured.err
    assert captured.err.count(f"{CASE}: ") == 1
    # the second program joins the first in the report
    wrong = main(["import", CASE, str(tmp_path / "wrong"), "--solver", "wrong", *out])
    assert wrong == 1
    result = read_result(next((tmp_path / "run").glob("cases/*/result.json")))
    by_solver = {(v.solver, v.metric): v for v in result.verdicts}
    assert by_solver["right", "displacement_l2"].verdict is Verdict.PASS
    assert by_solver["wrong", "displacement_l2"].verdict is Verdict.FAIL
    # a field that is 1 % too large errs by 1 % and has 2.01 % too much energy
    assert by_solver["wrong", "displacement_l2"].observed == pytest.approx(0.01, rel=1e-9)
    energy = by_solver["wrong", "strain_energy"].observed
    assert energy == pytest.approx(1.01**2 * 3.434065934e-3, rel=1e-9)
    assert (tmp_path / "run/report.html").is_file()


def test_one_import_judges_several_cases_and_a_case_without_a_folder_is_refused(tmp_path, capsys):
    # f1_patch and f1_3d; the second has no folder
    for level in (0, 1):
        answer(tmp_path / "mine" / CASE, level)
    command = ["import", "statics/f1_*", str(tmp_path / "mine"), "--solver", "mine"]
    code = main([*command, "--out", str(tmp_path / "run"), "--json"])
    said = json.loads(capsys.readouterr().out)
    cases = {case["case"]: case for case in said["cases"]}
    assert {v["verdict"] for v in cases[CASE]["verdicts"]} == {"PASS"}
    (other,) = cases.keys() - {CASE}
    assert {solve["status"] for solve in cases[other]["solves"]} == {"refused"}
    assert {solve["reason"] for solve in cases[other]["solves"]} == {
        f"no answers: no folder '{other}'"
    }
    assert code == 0
    (tmp_path / "none").mkdir()
    command[2] = str(tmp_path / "none")
    assert main([*command, "--out", str(tmp_path / "other")]) == 2
    assert "holds no answer; expected statics/f1_" in capsys.readouterr().err


def test_an_answer_that_is_missing_refused_or_damaged_is_a_record_of_its_own(tmp_path):
    scene = load_scene("statics/f3_inclined")
    for level in range(3):
        (tmp_path / f"level-{level}").mkdir()
    (tmp_path / "level-0/solution.json").write_text('{"schema": 1, "refused": "too coarse"}')
    (tmp_path / "level-1/solution.json").write_text("{")
    answers = read_answers(scene, tmp_path)
    assert answers.missing[0] == (Status.REFUSED, "too coarse")
    assert answers.missing[1][0] is Status.FAILED
    assert "not a JSON file" in answers.missing[1][1]
    assert "no answer for level 2" in answers.missing[2][1]
    assert not answers.solutions


def test_checks_that_name_a_solver_are_made_of_each_program_instead():
    scene = load_scene("curved/arc_from_a_corner")
    mouth, middle, factor = scene.acceptance
    named = middle.model_copy(update={"solver": "xfem"})
    scene = scene.model_copy(update={"acceptance": [mouth, named, factor]})
    (judged,) = _judged_scenes([scene], "xfem", ["mine", "theirs"])
    made = [(check.metric, check.solver) for check in judged.acceptance]
    assert made == [("mouth", None), ("middle", "mine"), ("middle", "theirs"), ("K_I", None)]
    assert (judged.name, judged.file, judged.row) == (scene.name, scene.file, scene.row)
    known = [[one.metric for one in own.known_findings] for own in (scene, judged)]
    assert known == [["middle", "K_I"] * 2, ["K_I"] * 2]
    with pytest.raises(InputError, match="no check of 'conforming'; it does of xfem"):
        _judged_scenes([scene], "conforming", ["mine"])


def test_answers_to_another_case_are_refused(tmp_path):
    with pytest.raises(InputError, match="no such directory"):
        read_answers(load_scene(CASE), tmp_path / "nothing")
    export_case(load_scene("statics/f3_inclined"), tmp_path / "f3", [0])
    with pytest.raises(InputError, match="exported from 'statics/f3_inclined', which is another"):
        read_answers(load_scene(CASE), tmp_path / "f3")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no answer"):
        read_answers(load_scene(CASE), tmp_path / "empty")


def program(tmp_path, body, wants_conforming=False):
    script = tmp_path / "program"
    script.write_text(f"#!{sys.executable}\nimport json, pathlib, sys\n{body}")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)

    class Program(ProgramSolver):
        name = "program"
        command = (str(script), "{folder}", "{level}")
        conforming = wants_conforming

    return Program()


COPY = """
import meshio, numpy
folder = pathlib.Path(sys.argv[1], "level-" + sys.argv[2])
mesh = meshio.read(folder / "mesh.vtu")
mesh.point_data["displacement"] = 0.0 * mesh.points
mesh.write(folder / "solution.vtu")
answer = {"schema": 1, "files": ["solution.vtu"], "dimension": 2, "order": 1}
(folder / "solution.json").write_text(json.dumps(answer))
"""


def test_a_program_is_a_solver_with_its_wall_time(tmp_path):
    solution = program(tmp_path, COPY).solve(load_scene(CASE), 1, repetitions=2)
    assert len(solution.points) == 289
    assert len(solution.timings["program"]) == 2
    assert "start-up included" in solution.notes["timed"]


def test_several_materials_go_out_and_a_program_solves_their_patch_test(tmp_path):
    pytest.importorskip("skfem")
    scene = load_scene("material/layers_patch")
    export_case(scene, tmp_path / "out", [0], conforming=True)
    case = json.loads((tmp_path / "out/case.json").read_text())
    # none of them may be taken for that of the whole body
    assert list(case["material"]) == ["each"]
    assert [one["young"] for one in case["material"]["each"]] == [1.0, 5.0]
    assert [one["poisson"] for one in case["material"]["each"]] == [0.24, 0.2]
    for name in ("mesh", "conforming"):
        mesh = meshio.read(tmp_path / f"out/level-0/{name}.vtu")
        middle = mesh.points[mesh.cells_dict["triangle"]].mean(axis=1)
        stiff = middle[:, 1] > middle[:, 0]
        np.testing.assert_array_equal(mesh.cell_data["material"][0], stiff)
    program = Path(__file__).parents[2] / "docs/examples/skfem_program.py"
    subprocess.run([sys.executable, program, tmp_path / "out", "0"], check=True)
    answers = read_answers(scene, tmp_path / "out")
    found = answers.solutions[0]
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    near = np.zeros_like(found.points)
    near[found.cells] = found.points[found.cells].mean(axis=1)[:, None]
    expected = exact.displacement(found.points, near)
    np.testing.assert_allclose(found.displacement[0], expected, atol=1e-12)
