"""Measures of a closed oriented surface, from its facets alone."""

import numpy as np
from numpy.typing import NDArray

from verify.simulator.moving_surface import MovingSurface
from verify.xfem.phantom import PhantomMesh


def sphere(levels):
    """Vertices and outward triangles of the unit sphere: an octahedron, divided and projected."""
    points = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], float)
    cells = np.array(
        [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [1, 0, 5], [2, 1, 5], [3, 2, 5], [0, 3, 5]]
    )
    for _ in range(levels):
        edges = np.sort(cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, back = np.unique(edges, axis=0, return_inverse=True)
        middle = points[unique].mean(axis=1)
        (a, b, c), (ab, bc, ca) = cells.T, (len(points) + back.reshape(-1, 3)).T
        points = np.concatenate([points, middle / np.linalg.norm(middle, axis=1)[:, None]])
        cells = np.concatenate(
            [np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return points, cells


def loose_edges(facets: NDArray[np.int64]) -> int:
    """Edges (2D: vertices) that are not used as often in one direction as in the other."""
    if facets.shape[1] == 2:
        size = facets.max(initial=-1) + 1
        ends = [np.bincount(facets[:, k], minlength=size) for k in range(2)]
        return int((ends[0] != ends[1]).sum())
    uses = _directed(facets)
    return sum(uses[edge] != uses.get((edge[1], edge[0]), 0) for edge in uses)


def pinched_edges(facets: NDArray[np.int64]) -> int:
    """Edges at which more than two triangles meet, as they do where a cut is still closed."""
    return sum(count > 1 for count in _directed(facets).values()) // 2


def _directed(facets: NDArray[np.int64]) -> dict[tuple[int, int], int]:
    uses: dict[tuple[int, int], int] = {}
    for triangle in facets.tolist():
        for k in range(3):
            edge = (triangle[k], triangle[(k + 1) % 3])
            uses[edge] = uses.get(edge, 0) + 1
    return uses


def enclosed_by_body(surface: MovingSurface, phantom: PhantomMesh) -> NDArray[np.float64]:
    """Area or volume that the facets of each free body enclose (divergence theorem)."""
    facets = surface.facets.rows[surface.used]
    corners = surface.material.rows[facets]
    if facets.shape[1] == 2:
        share = 0.5 * (corners[:, 0, 0] * corners[:, 1, 1] - corners[:, 0, 1] * corners[:, 1, 0])
    else:
        share = np.linalg.det(corners) / 6.0
    vertex = facets[:, 0]
    heaviest = np.abs(surface.weights.rows[vertex]).argmax(axis=1)
    node = surface.nodes.rows[vertex, heaviest]
    return np.bincount(phantom.bodies[node], share, minlength=int(phantom.bodies.max()) + 1)


def volume_by_body(phantom: PhantomMesh) -> NDArray[np.float64]:
    """Sum of the volumes of the pieces of each free body."""
    body = phantom.bodies[phantom.cells[:, 0]]
    return np.bincount(body, phantom.volumes, minlength=int(phantom.bodies.max()) + 1)
