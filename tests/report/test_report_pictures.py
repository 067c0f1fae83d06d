"""Claims about the pictures: right body, one view, and never the end of the report."""

import json

import numpy as np
import pytest
from synthetic_run import cut_square, make_run

from verify.report import load_run
from verify.report.bodies import Body, deformed_body
from verify.report.pictures import case_pictures


def lengths(body: Body) -> float:
    ends = body.points[body.edges]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())


@pytest.mark.parametrize("order", [1, 2])
def test_the_outline_is_the_boundary_with_both_faces_of_the_cut(order):
    body = deformed_body(cut_square(8, order), 0.0)
    assert lengths(body) == pytest.approx(4 + 2 * np.hypot(1, 1 / 3), rel=1e-12)


def test_missing_and_damaged_solutions_become_notes(tmp_path):
    root = make_run(tmp_path / "run")
    folder = root / "cases" / "statics__f3_inclined"
    (folder / "xfem-3" / "solution.vtu").write_text("no mesh")
    (folder / "conforming-3" / "solution.json").unlink()
    for solver in ("xfem", "conforming"):
        (folder / f"error_field_{solver}.vtu").unlink()
    shown = case_pictures(root, load_run(root).entries[0])
    assert not shown.all
    notes = " ".join(shown.notes)
    # the rest of each sentence is that of verify.solution
    assert "No picture of XFEM, level 3: " in notes
    assert "No picture of conforming P1, level 3: " in notes
    assert "stored" in notes


def test_a_solution_outside_the_run_directory_is_not_read(tmp_path):
    root = make_run(tmp_path / "run")
    file = root / "cases" / "statics__f3_inclined" / "result.json"
    result = json.loads(file.read_text())
    for solve in result["solves"]:
        solve["solution"] = "../../secret/solution.json"
    result["pictures"] = {"error_field of xfem": "/etc/passwd"}
    file.write_text(json.dumps(result))
    shown = case_pictures(root, load_run(root).entries[0])
    assert not shown.all
    assert "directory" in shown.notes[0]
