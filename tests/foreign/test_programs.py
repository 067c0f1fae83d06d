"""Protocol of a foreign program: parameters, repetitions, refusals, failures, what it reads."""

import ast
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from verify.cli import main
from verify.errors import InputError, UnsupportedSceneError
from verify.exchange import read_answers
from verify.foreign import foreign_solvers
from verify.foreign.records import PROGRAMS
from verify.runner.survey import survey
from verify.scene import load_scene, scene_content
from verify.solvers import find_solver, solver_names

TALKS = """
from exchange_files import RefusedError, run

def solve(case):
    weight = case.parameters["weight"]
    if weight < 0:
        raise RefusedError("no negative weight")
    if weight == 0:
        raise ValueError("the weight is zero")
    case.timed("solve", lambda: None)
    case.answer(case.points, case.cells, weight + 0 * case.points, unknowns=case.repetitions)

run(solve)
"""
CASE = "statics/f1_patch"


@pytest.fixture
def talks(add_example):
    add_example("talks", text=TALKS)
    return find_solver("talks")


def test_a_foreign_solver_is_found_by_its_name_and_solves_exactly(add_example):
    add_example("linear")
    assert "linear" in solver_names()
    scene = load_scene(CASE)
    found = find_solver("linear").solve(scene, 0, repetitions=3)
    assert len(found.timings["solve"]) == 3  # measured by the program, its first call apart
    own = find_solver("conforming").solve(scene, 0, repetitions=0)
    assert np.abs(found.displacement).max() == pytest.approx(
        np.abs(own.displacement).max(), rel=1e-12
    )


def test_parameters_and_repetitions_are_handed_over(talks):
    found = talks.solve(load_scene(CASE), 0, repetitions=4, weight=2.5)
    assert (found.unknowns, len(found.timings["solve"])) == (4, 4)
    assert np.all(found.displacement == 2.5)
    assert np.all(talks.solve(load_scene(CASE), 0).displacement == 1.0)  # the default


def test_a_refusal_and_a_failure_of_the_program_come_through(talks):
    with pytest.raises(UnsupportedSceneError, match="no negative weight"):
        talks.solve(load_scene(CASE), 0, weight=-1.0)
    with pytest.raises(RuntimeError, match="weight"):
        talks.solve(load_scene(CASE), 0, weight=0.0)


@pytest.mark.parametrize(
    "case, token",
    [
        ("statics/f1_3d", "dimension"),
        ("dynamics/freed_half", "analysis"),
        ("material/layers_patch", "material"),
    ],
)
def test_what_the_record_does_not_list_is_refused_without_a_process(add_example, case, token):
    folder = add_example("linear")
    (folder / "program.py").write_text("raise SystemExit('was run')")
    scene = load_scene(case)
    refusal = find_solver("linear").refuses(scene)
    assert refusal is not None
    assert token in refusal


def test_a_solver_that_is_not_installed_says_how_to_install_it(add_example):
    add_example("fake", module="cutfake", kind="packages", python="3.12")
    with pytest.raises(InputError, match="solvers"):
        find_solver("fake")


def test_answers_depend_on_the_program_the_record_and_the_reader(add_example):
    folder, scene = add_example("linear"), scene_content(load_scene(CASE))
    before = survey("linear", [scene])["source"]
    assert survey("linear", [scene])["source"] == before
    with (folder / "program.py").open("a") as program:
        program.write("# changed\n")
    assert survey("linear", [scene])["source"] != before


def test_the_template_answers_a_case_where_verify_cannot_be_imported(tmp_path, capsys):
    out = tmp_path / "case"
    assert main(["export", CASE, "--out", str(out), "--template", "python"]) == 0
    (out / "verify.py").write_text("raise ImportError('verify is not here')")
    clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    scene = load_scene(CASE)
    for level in range(scene.mesh.count):
        words = [sys.executable, "-s", "example.py", ".", str(level)]
        subprocess.run(words, cwd=out, env=clean, check=True, timeout=120)
    answers = read_answers(scene, out)
    assert not answers.missing
    run = tmp_path / "run"
    assert main(["import", CASE, str(out), "--solver", "mine", "--out", str(run)]) == 0
    assert re.search(r"\b\d+ PASS", capsys.readouterr().out)


def test_the_example_refuses_to_answer_a_loose_part(add_example):
    add_example("linear")
    scene = load_scene(CASE)
    content = scene.model_dump(mode="json", by_alias=True)
    content["supports"] = [{"where": "bottom", "displacement": [0.0, 0.0]}]
    content["exact"], content["acceptance"], content["known_findings"] = None, [], []
    loose = type(scene).model_validate(content)
    with pytest.raises(RuntimeError, match="nothing holds"):
        find_solver("linear").solve(loose, 0)


def test_programs_import_nothing_of_verify_and_none_of_its_dependencies_unsaid():
    for file in PROGRAMS.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [one.name for one in node.names] if isinstance(node, ast.Import) else []
            assert not any(name.split(".")[0] in ("verify", "reference") for name in names), file


def test_every_record_is_whole_and_no_lock_names_an_address():
    for name, solver in foreign_solvers().items():
        assert (solver.folder / "program.py").is_file(), name
        if solver.install.kind == "packages":
            lock = solver.lock.read_text()
            assert "--hash=sha256:" in lock
            assert not re.search(r"://|^(-i|-f|--(index|extra|find|trusted))", lock, re.MULTILINE)
        else:
            assert solver.install.how


@pytest.mark.parametrize("values", [np.arange(7.0), np.arange(30_000.0)])
@pytest.mark.parametrize("compressed", [True, False])
def test_the_reader_reads_what_meshio_writes(values, compressed, tmp_path):
    import meshio

    sys.path.insert(0, str(PROGRAMS))
    try:
        from exchange_files import read_vtu, write_vtu
    finally:
        sys.path.remove(str(PROGRAMS))
    count = len(values)
    points = np.column_stack([values, np.sin(values), 0 * values])
    cells = np.column_stack([np.arange(count - 2), np.arange(1, count - 1), np.arange(2, count)])
    data = {"material": [np.arange(count - 2, dtype=np.int32)]}
    mesh = meshio.Mesh(points, [("triangle", cells)], cell_data=data)
    mesh.write(tmp_path / "a.vtu", compression="zlib" if compressed else None)
    read, found, fields = read_vtu(tmp_path / "a.vtu")
    np.testing.assert_array_equal(read, points)
    np.testing.assert_array_equal(found, cells)
    np.testing.assert_array_equal(fields["material"], data["material"][0])
    write_vtu(tmp_path / "b.vtu", points[:, :2], cells, {"displacement": points[:, :2]})
    back = meshio.read(tmp_path / "b.vtu")
    np.testing.assert_array_equal(back.cells_dict["triangle"], cells)
    np.testing.assert_array_equal(back.points[:, :2], points[:, :2])
    np.testing.assert_array_equal(back.point_data["displacement"][:, :2], points[:, :2])
