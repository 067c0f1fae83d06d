"""Tool paths: the swept surface is the cut that an independent triangulation gives."""

import numpy as np
import pytest

from verify.xfem.cuts import Polyline, ToolPath, TriangulatedSurface


def test_a_sweep_in_the_plane_has_the_level_set_of_its_polyline() -> None:
    tips = [[0.0, 0.0], [0.5, 0.1], [0.9, 0.6], [1.0, 1.2]]
    points = np.random.default_rng(1).uniform(-0.5, 1.5, (400, 2))
    sweep = ToolPath.of_tip(tips, range(4)).sweep
    np.testing.assert_allclose(
        sweep.level_set(points), Polyline(tips).level_set(points), atol=1e-14
    )


def test_a_sweep_in_space_has_the_level_set_of_its_triangulation() -> None:
    # a bent blade of three points on a bent path
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 6), np.linspace(0.0, 1.0, 3), indexing="ij")
    blades = np.stack([x, y, 0.3 * np.sin(2.0 * x) + 0.2 * y**2], axis=2)
    number = np.arange(18).reshape(6, 3)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    surface = TriangulatedSurface(blades.reshape(-1, 3), triangles)
    points = np.random.default_rng(2).uniform(-0.3, 1.3, (500, 3))
    sweep = ToolPath(blades, np.arange(6)).sweep
    np.testing.assert_allclose(sweep.level_set(points), surface.level_set(points), atol=1e-13)
    # both call a point past the rim the same, and by the same distance
    past = surface.depth(points) < -1e-12
    np.testing.assert_allclose(sweep.depth(points)[past], surface.depth(points)[past], atol=1e-13)
    assert (sweep.depth(points)[~past] >= -1e-12).all()


def test_the_blade_passes_points_in_proportion_to_its_travel() -> None:
    # 0.6 m in 2 s, 3 s of rest, 0.4 m in 1 s
    path = ToolPath.of_tip([[0.0, 0.0], [0.6, 0.0], [0.6, 0.0], [1.0, 0.0]], [0.0, 2.0, 5.0, 6.0])
    x = np.array([0.0, 0.15, 0.6, 0.8, 1.0])
    travel = path.sweep.travel(np.stack([x, np.zeros(5)], axis=1))
    np.testing.assert_allclose(travel, x, atol=1e-15)
    np.testing.assert_allclose(path.time_at(travel), [0.0, 0.5, 2.0, 5.5, 6.0], atol=1e-14)
    assert path.travel_at(3.0) == pytest.approx(0.6)
    assert path.travel_at(-1.0) < 0.0
    part = path.sweep.until(path.travel_at(5.5))
    np.testing.assert_array_equal(
        part.depth(np.stack([x, np.zeros(5)], axis=1)) >= 0.0, [True, True, True, True, False]
    )


def test_a_blade_that_turns_about_its_end_sweeps_a_connected_fan() -> None:
    angle = np.linspace(0.0, 1.2, 7)
    far = np.stack([np.cos(angle), np.sin(angle), np.zeros(7)], axis=1)
    path = ToolPath(np.stack([np.zeros((7, 3)), far], axis=1), angle)
    facets = path.surface.facets
    assert len(facets) == 6
    inner_edges = (~path.surface.arrays.edge_rim).sum()
    assert inner_edges == 2 * 5


@pytest.mark.parametrize(
    ("tips", "depth"),
    [
        ([[0.2, 0.3], [0.2, 0.3]], None),
        ([[0.2, 0.3, 0.1], [0.2, 0.3, 0.1]], [0.0, 0.0, 0.5]),
        ([[0.2, 0.3, 0.1], [0.2, 0.3, 0.9]], [0.0, 0.0, 0.5]),
        ([[0.2, 0.3, 0.1], [0.2, 0.3 + 1e-13, 0.9]], [0.0, 0.0, 0.5]),
    ],
    ids=["rests", "blade rests", "moves along itself", "nearly along itself"],
)
def test_a_blade_that_stays_on_its_line_sweeps_nothing(tips, depth) -> None:
    path = ToolPath.of_tip(tips, [0.0, 1.0], depth)
    points = np.random.default_rng(3).uniform(0.0, 1.0, (20, len(tips[0])))
    assert (path.sweep.depth(points) < 0.0).all()
    assert (path.sweep.level_set(points) > 0.0).all()


@pytest.mark.parametrize("move", [0.0, 1e-300, 1e-160, 1e-40, 1e-16])
@pytest.mark.parametrize("at", [0, 1, 2])
def test_a_move_of_round_off_size_does_not_change_the_sweep(move, at) -> None:
    tips = np.array([[0.0, 0.0], [0.5, 0.2], [1.0, 0.9]])
    points = np.random.default_rng(4).uniform(-0.5, 1.5, (50, 2))
    jittered = np.insert(tips, at + 1, tips[at] + [0.0, move], axis=0)
    sweeps = ToolPath.of_tip(tips, range(3)).sweep, ToolPath.of_tip(jittered, range(4)).sweep
    for ask in ("level_set", "depth", "travel"):
        np.testing.assert_allclose(*(getattr(one, ask)(points) for one in sweeps), atol=4e-16)
