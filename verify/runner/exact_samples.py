"""Points of a scene at which its exact solution is held against supports, loads and cuts."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.geometry.nearest import distance_to_pieces
from verify.geometry.spatial import measures, unit_normals
from verify.solvers.loads_of_scene import Boundary
from verify.xfem.mesh import SimplexMesh

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_FACETS, _CELLS, _FACES = 400, 400, 40  # most samples of the boundary, the body, a cut
_BESIDE = 1e-6  # of an element or of the body: on the side meant, and nowhere else


class OnBoundary(NamedTuple):
    """Points (n, d) on the boundary, points beside them in the body, and outward normals."""

    points: Array
    near: Array
    normals: Array


class OnCut(NamedTuple):
    """Points (n, d) of a cut, unit normals to its positive side, distances (n,) to its ends."""

    points: Array
    normals: Array
    to_end: Array


def on_boundary(mesh: SimplexMesh, rng: np.random.Generator) -> OnBoundary:
    """Draw a point inside each facet of the boundary, of some of them if they are many."""
    boundary = Boundary(mesh.points, mesh.cells, mesh.boundary_facets)
    chosen = _some(len(boundary.facets), _FACETS, rng)
    points = _inside(mesh.points[boundary.corners[chosen]], rng)
    middle = mesh.points[mesh.cells[boundary.facets[chosen, 0]]].mean(axis=1)
    near = points + _BESIDE * (middle - points)
    return OnBoundary(points, near, boundary.outward_normals(chosen))


def boundary_nodes(mesh: SimplexMesh) -> tuple[Array, Array]:
    """Nodes (n, d) of the boundary, and a point of the body beside each."""
    boundary = Boundary(mesh.points, mesh.cells, mesh.boundary_facets)
    cell = np.zeros(len(mesh.points), dtype=np.int64)
    cell[boundary.corners.ravel()] = np.repeat(boundary.facets[:, 0], boundary.corners.shape[1])
    points = mesh.points[boundary.nodes]
    middle = mesh.points[mesh.cells[cell[boundary.nodes]]].mean(axis=1)
    return points, points + _BESIDE * (middle - points)


def in_body(mesh: SimplexMesh, rng: np.random.Generator) -> Array:
    """Draw two points (n, 2, d) in each cell, in some of them if they are many."""
    corners = mesh.points[mesh.cells[_some(len(mesh.cells), _CELLS, rng)]]
    return np.stack([_inside(corners, rng), _inside(corners, rng)], axis=1)


def holds(mesh: SimplexMesh, points: Array) -> Bools:
    """Whether each of the points (n, d) lies in the body."""
    corners = mesh.points[mesh.cells]
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max()
    found = np.zeros(len(points), dtype=bool)
    for i, cells in enumerate(cKDTree(middle).query_ball_point(points, reach)):
        edges = (corners[cells, 1:] - corners[cells, :1]).transpose(0, 2, 1)
        share = np.linalg.solve(edges, (points[i] - corners[cells, 0])[:, :, None])[:, :, 0]
        found[i] = bool(((share >= 0.0).all(axis=1) & (share.sum(axis=1) <= 1.0)).any())
    return found


def on_cut(cut: Any, steps: Array, rng: np.random.Generator) -> OnCut:
    """Draw points on a cut: all over it, and at the distances `steps` (k,), m, from its ends."""
    points, normals = _faces(cut, rng)
    ends, outward, of_ends = end_points(cut)
    if len(ends):
        inner = ends[:, None] - steps[:, None] * outward[:, None]
        if cut.dimension == 3 or cut.faceted:  # the tangent of an arc leaves it
            points = np.concatenate([points, inner.reshape(-1, points.shape[1])])
            normals = np.concatenate([normals, np.repeat(of_ends, len(steps), axis=0)])
    far = np.full(len(points), np.inf)
    for end in ends:
        far = np.minimum(far, np.linalg.norm(points - end, axis=1))
    return OnCut(points, normals, far)


def end_points(cut: Any) -> tuple[Array, Array, Array]:
    """Return the ends (k, d) of a cut, the directions in which it would go on, and its normals.

    In space the middles of the edges of a plane patch, and points of the rim of a disc; none of
    surfaces that are curved or kinked.
    """
    pieces = cut.pieces()
    if cut.dimension == 2:
        first, last = pieces[0], pieces[-1]
        ends = np.concatenate([first.point([0.0]), last.point([1.0])])
        along = np.concatenate([first.tangent([0.0]), last.tangent([1.0])])
        outward, normals = along * [[-1.0], [1.0]], along[:, ::-1] * [-1.0, 1.0]
        closed = np.linalg.norm(ends[1] - ends[0]) <= 1e-12 * np.abs(ends).max()
        return (np.zeros((0, 2)),) * 3 if closed else (ends, outward, normals)
    if cut.plane_normal is None:
        return (np.zeros((0, 3)),) * 3
    ends, outward = pieces[0].rim()
    return ends, outward, np.tile(cut.plane_normal, (len(ends), 1))


def distances(cuts: Sequence[Any], points: Array) -> Array:
    """Distance (n,) to the nearest cut."""
    pieces = [piece for cut in cuts for piece in cut.pieces()]
    return distance_to_pieces(points, pieces) if pieces else np.full(len(points), np.inf)


def _faces(cut: Any, rng: np.random.Generator) -> tuple[Array, Array]:
    """Points (n, d) all over a cut, and unit normals there, to its positive side."""
    points, facets = cut.facets()
    corners = points[facets]
    sizes = measures(corners)
    part = rng.choice(len(corners), _FACES, p=sizes / sizes.sum())
    drawn = _inside(corners[part], rng)
    if cut.faceted:
        return drawn, unit_normals(corners)[part]
    (piece,) = cut.pieces()
    feet = piece.foot(drawn)
    return feet, piece.facing(feet)


def _inside(corners: Array, rng: np.random.Generator) -> Array:
    """Draw a point (n, d) inside each simplex (n, k, d)."""
    share = rng.dirichlet(np.ones(corners.shape[1]), len(corners))
    return np.einsum("nk,nkd->nd", share, corners)


def _some(count: int, most: int, rng: np.random.Generator) -> NDArray[np.int64]:
    return np.arange(count) if count <= most else np.sort(rng.choice(count, most, replace=False))
