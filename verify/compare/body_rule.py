"""Quadrature of a cut body in space: neutral simplices, split by the cuts, graded to fronts.

A box is divided by a grid of its own, whose planes are shifted at random (with a fixed seed), so
that its points do not fall in step with a structured mesh; the simplices of a mesh file are
divided at random points. Plane cuts split them exactly; a cylinder splits them along its linear
interpolant in tetrahedra so small that the sagitta is a thirtieth of the spacing. The side of a
point is then a matter of the field that is asked; the rest is in the integration error.
"""

import numpy as np
from numpy.typing import NDArray

from verify.compare.cell_tree import morton_order
from verify.compare.simplex_body import SimplexBody
from verify.compare.simplex_rule import points_in
from verify.compare.slabs import ROUND_OFF, Rule
from verify.compare.splitting import bisect, heights, split_at_level
from verify.geometry.patches import Patch

Array = NDArray[np.float64]

# Kuhn's tetrahedra keep their orientation as long as no node moves by a sixth of the spacing.
_SHAKE = 0.15
_DIAGONAL = 3**0.5


def body_rule(
    body: SimplexBody, spacing: float, seed: int = 0, order: int = 2, depth: float = 0.25,
    grading: float = 1.0,
) -> Rule:  # fmt: skip
    """Quadrature of a solid or of a membrane.

    Parameters
    ----------
    body : SimplexBody
    spacing : float
        Size of the cells, m.
    seed : int
        Of the random shifts.
    order : int
        Of the rule in each simplex, see `simplex_rule`.
    depth : float
        Size of the cells at fronts, relative to the spacing.
    grading : float
        Size of the cells near fronts, relative to their distance from them.

    Returns
    -------
    Rule
        Exact measures of the body and, for plane cuts, of each of its parts; of a membrane with
        frames.
    """
    cells = _cells(body, spacing, seed, depth, grading)
    # the points of a piece that is round-off would be on the cut
    points, weights = points_in(cells[heights(cells) > ROUND_OFF * body.size], order)
    kept = morton_order(points)
    points = np.ascontiguousarray(points[kept])
    return Rule(points, weights[kept], body.frames_at(points))


def _cells(body: SimplexBody, spacing: float, seed: int, depth: float, grading: float) -> Array:
    """Simplices (m, k + 1, 3) of the quadrature."""
    random = np.random.default_rng(seed)
    if body.box is not None:
        cells = _shaken_grid(body.box, spacing, random)
    else:
        cells = _divided(body.corners, random)
        # grid cells have diagonals of √3 spacings; elements of a file are as small as they are
        cells = bisect(cells, lambda c: np.full(len(c), _DIAGONAL * spacing))
    if len(body.front):

        def near_front(c: Array) -> Array:
            away = body.tip_distance(c.mean(axis=1))
            return _DIAGONAL * np.clip(grading * away, depth * spacing, spacing)

        cells = bisect(cells, near_front)
    for patch in body.patches:
        cells = _split(cells, patch, spacing)
    return cells


def _split(cells: Array, patch: Patch, spacing: float) -> Array:
    """Divide the cells that a patch may pass through."""
    lower, upper = patch.bounds()
    margin = 1e-9 * float(np.linalg.norm(upper - lower))

    def reached(c: Array) -> NDArray[np.bool_]:
        low, high = c.min(axis=1), c.max(axis=1)
        return np.asarray(((low <= upper + margin) & (high >= lower - margin)).all(axis=1))

    here = reached(cells)
    rest, cells = cells[~here], cells[here]
    if patch.curvature:
        limit = (8 / 30 * spacing / patch.curvature) ** 0.5  # sagitta: limit² · curvature / 8

        def fine(c: Array) -> Array:
            longest = np.linalg.norm(np.ptp(c, axis=1), axis=1)
            met = np.abs(patch.level(c.mean(axis=1))) < longest
            return np.where(met & reached(c), limit, np.inf)

        cells = bisect(cells, fine)
    return np.concatenate([rest, split_at_level(cells, patch.level)[0]])


def _shaken_grid(box: Array, spacing: float, random: np.random.Generator) -> Array:
    """Kuhn tetrahedra (m, 4, 3) of a grid on a box whose inner nodes are moved."""
    shape = np.maximum(1, np.ceil((box[1] - box[0]) / spacing).astype(int))
    nodes = np.stack(np.meshgrid(*(np.arange(n + 1.0) for n in shape), indexing="ij"), axis=-1)
    shift = random.uniform(-_SHAKE, _SHAKE, nodes.shape)
    for axis, n in enumerate(shape):  # nodes on a face stay on it
        shift[(nodes[..., axis] == 0) | (nodes[..., axis] == n), axis] = 0.0
    grid = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
    first = np.stack([i.ravel() for i in grid], axis=1)
    points = box[0] + (nodes + shift) / shape * (box[1] - box[0])
    paths = ([0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0])
    cells = []
    for path in paths:
        corner, row = first.copy(), [first]
        for axis in path:
            corner = corner + np.eye(3, dtype=int)[axis]
            row.append(corner)
        cells.append(np.stack([points[tuple(c.T)] for c in row], axis=1))
    return np.concatenate(cells)


def _divided(corners: Array, random: np.random.Generator) -> Array:
    """Simplices (k m, k, 3) around a random point inside each of (m, k, 3)."""
    count = corners.shape[1]
    weight = random.dirichlet(np.full(count, 8.0), len(corners))
    inner = np.einsum("mk,mka->ma", weight, corners)
    parts = []
    for k in range(count):
        part = corners.copy()
        part[:, k] = inner
        parts.append(part)
    return np.concatenate(parts)
