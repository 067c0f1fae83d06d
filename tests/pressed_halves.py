"""Two halves of a unit square or cube on meshes of their own, pressed into each other.

The halves are convex, so that what they have in common after rigid motions is one convex body,
whose size is found by half-spaces: no mesh, no search.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay, HalfspaceIntersection

from verify.compare.simplices import EDGES
from verify.solution import Solution

Array = NDArray[np.float64]

# through the middle, at odd angles
NORMALS = {2: np.array([-0.31, 0.95]), 3: np.array([-0.27, 0.14, 0.95])}


def normal(d: int) -> Array:
    """Unit normal (d,) of the cut, into the upper half."""
    return NORMALS[d] / np.linalg.norm(NORMALS[d])


def halves(d: int, n: int, seed: int = 0) -> list[tuple[Array, NDArray[np.int64]]]:
    """Points and simplices of the lower and the upper half; their faces share no nodes."""
    found = []
    for sign in (1.0, -1.0):
        planes = _planes(d, sign)
        corners = HalfspaceIntersection(planes, 0.5 + 0.2 * -sign * normal(d)).intersections
        rng = np.random.default_rng(seed + (sign < 0))
        points = rng.random((3 * n**d, d))
        points = points[(points @ planes[:, :d].T + planes[:, d] < -0.3 / n).all(axis=1)]
        walls = [_on_face(corners, plane, n, rng) for plane in planes]
        points = np.concatenate([corners, *walls, points])
        points = points[np.unique(np.round(points, 9), axis=0, return_index=True)[1]]
        cells = Delaunay(points).simplices.astype(np.int64)
        size = np.abs(np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]))
        found.append((points, cells[size > 1e-9]))
    return found


def pressed(d: int, n: int, moves: list[tuple[Array, Array]], order: int = 1, seed: int = 0):
    """Solution in which the halves go by X → turn @ X + shift, (turn, shift) for each."""
    points, cells, moved, count = [], [], [], 0
    for (own, simplices), (turn, shift) in zip(halves(d, n, seed), moves, strict=True):
        if order == 2:
            own, simplices = quadratic(own, simplices)
        points.append(own)
        cells.append(simplices + count)
        moved.append(own @ turn.T + shift)
        count += len(own)
    joined = np.concatenate(points)
    return Solution(joined, np.concatenate(cells), (np.concatenate(moved) - joined)[None],
                    order=order, cut_facets=np.zeros((0, d, d)))  # fmt: skip


def quadratic(points: Array, cells: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Add mid-edge nodes in VTK's order."""
    pairs = np.concatenate([cells[:, list(edge)] for edge in EDGES[points.shape[1]]])
    edges, inverse = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    middle = len(points) + inverse.reshape(-1, len(cells)).T
    return np.vstack([points, points[edges].mean(axis=1)]), np.column_stack([cells, middle])


def common(d: int, moves: list[tuple[Array, Array]]) -> tuple[float, float]:
    """Exact measure that both halves cover, and the largest depth of a face of the cut in it.

    The depth of a point of one half's face of the cut is its distance from the other's.
    """
    planes = []
    for sign, (turn, shift) in zip((1.0, -1.0), moves, strict=True):
        own = _planes(d, sign)
        normals = own[:, :d] @ turn.T
        planes.append(np.column_stack([normals, own[:, d] - normals @ shift]))
    everything = np.concatenate(planes)
    inside = _inner_point(everything)
    if inside is None:
        return 0.0, 0.0
    corners = HalfspaceIntersection(everything, inside).intersections
    faces = [own[-1] for own in planes]  # the cut is the last
    height = [-(corners @ face[:d] + face[d]) for face in faces]
    on = [h < 1e-9 for h in height]
    depth = max(float(height[1][on[0]].max(initial=0)), float(height[0][on[1]].max(initial=0)))
    return float(ConvexHull(corners).volume), depth


def _planes(d: int, sign: float) -> Array:
    """Half-spaces a x + b ≤ 0 (2d + 1, d + 1) of a half; the cut is the last."""
    box = np.concatenate([np.column_stack([np.eye(d), -np.ones(d)]),
                          np.column_stack([-np.eye(d), np.zeros(d)])])  # fmt: skip
    cut = sign * np.append(normal(d), -normal(d) @ np.full(d, 0.5))
    return np.vstack([box, cut])


def _on_face(corners: Array, plane: Array, n: int, rng) -> Array:
    """Random points on one face of a convex body."""
    own = corners[np.abs(corners @ plane[:-1] + plane[-1]) < 1e-9]
    if not len(own):  # a face of the box that the half does not reach
        return np.zeros((0, corners.shape[1]))
    shares = rng.dirichlet(np.ones(len(own)), size=n if plane.size == 3 else 2 * n * n)
    return shares @ own


def _inner_point(planes: Array) -> Array | None:
    from scipy.optimize import linprog

    norm = np.linalg.norm(planes[:, :-1], axis=1)
    d = planes.shape[1] - 1
    found = linprog(
        np.append(np.zeros(d), -1.0), np.column_stack([planes[:, :-1], norm]), -planes[:, -1],
        bounds=[(None, None)] * d + [(0, None)],
    )  # fmt: skip
    return found.x[:d] if found.success and found.x[d] > 1e-12 else None
