"""Distances, feet, levels, depths and areas, against dense sampling and closed forms."""

import numpy as np
import pytest

from verify.geometry.curves import Arc, Segment
from verify.geometry.patches import CylinderPatch, DiscPatch, PlanePatch, SpherePatch
from verify.geometry.simplices import (
    distance_to_pieces,
    ear_clipping,
    frame,
    measures,
    nearest_parts,
    unit_normals,
)

AXES = frame(np.array([0.3, -0.5, 0.8]), np.array([1.0, 0.4, 0.0]))
ORIGIN = np.array([0.2, -0.1, 0.4])
HOOK = np.array([[0.0, 0.0], [1.0, 0.1], [0.9, 0.9], [0.5, 0.3], [0.1, 0.8]])


def hook() -> PlanePatch:
    """A plane polygon that is not convex."""
    corners = ORIGIN + HOOK @ AXES[:2]
    return PlanePatch.of(corners[ear_clipping(corners)], AXES[2])


PIECES = {
    "segment": Segment(np.array([0.1, 0.7]), np.array([-0.4, 0.2])),
    "arc": Arc(np.array([0.1, 0.2]), 0.6, 2.0, 4.5),
    "circle": Arc(np.array([0.1, 0.2]), 0.6, 2.0, 2 * np.pi),
    "polygon": hook(),
    "disc": DiscPatch(ORIGIN, AXES, (0.5, 0.5)),
    "ellipse": DiscPatch(ORIGIN, AXES, (0.7, 0.3)),
    "sector": CylinderPatch(ORIGIN, AXES, Arc(np.zeros(2), 0.5, 1.0, 3.9), 0.8),
    "cylinder": CylinderPatch(ORIGIN, AXES, Arc(np.zeros(2), 0.5, 0.0, 2 * np.pi), 0.8),
    "cap": SpherePatch(ORIGIN, AXES, 0.6, 1.9),
    "sphere": SpherePatch(ORIGIN, AXES, 0.6, np.pi),
}


def samples(piece, count):
    """Points on a piece, and the largest distance of any of its points to the nearest of them."""
    if isinstance(piece, Segment | Arc):
        return piece.point(np.linspace(0.0, 1.0, count + 1)), 0.5 * piece.length / count
    inside = np.array([(i, j) for i in range(count + 1) for j in range(count + 1 - i)]) / count
    corners = np.concatenate([(1 - inside.sum(axis=1))[:, None], inside], axis=1)
    points = [piece.point(corners @ cell) for cell in piece.cells]
    t = np.linspace(0.0, 1.0, count + 1)[:, None]
    lines = [piece.point((1 - t) * a + t * b) for cell in piece.cells
             for a, b in zip(cell, np.roll(cell, -1, axis=0), strict=True)]  # fmt: skip
    steps = np.linalg.norm(np.diff(lines, axis=1), axis=2)
    return np.concatenate(points), float(steps.max())


@pytest.mark.parametrize("name", PIECES)
def test_the_foot_is_on_the_piece_and_no_sample_is_nearer(name):
    piece = PIECES[name]
    on, apart = samples(piece, 24)
    points = np.random.default_rng(3).uniform(-1.2, 1.6, (40, on.shape[1]))
    foot = piece.foot(points)
    away = np.linalg.norm(points - foot, axis=1)
    nearest = np.linalg.norm(points[:, None] - on, axis=2).min(axis=1)
    assert (away <= nearest + 1e-12).all()
    assert (nearest <= away + apart).all()
    assert np.linalg.norm(foot[:, None] - on, axis=2).min(axis=1).max() <= apart
    assert piece.foot(foot) == pytest.approx(foot, abs=1e-12)
    assert distance_to_pieces(points, [piece]) == pytest.approx(away, abs=1e-14)


@pytest.mark.parametrize("name", PIECES)
def test_the_level_is_the_signed_distance_along_the_normal(name):
    piece = PIECES[name]
    if isinstance(piece, Segment | Arc):
        t = np.linspace(0.05, 0.95, 9)
        on, along = piece.point(t), piece.tangent(t)
        normal = np.column_stack([-along[:, 1], along[:, 0]])
    else:
        on = (uv := piece.cells.mean(axis=1), piece.point(uv))[1]
        normal = piece.normal(uv)
    assert piece.facing(on) == pytest.approx(normal, abs=1e-14)
    for height in (-0.1, 0.0, 0.2):
        assert piece.level(on + height * normal) == pytest.approx(height, abs=1e-14)
        # the foot is where it started: the normal is square to the piece, and of length one
        assert piece.foot(on + height * normal) == pytest.approx(on, abs=1e-12)


@pytest.mark.parametrize("name", ["arc", "disc", "sector", "cylinder", "cap"])
def test_the_depth_is_the_distance_to_the_rim_along_the_surface(name):
    """Moved along the surface by its depth a point is on the rim, and by less it is not."""
    piece = PIECES[name]
    t = np.linspace(0.02, 0.98, 25)
    if name == "arc":
        on, exact = piece.point(t), piece.length * np.minimum(t, 1.0 - t)
        beyond = piece.centre + 0.6 * np.array([[np.cos(1.9), np.sin(1.9)]])
        assert piece.depth(beyond) == pytest.approx([-0.06], abs=1e-12)
    elif name == "disc":
        on, exact = piece.point(np.column_stack([t, 9.0 * t])), 0.5 * (1.0 - t)
    elif name == "cap":
        on, exact = piece.point(np.column_stack([1.9 * t, 9.0 * t])), 0.6 * 1.9 * (1.0 - t)
    else:
        s = np.mod(7.0 * t, 1.0)
        on, exact = piece.point(np.column_stack([s, 0.8 * t])), 0.8 * np.minimum(t, 1.0 - t)
        if name == "sector":
            exact = np.minimum(exact, piece.arc.length * np.minimum(s, 1.0 - s))
    assert piece.depth(on) == pytest.approx(exact, abs=1e-12)


@pytest.mark.parametrize("name", ["polygon", "disc", "ellipse"])
def test_a_step_over_the_rim_of_a_flat_piece_leaves_it_and_one_back_does_not(name):
    """At a reentrant corner too, where outward is not away from the middle."""
    piece, step = PIECES[name], 1e-6
    ends, outward = piece.rim()
    assert np.linalg.norm(outward, axis=1) == pytest.approx(1.0)
    assert outward @ AXES[2] == pytest.approx(0.0, abs=1e-14)
    for way, off in ((step, step), (-step, 0.0)):
        points = ends + way * outward
        assert np.linalg.norm(points - piece.foot(points), axis=1) == pytest.approx(off, abs=1e-10)
    assert len(ends) == (len(HOOK) if name == "polygon" else 8)


@pytest.mark.parametrize("corners, space", [(2, 2), (2, 3), (3, 3)])
def test_the_measure_of_a_simplex_is_that_of_gram_and_its_normal_is_square_to_its_edges(
    corners, space
):
    simplices = np.random.default_rng(corners + space).uniform(-1.0, 1.0, (20, corners, space))
    edges = simplices[:, 1:] - simplices[:, :1]
    gram = np.sqrt(np.linalg.det(edges @ np.swapaxes(edges, 1, 2)))
    assert measures(simplices) == pytest.approx(gram / (corners - 1), rel=1e-9)
    if corners == space:
        normals = unit_normals(simplices)
        assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
        assert np.einsum("mkd,md->mk", edges, normals) == pytest.approx(0.0, abs=1e-12)
        # edges and normal are a right-handed frame in space, in the plane the normal is left
        frames = np.concatenate([edges, normals[:, None]], axis=1)
        assert (np.linalg.det(frames) > 0.0).all()


AREAS = {
    "polygon": 0.5,  # the shoelace formula, by hand
    "disc": np.pi * 0.25,
    "ellipse": np.pi * 0.21,
    "sector": 0.5 * 3.9 * 0.8,
    "cylinder": np.pi * 0.8,
    "cap": 2 * np.pi * 0.36 * (1.0 - np.cos(1.9)),
    "sphere": 4 * np.pi * 0.36,
}


@pytest.mark.parametrize("name", AREAS)
def test_the_stretch_integrates_to_the_area_and_the_bounds_hold_every_point(name):
    piece = PIECES[name]
    x, w = np.polynomial.legendre.leggauss(12)
    s, t = (v.ravel() for v in np.meshgrid(0.5 + 0.5 * x, 0.5 + 0.5 * x))
    weights = 0.25 * np.outer(w, w).ravel()
    total = 0.0
    for a, b, c in piece.cells:  # the square folded onto the triangle (Duffy)
        uv = a + np.outer(s, b - a) + np.outer(s * t, c - b)
        det = abs(np.linalg.det([b - a, c - a]))
        total += float((weights * s * piece.stretch(uv)).sum() * det)
    assert total == pytest.approx(AREAS[name], rel=1e-12)
    on, apart = samples(piece, 24)
    low, high = piece.bounds()
    assert ((on >= low - 1e-12) & (on <= high + 1e-12)).all()
    if name not in ("cylinder", "sector"):  # reached
        assert ((on.min(axis=0) <= low + apart) & (on.max(axis=0) >= high - apart)).all()


@pytest.mark.parametrize("corners", [2, 3])
def test_the_nearest_of_segments_or_triangles_is_that_of_dense_samples(corners):
    random = np.random.default_rng(corners)
    parts = random.uniform(-1.0, 1.0, (7, corners, 3))
    points = random.uniform(-1.5, 1.5, (60, 3))
    grid = np.stack(np.meshgrid(*[np.arange(31)] * corners, indexing="ij"), axis=-1) / 30
    shares = grid[np.abs(grid.sum(axis=-1) - 1.0) < 1e-9]
    on = np.einsum("sk,mkd->msd", shares, parts)
    sampled = np.linalg.norm(points[:, None, None] - on, axis=3).min(axis=2)
    distance, number = nearest_parts(points, parts)
    assert (distance <= sampled.min(axis=1) + 1e-12).all()
    assert distance == pytest.approx(sampled.min(axis=1), abs=0.5 * 3.5 / 30)
    assert (sampled[np.arange(60), number] <= distance + 0.5 * 3.5 / 30).all()
