"""Claims about the pictures: right body, one view, and never the end of the report."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import colormaps
from PIL import Image
from synthetic_run import cut_square, make_run, write_error_field

from verify.report import load_run
from verify.report.bodies import Body, deformed_body, error_body
from verify.report.drawn_bodies import draw
from verify.report.pictures import case_pictures
from verify.report.view import common_view
from verify.solution import Solution


def tetrahedra() -> Solution:
    """Return two tetrahedra that share a face, one moved up."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], dtype=float)
    displacement = np.zeros((1, 5, 3))
    displacement[0, 4, 2] = 0.2
    return Solution(
        points=points, cells=np.array([[0, 1, 2, 3], [1, 2, 3, 4]]), displacement=displacement
    )


def lengths(body: Body) -> float:
    ends = body.points[body.edges]
    return float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())


@pytest.mark.parametrize("order", [1, 2])
def test_the_outline_is_the_boundary_with_both_faces_of_the_cut(order):
    body = deformed_body(cut_square(8, order), 0.0)
    assert lengths(body) == pytest.approx(4 + 2 * np.hypot(1, 1 / 3), rel=1e-12)


def test_all_bodies_of_a_case_fit_into_one_view():
    bodies = [deformed_body(cut_square(8), scale) for scale in (0.0, 5.0, 40.0)]
    view = common_view(bodies, "cividis")
    x0, x1, y0, y1 = view.window
    for body in bodies:
        assert (body.points[:, 0].min() > x0) & (body.points[:, 0].max() < x1)
        assert (body.points[:, 1].min() > y0) & (body.points[:, 1].max() < y1)
    assert (x1 - x0) / (y1 - y0) == pytest.approx(view.size[0] / view.size[1], rel=0.01)
    assert view.limits[1] == max(body.values.max() for body in bodies)


def ink(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)).convert("L"), dtype=float) < 250


def test_a_plane_body_is_drawn_with_its_cut_open():
    body = deformed_body(cut_square(12, opening=0.05), 2.0)
    view = common_view([body], "cividis")
    shown = ink(draw(body, view))
    assert shown.shape == view.size[::-1]
    assert 0.5 < shown.mean() < 0.95
    # white right through the middle of the body
    middle = shown[:, shown.shape[1] // 2]
    assert np.count_nonzero(np.diff(middle.astype(int)) == 1) == 2


@pytest.mark.parametrize("near", [0.0, 1.0])
def test_what_is_near_hides_what_is_far(near):
    """Two plates one behind the other, of other values, drawn in either order."""
    still = common_view([deformed_body(tetrahedra(), 1.0)], "cividis")
    right, up, towards = (np.array(axis) for axis in (still.right, still.up, still.towards))
    plate = np.array([-right - up, right - up, right + up, up - right])
    points = np.concatenate([plate, plate + (2 * near - 1) * towards])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    none = np.zeros((0, 2), dtype=int)
    body = Body(points, triangles, none, np.repeat([0.0, 1.0], 4), none, points)
    view = replace(common_view([body], "cividis"), limits=(0.0, 1.0))
    image = np.asarray(Image.open(io.BytesIO(draw(body, view))).convert("RGB"), dtype=float)
    middle = image[image.shape[0] // 2, image.shape[1] // 2]
    assert middle == pytest.approx(
        255 * np.array(colormaps["cividis"](near)[:3]), abs=12
    )  # of 255: WebP


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


def test_an_error_field_that_is_zero_or_not_finite_is_handled(tmp_path):
    solution = cut_square(4)
    n = len(solution.points)
    write_error_field(solution, tmp_path / "zero.vtu", np.zeros(n))
    view = common_view([error_body(tmp_path / "zero.vtu")], "YlOrBr")
    assert view.limits == (0.0, 1.0)
    write_error_field(solution, tmp_path / "nan.vtu", np.full(n, np.nan))
    with pytest.raises(ValueError, match="not finite"):
        error_body(tmp_path / "nan.vtu")
