import numpy as np
import pytest
from solid_meshes import cube_grid, height, inclined, sliver_body, solid_scene

from verify.compare.body import body_of
from verify.compare.body_rule import body_rule
from verify.compare.cut_profile import cut_place
from verify.compare.cut_rule import surface_rule
from verify.scene import load_scene

DISC = {"kind": "disc", "centre": [0.5, 0.5, 0.5], "normal": [0.0, 1.0, 1.0], "radius": 0.3}
TUBE = {
    "kind": "cylinder", "base": [0.5, 0.5, -0.1], "axis": [0.0, 0.0, 1.0], "radius": 0.3,
    "height": 1.2,
}  # fmt: skip
HALF = {
    "kind": "polygon",
    "points": [[-0.1, -0.1, 0.5], [0.6, -0.1, 0.5], [0.6, 1.1, 0.5], [-0.1, 1.1, 0.5]],
}
BENT = {
    "kind": "swept", "points": [[-0.1, 0.2, -0.1], [0.4, 0.5, -0.1], [0.7, 0.4, -0.1]],
    "along": [0.0, 0.0, 1.2],
}  # fmt: skip
CUTS = {
    "none": [],
    "inclined": [inclined()],
    "partial": [HALF],
    "disc": [DISC],
    "tube": [TUBE],
    "bent": [BENT],
    "crossing": [inclined(), {**DISC, "name": "b"}],
    "along grid lines": [HALF, {**inclined(), "name": "b"}],
}


@pytest.mark.parametrize("cuts", CUTS.values(), ids=CUTS.keys())
def test_weights_sum_to_the_volume_and_points_lie_inside(cuts):
    rule = body_rule(body_of(solid_scene(cuts)), 0.15)
    # 1e5 weights, each to a few bits
    assert abs(rule.weights.sum() - 1) < 1e-13
    assert rule.weights.min() > 0
    assert rule.points.min() > 0
    assert rule.points.max() < 1


def test_each_side_of_a_plane_cut_has_its_exact_volume_down_to_1e_9():
    rule = body_rule(sliver_body(1e-9), 0.15)
    assert abs(rule.weights.sum() - 1) < 1e-13
    above = rule.points[:, 2] - height(rule.points)
    # both halves of the cube are the same but for the sliver
    assert rule.weights[above < 0].sum() == pytest.approx(0.5, abs=1e-14)
    sliver = rule.weights[(above > 0) & (above < 1e-9)].sum()
    # heights near .5 are known to 1e-16, a sliver of 1e-9 therefore to 1e-7
    assert sliver == pytest.approx(1e-9, rel=1e-6)


AREAS = {
    "inclined": ([inclined()], np.sqrt(1 + 1 / 9 + 1 / 25), 1e-13),
    "partial": ([HALF], 0.6, 1e-13),
    "disc": ([DISC], np.pi * 0.09, 1e-13),
    # 8 points per strip across: cells on the border are a 16th of the spacing
    "tube": ([TUBE], 2 * np.pi * 0.3, 1e-3),
    "bent": ([BENT], np.hypot(0.4, 0.24) + np.hypot(0.3, 0.1), 1e-13),
}


@pytest.mark.parametrize("name", AREAS)
def test_cuts_are_trimmed_to_the_body_and_keep_their_area(name):
    cuts, area, tolerance = AREAS[name]
    rule = surface_rule(body_of(solid_scene(cuts)), 0.05)
    assert rule.weights.sum() == pytest.approx(area, rel=tolerance)
    assert np.linalg.norm(rule.normals, axis=1) == pytest.approx(1, abs=1e-14)
    towards = np.sum((rule.positive - rule.points) * rule.normals, axis=1)
    assert towards.min() > 0


def test_normals_point_to_the_positive_side_as_the_scene_says():
    inside = surface_rule(body_of(solid_scene([TUBE])), 0.1)
    axis = np.array([0.5, 0.5, 0]) - inside.points * [1, 1, 0]
    assert (np.sum(axis * inside.normals, axis=1) > 0).all()
    up = surface_rule(body_of(solid_scene([inclined()])), 0.1)
    assert (up.normals[:, 2] > 0).all()
    # swept: points × along, here along the first segment
    bent = surface_rule(body_of(solid_scene([BENT])), 0.1)
    first = bent.points[:, 0] < 0.4
    normal = np.cross([0.5, 0.3, 0], [0, 0, 1.0])
    assert np.allclose(bent.normals[first], normal / np.linalg.norm(normal))


def test_normals_at_places_of_curved_cuts_are_exact():
    """So that what slides along them does not open."""
    places = np.random.default_rng(3).uniform(0.2, 0.8, (20, 3))
    centre, along = np.array([0.46, 0.52, 0.55]), np.array([0.6, -0.48, 0.64])
    sphere = {"kind": "sphere", "centre": centre.tolist(), "radius": 0.23}
    tube = {"kind": "cylinder", "base": (centre - along).tolist(), "axis": along.tolist(),
            "radius": 0.23, "height": 2.0}  # fmt: skip
    for cut, across in ((sphere, np.eye(3)), (tube, np.eye(3) - np.outer(along, along))):
        body = body_of(solid_scene([{**cut, "name": "cut"}]))
        for place in places:
            inward = across @ (centre - place)
            normal = cut_place(body, "cut", place).normals[0]
            np.testing.assert_allclose(normal, inward / np.linalg.norm(inward), atol=1e-14)


def test_an_inverse_square_root_at_a_front_is_integrated():
    # 1/√r about a front along y through the cube: ∫ 1/√r over a rectangle, by polar pieces
    body = body_of(solid_scene([HALF]))
    rule = body_rule(body, 0.15, order=3, depth=2e-2)
    r = np.linalg.norm(rule.points[:, [0, 2]] - [0.6, 0.5], axis=1)
    angle, weight = np.polynomial.legendre.leggauss(60)
    exact = 0.0
    for a, b in ((0.6, 0.5), (0.4, 0.5)):  # right triangles with legs a, b, twice each
        for near, far in ((a, b), (b, a)):
            top = np.arctan2(far, near)
            theta = 0.5 * top * (angle + 1)
            exact += 2 * 0.5 * top * weight @ ((near / np.cos(theta)) ** 1.5 / 1.5)
    assert rule.weights @ r**-0.5 == pytest.approx(exact, rel=1e-4)


def body_from_a_file(folder, polygon):
    """The cube as tetrahedra of a file, with a cut."""
    import meshio

    points, cells = cube_grid(3, 3, 3)
    meshio.Mesh(points, [("tetra", cells)]).write(folder / "cube.vtu")
    case = folder / "case.toml"
    case.write_text(
        'title = "t"\nrequirement = "it shall hold"\n'
        '[geometry]\nkind = "file"\nfile = "cube.vtu"\ndimension = 3\n'
        '[mesh]\npattern = "given"\n[material]\nyoung = 1.0\npoisson = 0.3\n'
        '[[supports]]\nwhere = "z < 1e-9"\ndisplacement = [0.0, 0.0, 0.0]\n'
        f'[[cuts]]\nkind = "polygon"\npoints = {polygon}\n'
    )
    return body_of(load_scene(case))


def test_a_body_given_by_tetrahedra_has_its_volume_and_its_cut_its_area(tmp_path):
    body = body_from_a_file(tmp_path, inclined()["points"])
    rule = body_rule(body, 0.2)
    assert rule.weights.sum() == pytest.approx(1, abs=1e-13)
    above = rule.points[:, 2] > height(rule.points)
    assert rule.weights[above].sum() == pytest.approx(0.5, abs=1e-13)
    area = surface_rule(body, 0.1).weights.sum()
    assert area == pytest.approx(np.sqrt(1 + 1 / 9 + 1 / 25), rel=1e-12)
    assert not len(body.front)
    # along facets of the mesh, and ending inside the body
    along = body_from_a_file(tmp_path, [[-0.1, -0.1, 1 / 3], [0.6, -0.1, 1 / 3], [0.7, 1.1, 1 / 3]])
    area = 0.65 - 0.5 * 0.95 * 19 / 30  # left of its right side, not left of its left one
    assert surface_rule(along, 0.1).weights.sum() == pytest.approx(area, rel=1e-12)
