"""Plane bodies with holes, given as mesh files: a ring held at its hole and cut all around."""

import meshio
import numpy as np
import pytest
import scenes

from verify.compare.body import body_of
from verify.compare.body_rule import area_rule
from verify.compare.cut_profile import opening
from verify.compare.realised import field_of
from verify.solvers import find_solver

HOLE, CUT = 0.2, 0.4


def ring(around, across):
    """Points and triangles of the ring between HOLE and 1, its inner nodes moved at random."""
    radius = np.linspace(HOLE, 1.0, across + 1)
    turn = 2 * np.pi * np.arange(around) / around
    points = np.stack([np.outer(radius, np.cos(turn)), np.outer(radius, np.sin(turn))], axis=-1)
    points[1:-1] += np.random.default_rng(1).uniform(-0.1, 0.1, points[1:-1].shape) / across
    i, j = np.meshgrid(np.arange(across), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    cells = np.concatenate(
        [np.stack([a, c, d], -1).reshape(-1, 3), np.stack([a, d, b], -1).reshape(-1, 3)]
    )
    return points.reshape(-1, 2), cells


def scene(folder, around, across):
    points, cells = ring(around, across)
    meshio.Mesh(points, [("triangle", cells)]).write(folder / "ring.vtu")
    parameters = {"radius": CUT, "outward": 0.1, "at": 1.0}
    found = scenes.scene(
        [{"kind": "arc", "centre": [0, 0], "radius": CUT, "start": 0.0, "sweep": 360.0}],
        geometry={"kind": "file", "file": "ring.vtu"},
        mesh={"pattern": "given"},
        supports=[
            {"where": "hypot(x, y) < 0.3", "displacement": [0, 0]},
            {"where": "hypot(x, y) > 0.9", "displacement": "exact"},
        ],
        exact={"solution": "circular_cut", "parameters": parameters},
        quantities=[{"kind": "opening", "name": "gap", "at": 0.3}],
    )
    found.came_from(folder / "case.toml", "ring")
    return found


def test_a_ring_is_bounded_by_two_loops_and_its_quadrature_leaves_out_the_hole(tmp_path):
    body = body_of(scene(tmp_path, 24, 5))
    polygon = 0.5 * 24 * np.sin(2 * np.pi / 24)  # area of the 24-gon of radius 1
    assert len(body.loops) == 2
    assert body.measure == pytest.approx(polygon * (1 - HOLE**2), rel=1e-12)
    rule = area_rule(body, 0.1)
    assert rule.weights.sum() == pytest.approx(body.measure, rel=1e-12)
    assert np.linalg.norm(rule.points, axis=1).min() > HOLE * np.cos(np.pi / 24)
    # ∫ x² + y² is that of either polygon, by its moment of inertia
    inertia = polygon / 3 * (1 + 0.5 * np.cos(2 * np.pi / 24)) * (1 - HOLE**4)
    assert rule.weights @ np.sum(rule.points**2, axis=1) == pytest.approx(inertia, rel=1e-9)


def test_a_ring_held_at_its_hole_opens_by_lames_gap(tmp_path):
    case = scene(tmp_path, 64, 12)
    body = body_of(case)
    field = field_of(find_solver("xfem").solve(case, 0), body)
    gaps = [opening(field, body, "cut", float(at), "normal") for at in np.linspace(0, 1, 41)]
    # P1 on cells of 0.07: O(h²)
    np.testing.assert_allclose(gaps, 0.1, rtol=0.05)
