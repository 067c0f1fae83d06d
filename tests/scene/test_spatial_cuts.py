"""Cuts in space: their triangulation, and where they lie in a box."""

import numpy as np
import pytest
from case_texts import body_text, support_text
from hypothesis import given, settings
from hypothesis import strategies as st

from verify.errors import InputError
from verify.geometry.simplices import ear_clipping, overlap_area
from verify.scene import (
    CylinderCut,
    DiscCut,
    PolygonCut,
    SphereCut,
    SweptCut,
    ToolPathCut,
    faces_of,
    load_scene,
)

CUBE = body_text("A cube", "It shall be cut.", [1.0, 1.0, 1.0], [[2, 2, 2]]) + support_text(
    "boundary", [0, 0, 0]
)
DISC = {"kind": "disc", "centre": [0.5, 0.5, 0.5], "normal": [0.0, 0.0, 2.0], "radius": 0.3}
PIPE = {
    "kind": "cylinder", "base": [0.5, 0.5, 0.2], "axis": [0.0, 0.0, 1.0], "radius": 0.3,
    "height": 0.5,
}  # fmt: skip
SWEPT = {
    "kind": "swept", "points": [[0.2, 0.3, 0.2], [0.5, 0.5, 0.2], [0.8, 0.3, 0.2]],
    "along": [0.0, 0.0, 0.5],
}  # fmt: skip
SQUARE = {
    "kind": "polygon",
    "points": [[0.2, 0.2, 0.5], [0.8, 0.2, 0.5], [0.8, 0.8, 0.5], [0.2, 0.8, 0.5]],
}


def table(cut):
    def value(x):
        return f'"{x}"' if isinstance(x, str) else str(x).replace("(", "[").replace(")", "]")

    return "[[cuts]]\n" + "".join(f"{key} = {value(x)}\n" for key, x in cut.items())


def load(folder, *cuts, more=""):
    (folder / "cube.toml").write_text(CUBE + "".join(table(cut) for cut in cuts) + more)
    return load_scene(folder / "cube.toml")


def area_vectors(surface):
    points, triangles = surface
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return 0.5 * np.cross(b - a, c - a)


def test_the_normal_of_every_cut_is_that_of_its_triangles():
    """A plane cut's points along its normal; a cylinder's towards its axis; a sweep's t × along."""
    disc = DiscCut(**DISC)
    assert (area_vectors(disc.facets())[:, 2] > 0.0).all()
    polygon = PolygonCut(**SQUARE)
    assert (area_vectors(polygon.facets())[:, 2] > 0.0).all()
    pipe = CylinderCut(**PIPE).facets()
    middle = pipe[0][pipe[1]].mean(axis=1) - [0.5, 0.5, 0.0]
    assert ((area_vectors(pipe) * middle)[:, :2].sum(axis=1) < 0.0).all()
    swept = SweptCut(**SWEPT).facets()
    wanted = np.cross([0.3, 0.2, 0.0], [0.0, 0.0, 0.5])
    np.testing.assert_allclose(area_vectors(swept)[0], 0.5 * wanted)


def test_areas_of_the_triangulations_are_those_of_the_cuts():
    """A regular n-gon in a circle loses (2π/n)²/6 of its area, the mantle (2π/n)²/24."""
    step = (2 * np.pi / 64) ** 2

    def area(cut):
        return np.linalg.norm(area_vectors(cut.facets()), axis=1).sum()

    assert area(DiscCut(**DISC)) == pytest.approx(np.pi * 0.09 * (1 - step / 6), rel=1e-4)
    ellipse = {**DISC, "radii": (0.3, 0.1), "axis": (0.0, 1.0, 0.0)}
    del ellipse["radius"]
    assert area(DiscCut(**ellipse)) == pytest.approx(np.pi * 0.03 * (1 - step / 6), rel=1e-4)
    assert area(CylinderCut(**PIPE)) == pytest.approx(0.3 * np.pi * (1 - step / 24), rel=1e-4)
    sector = CylinderCut(**PIPE, towards=(1.0, 0.0, 0.0), sweep=90.0)
    assert area(sector) == pytest.approx(0.075 * np.pi * (1 - step / 24), rel=1e-4)
    assert area(SweptCut(**SWEPT)) == pytest.approx(2 * np.hypot(0.3, 0.2) * 0.5)


@given(seed=st.integers(0, 10**6), corners=st.integers(3, 12))
@settings(max_examples=50, deadline=None)
def test_a_star_shaped_polygon_is_triangulated_without_overlap(seed, corners):
    """All triangles turn the same way and their areas add up to the polygon's."""
    rng = np.random.default_rng(seed)
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(0.1, 0.9, corners)) / corners
    plane = rng.uniform(0.2, 1.0, (corners, 1)) * np.column_stack([np.cos(angle), np.sin(angle)])
    u, v = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    points = plane[:, :1] * u + plane[:, 1:] * v
    vectors = area_vectors((points, ear_clipping(points)))
    normal = vectors.sum(axis=0)
    x, y = plane.T
    shoelace = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert np.linalg.norm(normal) == pytest.approx(abs(shoelace), rel=1e-9)
    assert (vectors @ normal >= -1e-12).all()


@pytest.mark.parametrize(
    "cut, kind",
    [
        (DISC, "inner"),
        ({**DISC, "radius": 3.0}, "through"),
        ({**DISC, "centre": [0.0, 0.5, 0.5]}, "edge"),
        (PIPE, "inner"),
        ({**PIPE, "base": [0.5, 0.5, -0.1], "height": 1.2}, "through"),
        ({**PIPE, "base": [0.5, 0.5, -0.1], "height": 0.5}, "edge"),
        (SWEPT, "inner"),
        (SQUARE, "inner"),
    ],
)
def test_how_a_cut_meets_a_box_is_told_by_its_rim(tmp_path, cut, kind):
    load(tmp_path, {**cut, "expected": kind})
    wrong = "edge" if kind != "edge" else "inner"
    with pytest.raises(InputError, match=f"expected '{wrong}' but it is '{kind}'"):
        load(tmp_path, {**cut, "expected": wrong})


def test_two_cuts_that_lie_on_each_other_are_named(tmp_path):
    other = {**SQUARE, "name": "other"}
    with pytest.raises(InputError, match=r"'cut' and 'other' lie on each other over 0\.282"):
        load(tmp_path, DISC, other)  # the disc lies within the square: π 0.3², as a 64-gon
    beside = {**SQUARE, "name": "other", "points": [[x, y, 0.51] for x, y, _ in SQUARE["points"]]}
    load(tmp_path, DISC, beside)
    across = {**SWEPT, "name": "other"}
    load(tmp_path, DISC, across)
    assert overlap_area(DiscCut(**DISC).facets(), SweptCut(**SWEPT).facets()) == 0.0


@pytest.mark.parametrize("opening", [20.0, 90.0, 137.0, 180.0])
def test_a_cap_has_the_area_of_a_sphere_and_its_centre_on_the_positive_side(opening):
    centre, pole = np.array([0.1, 0.2, 0.3]), np.array([1.0, -2.0, 2.0]) / 3
    cap = SphereCut(
        kind="sphere", centre=tuple(centre), radius=0.4, towards=tuple(3 * pole), opening=opening
    )
    points, triangles = cap.facets(0.01)
    away = points - centre
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), 0.4, rtol=1e-12)
    angle = np.rad2deg(np.arccos(np.clip(away @ pole / 0.4, -1.0, 1.0)))
    assert angle.max() == pytest.approx(opening, abs=1e-5)
    vectors = area_vectors((points, triangles))
    assert ((vectors * away[triangles].mean(axis=1)).sum(axis=1) < 0.0).all()
    # facets of 0.01 lie within h²/2R² of the sphere
    area = 2 * np.pi * 0.4**2 * (1 - np.cos(np.deg2rad(opening)))
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(area, rel=1e-3)


def test_the_face_of_a_cut_is_found_beside_a_blade_whose_normal_is_motion_times_blade():
    blade = ToolPathCut(
        kind="tool_path", points=[[0.2, 0.5, 1.0], [0.8, 0.5, 1.0]], speed=1.0, depth=0.5,
        direction=(0.0, 0.0, -1.0),
    )  # fmt: skip
    disc = DiscCut(kind="disc", centre=(0.5, 0.5, 0.2), normal=(0.0, 0.0, 1.0), radius=0.1)
    found = faces_of([disc, blade], np.array([[0.5, 0.45, 0.2], [0.5, 0.51, 0.8]]))
    assert found.cut.tolist() == [0, 1]
    np.testing.assert_allclose(found.normal, [[0, 0, 1], [0, 1, 0]], atol=1e-15)
