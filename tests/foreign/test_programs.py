"""Protocol of a foreign program: parameters, repetitions, refusals, failures, what it reads."""

import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from verify.cli import main
from verify.errors import InputError, UnsupportedSceneError
from verify.exchange import read_answers
from verify.foreign.installing import PROGRAMS, Takes
from verify.scene import BodyForce, load_scene
from verify.solvers import find_solver, solver_names
from verify.solvers.interface import refusal_of

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


def test_a_refusal_and_a_failure_of_the_program_come_through(talks):
    with pytest.raises(UnsupportedSceneError, match="no negative weight"):
        talks.solve(load_scene(CASE), 0, weight=-1.0)
    with pytest.raises(RuntimeError, match=r"ValueError: the weight is zero \(.*program.py:9 in"):
        talks.solve(load_scene(CASE), 0, weight=0.0)


def test_contact_is_what_a_program_refuses_that_takes_the_same_crack_without(add_example):
    """Kratos, Akantu and all others: their records cannot declare contact."""
    add_example("linear")
    scene = load_scene("contact/closed_crack")
    why = refusal_of(find_solver("linear"), scene)
    assert why == "contact of the faces of a cut ('static') is not offered by linear"
    apart = scene.model_copy(update={"contact": type(scene.contact)()})
    assert refusal_of(find_solver("linear"), apart) is None


def test_forces_in_formulas_are_refused_before_the_body_is_exported():
    """By programs whose records say so: the export of a fine body in space takes ten seconds."""
    takes = Takes([2, 3], ["static"], ["linear"], formulas=False)
    scene = load_scene(CASE)
    assert takes.refusal(scene) is None
    for force in (["0.0", "x*y"], "exact"):
        load = BodyForce(kind="body_force", force=force)
        pulled = scene.model_copy(update={"loads": [*scene.loads, load]})
        assert takes.refusal(pulled) == "body forces in formulas are not offered"
        assert replace(takes, formulas=True).refusal(pulled) is None
    even = BodyForce(kind="body_force", force=[0.0, -9.8])
    assert takes.refusal(scene.model_copy(update={"loads": [even]})) is None


@pytest.mark.parametrize(
    "old, new, said",
    [
        ("weight = 1.0", "weight 1.0", "line 12"),
        ('kind = "system"', 'kind = "snap"', "install.kind"),
        ("dimensions", "dimension", "takes.dimension"),
        ("[parameters]", "[paramters]", "paramters"),
    ],
)
def test_a_bad_record_is_said_with_its_file_and_key(add_example, old, new, said):
    record = add_example("linear") / "solver.toml"
    record.write_text(record.read_text().replace(old, new))
    with pytest.raises(InputError, match=said) as error:
        find_solver("linear")
    assert str(record) in str(error.value)


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


@pytest.mark.parametrize("count, compressed", [(7, False), (30_000, True)])
def test_the_reader_reads_what_meshio_writes(count, compressed, tmp_path):
    import meshio

    sys.path.insert(0, str(PROGRAMS))
    try:
        from exchange_files import read_vtu, write_vtu
    finally:
        sys.path.remove(str(PROGRAMS))
    values = np.arange(float(count))
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
