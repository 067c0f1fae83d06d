import numpy as np
import pytest
from solid_meshes import cube_grid, height, inclined, sliver_body, solid_scene

from verify.compare.body import body_of
from verify.compare.body_rule import body_rule
from verify.compare.simplex_rule import points_in, simplex_rule
from verify.compare.splitting import bisect, measures, split_at_level
from verify.compare.surface_rule import nearest_on_cut, surface_rule
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


def test_a_tube_has_its_volume_to_second_order():
    body = body_of(solid_scene([TUBE]))
    exact = np.pi * 0.09
    off = []
    for spacing in (0.2, 0.1, 0.05):
        rule = body_rule(body, spacing)
        inside = np.linalg.norm(rule.points[:, :2] - 0.5, axis=1) < 0.3
        off.append(abs(rule.weights[inside].sum() - exact) / exact)
    # the sagitta is a thirtieth of the spacing; the mantle over the volume 2/R
    assert off[2] < 2 / 0.3 * 0.05 / 30
    assert off[2] < off[0]


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_rules_on_simplices_have_their_degree(order):
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]])
    points, weights = points_in(corners, order)
    degree = 2 * order - 1 if order != 2 else 2
    # ∫ x^a over the unit tetrahedron is a!/(a+3)!
    for a in range(degree + 1):
        exact = 1 / ((a + 1) * (a + 2) * (a + 3))
        assert weights @ points[:, 1] ** a == pytest.approx(exact, rel=1e-13)
    assert simplex_rule(2, order)[1].min() > 0


@pytest.mark.parametrize("seed", range(5))
def test_splitting_keeps_volumes_and_puts_each_part_on_its_side(seed):
    random = np.random.default_rng(seed)
    corners = random.random((200, 4, 3))
    if seed % 2:  # planes through corners and edges
        corners = np.round(corners, 1)
    normal = np.array([1.0, 0.0, 0.0]) if seed % 2 else random.normal(size=3)
    parts, side = split_at_level(corners, lambda x: x @ normal - 0.5 * normal[0])
    assert measures(parts).sum() == pytest.approx(measures(corners).sum(), rel=1e-14)
    heights = (parts @ normal - 0.5 * normal[0]) * side[:, None]
    assert heights.min() > -1e-14
    small = bisect(corners, lambda c: np.full(len(c), 0.4))
    edges = small[:, :, None] - small[:, None]
    assert np.linalg.norm(edges, axis=3).max() <= 0.4
    assert measures(small).sum() == pytest.approx(measures(corners).sum(), rel=1e-14)


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


def test_an_ellipse_has_the_nearest_points_of_its_rim():
    ellipse = {
        "kind": "disc", "centre": [0.5, 0.5, 0.5], "normal": [0.0, 0.0, 1.0],
        "radii": [0.4, 0.2], "axis": [1.0, 0.0, 0.0],
    }  # fmt: skip
    (patch,) = body_of(solid_scene([ellipse])).patches
    random = np.random.default_rng(1)
    points = random.uniform(-0.2, 1.2, (300, 3))
    foot, rim = patch.nearest(points)
    angle = np.linspace(0, 2 * np.pi, 20001)
    ring = 0.5 + np.column_stack([0.4 * np.cos(angle), 0.2 * np.sin(angle), 0 * angle])
    for p, f in zip(points[rim], foot[rim], strict=True):
        sampled = np.linalg.norm(ring - p, axis=1).min()
        # 20 000 points on the rim: the nearest of them is further by the square of their gap
        assert np.linalg.norm(f - p) == pytest.approx(sampled, abs=1e-6)
    assert (np.abs(foot[~rim] - points[~rim])[:, :2] < 1e-15).all()


def test_fronts_are_the_rims_inside_the_body():
    body = body_of(solid_scene([HALF]))
    length = np.linalg.norm(body.front[:, 1] - body.front[:, 0], axis=1).sum()
    # trimmed to a 64th of the body's diagonal at either end
    assert length == pytest.approx(1.0, abs=2 * 3**0.5 / 64)
    assert np.allclose(body.front[..., 0], 0.6)
    assert not len(body_of(solid_scene([inclined()])).front)
    disc = body_of(solid_scene([DISC]))
    assert np.allclose(np.linalg.norm(disc.front - 0.5, axis=2), 0.3)
    at = disc.tip_distance(np.array([[0.5, 0.5, 0.5]]))
    assert at[0] == pytest.approx(0.3, rel=2e-3)  # chords of a 64th of the diagonal


def test_cells_are_graded_to_a_front():
    body = body_of(solid_scene([HALF]))
    rule = body_rule(body, 0.2, depth=1 / 16)
    away = body.tip_distance(rule.points)
    size = (6 * 4 * rule.weights) ** (1 / 3)
    assert size[away < 0.01].max() < 0.05
    assert size[away > 0.4].max() > 0.1


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


def test_a_body_given_by_tetrahedra_has_its_volume_and_its_cut_its_area(tmp_path):
    import meshio

    points, cells = cube_grid(3, 3, 3)
    meshio.Mesh(points, [("tetra", cells)]).write(tmp_path / "cube.vtu")
    case = tmp_path / "case.toml"
    case.write_text(
        'title = "t"\nrequirement = "it shall hold"\n'
        '[geometry]\nkind = "file"\nfile = "cube.vtu"\ndimension = 3\n'
        '[mesh]\npattern = "given"\n[material]\nyoung = 1.0\npoisson = 0.3\n'
        '[[supports]]\nwhere = "z < 1e-9"\ndisplacement = [0.0, 0.0, 0.0]\n'
        f'[[cuts]]\nkind = "polygon"\npoints = {inclined()["points"]}\n'
    )
    body = body_of(load_scene(case))
    rule = body_rule(body, 0.2)
    assert rule.weights.sum() == pytest.approx(1, abs=1e-13)
    above = rule.points[:, 2] > height(rule.points)
    assert rule.weights[above].sum() == pytest.approx(0.5, abs=1e-13)
    area = surface_rule(body, 0.1).weights.sum()
    # no plane to clip at: to the cells on the border, a 16th of the spacing
    assert area == pytest.approx(np.sqrt(1 + 1 / 9 + 1 / 25), rel=5e-3)
    assert not len(body.front)


def test_a_place_on_a_cut_is_the_nearest_point_with_its_normal():
    body = body_of(solid_scene([TUBE]))
    at = nearest_on_cut(body, "cut", np.array([0.9, 0.5, 0.4]))
    assert np.allclose(at.points, [[0.8, 0.5, 0.4]], atol=1e-15)
    assert np.allclose(at.normals, [[-1.0, 0, 0]], atol=1e-9)
