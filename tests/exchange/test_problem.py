"""A scene as arrays carries the scene's physics: forces sum up, values lie on the right side."""

from importlib.util import find_spec

import numpy as np
import pytest
import scenes

from verify.exchange import problem_of
from verify.scene import load_scene

needs_gmsh = pytest.mark.skipif(find_spec("gmsh") is None, reason="needs gmsh")


def scene(**parts):
    content = {
        "geometry": scenes.box([2.0, 1.0]),
        "mesh": {"cells": [[5, 4]]},
        "material": scenes.soft(density=3.0),
        "supports": [{"where": "left", "displacement": [0.0, 0.0]}],
        "cuts": [{"kind": "polyline", "points": [[-0.1, 0.37], [2.1, 0.61]]}],
    }
    return scenes.scene(**content | parts)


BOX = {
    "geometry": scenes.box([2.0, 1.0, 0.5]),
    "mesh": {"cells": [[3, 2, 2]]},
    "material": scenes.soft(3, density=3.0),
    "supports": [{"where": "left", "displacement": [0.0, 0.0, 0.0]}],
    "cuts": [],
}


@pytest.mark.parametrize("conforming", [False, True])
def test_consistent_forces_sum_to_weight_and_traction(conforming):
    loads = [
        {"kind": "gravity", "acceleration": [0.5, -2.0]},
        {"kind": "body_force", "force": [0.1, 0.2]},
        {"kind": "traction", "where": "top", "traction": [0.7, -0.3]},
    ]
    forces = problem_of(scene(loads=loads), 0, conforming).nodal_forces()
    # area 2 times (density · g + f), and 2 m of upper side
    expected = 2 * (3 * np.array([0.5, -2.0]) + [0.1, 0.2]) + 2 * np.array([0.7, -0.3])
    np.testing.assert_allclose(forces.sum(axis=0), expected, rtol=1e-13)


def test_each_doubled_node_gets_the_value_of_its_own_side():
    problem = problem_of(load_scene("statics/f1_patch"), 0, conforming=True)
    held, value = problem.prescribed()
    _, first, twins = np.unique(problem.points, axis=0, return_index=True, return_counts=True)
    mouths = np.flatnonzero(twins == 2)
    at_mouth = [i for i in first[mouths] if held[i].all()]
    assert len(at_mouth) == 2  # left and right end of the cut
    for node in at_mouth:
        pair = np.flatnonzero((problem.points == problem.points[node]).all(axis=1))
        height = [
            problem.points[problem.cells[(problem.cells == i).any(axis=1)]].mean(axis=(0, 1))[1]
            for i in pair
        ]
        above, below = value[pair[np.argsort(height)[::-1]]]
        # F1: the jump at distance s from the middle is (ε₊ − ε₋) s along, 0.02 across
        s = (problem.points[node] - 0.5) @ [3, 1] / np.sqrt(10)
        jump = 0.15 * s * np.array([3, 1]) / np.sqrt(10) + 0.02 * np.array([-1, 3]) / np.sqrt(10)
        np.testing.assert_allclose(above - below, jump, atol=1e-14)


def test_a_background_mesh_says_the_value_across_the_cut_at_each_facet_that_it_crosses():
    case = load_scene("statics/f1_patch")
    problem = problem_of(case, 0)
    (held,) = problem.held
    # the cut crosses one facet on the left and one on the right: two nodes each
    assert len(held.across) == 4
    conforming = problem_of(case, 0, conforming=True)
    assert all(not entry.across for entry in conforming.held)
    row = {node: i for i, node in enumerate(held.nodes)}
    for node, side_point, value in held.across:
        assert np.abs(value - held.values[row[node]]).max() > 0.01
        assert (problem.points[node] == side_point).any()  # its neighbour on the same side


def test_the_later_of_two_supports_wins():
    supports = [
        {"where": "boundary", "displacement": [0.1, 0.2]},
        {"where": "left", "displacement": [0.5], "components": ["y"]},
    ]
    problem = problem_of(scene(supports=supports), 0)
    held, value = problem.prescribed()
    left = problem.points[:, 0] == 0
    assert held[left].all()
    np.testing.assert_array_equal(value[left], np.tile([0.1, 0.5], (left.sum(), 1)))


@needs_gmsh
def test_a_conforming_mesh_in_space_is_torn_along_the_cut():
    plane = [[-0.1, -0.1, 0.2], [2.1, -0.1, 0.2], [2.1, 1.1, 0.3], [-0.1, 1.1, 0.3]]
    weight = [{"kind": "gravity", "acceleration": [0.0, 0.0, -2.0]}]
    cut = [{"kind": "polygon", "points": plane, "expected": "through"}]
    problem = problem_of(scene(**{**BOX, "cuts": cut}, loads=weight), 0, conforming=True)
    edges = problem.cut_facets[:, 1:] - problem.cut_facets[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1).sum()
    assert area == pytest.approx(2.0 * np.hypot(1.0, 0.1 / 1.2), rel=1e-9)
    np.testing.assert_allclose(problem.nodal_forces().sum(axis=0), [0, 0, -6.0], atol=1e-12)
    assert len(problem.free_pieces()) == 0  # both halves reach the left face, which is held


def test_loads_and_supports_carry_their_history():
    history = [(0.0, 0.0), (0.5, 1.0)]
    moving = {"kind": "dynamic", "duration": 1.0}
    turned = {
        "where": "left", "displacement": [0.1, 0.0], "history": history,
        "rotation": {"angle": 90.0, "centre": [0.0, 0.0]},
    }  # fmt: skip
    loads = [{"kind": "traction", "where": "top", "traction": [1.0, 0.0], "history": history}]
    problem = problem_of(scene(analysis=moving, supports=[turned], loads=loads), 0)
    assert problem.loads[0].history == history
    held = problem.held[0]
    at = problem.points[held.nodes]
    np.testing.assert_allclose(
        held.values, np.column_stack([0.1 - at[:, 1], -at[:, 1]]), atol=1e-15
    )
    half = held.support.values(at, 0.5)
    np.testing.assert_allclose(half[:, 1], (np.cos(np.pi / 4) - 1) * at[:, 1], atol=1e-15)


def test_a_piece_that_too_little_holds_is_found_where_it_is():
    bottom = [{"where": "bottom", "displacement": [0.0, 0.0]}]
    (free,) = problem_of(scene(supports=bottom), 0, conforming=True).free_pieces()
    assert free[1] > 0.61 or free[1] > 0.37 + 0.2 * free[0]  # above the cut
    both = [*bottom, {"where": "top", "displacement": [0.0], "components": ["y"]}]
    assert len(problem_of(scene(supports=both), 0, conforming=True).free_pieces()) == 0
    assert len(problem_of(scene(**BOX), 0).free_pieces()) == 0


LAYERS = [{"where": "y > 0.5", "young": 5.0}, {"where": "x > 1.2", "density": 7.0}]
REGIONS = scenes.soft(density=3.0, regions=LAYERS) | {"plane": "stress"}


def test_each_cell_has_the_constants_of_its_own_material_and_the_body_their_weight():
    # x = 1.2 and y = 0.5 are lines of the mesh
    loads = [{"kind": "gravity", "acceleration": [1.0, -2.0]}]
    problem = problem_of(scene(material=REGIONS, loads=loads), 0, conforming=True)
    mass = 3.0 * 1.2 + 7.0 * 0.8
    np.testing.assert_allclose(problem.nodal_forces().sum(axis=0), mass * np.array([1.0, -2.0]))
    middle = problem.points[problem.cells].mean(axis=1)
    young = np.where((middle[:, 1] > 0.5) & (middle[:, 0] < 1.2), 5.0, 1.0)
    lam, mu = problem.lame()
    np.testing.assert_allclose(mu[:, 0], young / 2.6)
    np.testing.assert_allclose(lam[:, 0], young * 0.3 / (1 - 0.09))
    np.testing.assert_allclose(problem.density()[:, 0], np.where(middle[:, 0] > 1.2, 7.0, 3.0))
