"""Supports and tractions that would act nowhere, found before anything is solved.

An inequality is held against the nodes that the structured meshes of the scene have on the
boundary. Of other meshes nothing is known but that they have nodes at the corners: there the
boundary is sampled much finer than their elements are.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from verify.scene.geometry import Box, Polygon, Rectangle
from verify.scene.physics import Traction
from verify.scene.regions import parse_region
from verify.scene.tables import SceneTables

Array = NDArray[np.float64]

_PER_EDGE = 4096  # samples of an edge of the boundary of an unstructured mesh
_TOLERANCE = 1e-9  # of the body: as where the nodes are found


def check_parts_act(scene: SceneTables) -> None:
    """Raise ValueError if an inequality holds no node, or for a traction no facet, of a level."""
    parts = _inequalities(scene)
    if not parts:
        return
    for level, facets in enumerate(_boundary(scene)):
        _check(scene, parts, facets, f" on mesh level {level}" if scene.mesh.count > 1 else "")


def check_parts_of_mesh(scene: SceneTables, points: Array, cells: NDArray[np.int64]) -> None:
    """Raise ValueError if an inequality holds no node or facet of the boundary of a given mesh.

    Parameters
    ----------
    scene : SceneTables
    points : (n, d) array
    cells : (m, k) int array
    """
    parts = _inequalities(scene)
    if not parts:
        return
    corners = cells.shape[1]
    rest = [[j for j in range(corners) if j != k] for k in range(corners)]
    facets = np.sort(cells[:, rest].reshape(-1, corners - 1), axis=1)
    distinct, count = np.unique(facets, axis=0, return_counts=True)
    _check(scene, parts, points[distinct[count == 1]], "")


def _inequalities(scene: SceneTables) -> list[tuple[str, str, bool]]:
    """Key, inequality, and whether a whole facet is needed, of supports and tractions."""
    parts = [(f"supports[{i}].where", s.where, False) for i, s in enumerate(scene.supports)]
    parts += [
        (f"loads[{i}].where", load.where, True)
        for i, load in enumerate(scene.loads)
        if isinstance(load, Traction)
    ]
    names = (*scene.geometry.parts(), "boundary")
    return [part for part in parts if part[1] not in names]


def _check(
    scene: SceneTables, parts: list[tuple[str, str, bool]], facets: Array, where_it_is: str
) -> None:
    """Refuse a part that holds too few of the corners of all facets (k, corners, d)."""
    points = facets.reshape(-1, scene.dimension)
    tolerance = _TOLERANCE * float(np.ptp(points, axis=0).max())
    for key, where, whole in parts:
        inside = _inside(where, points, tolerance).reshape(facets.shape[:2])
        if inside.sum(axis=1).max() < (scene.cell_dimension if whole else 1):
            what = "facet" if whole else "node"
            raise ValueError(f"{key}: no {what} of the boundary lies in '{where}'{where_it_is}")


def _inside(where: str, points: Array, tolerance: float) -> NDArray[np.bool_]:
    dimension = points.shape[1]
    region = parse_region(where, dimension)
    found = region(points)
    for step in tolerance * np.vstack([np.eye(dimension), -np.eye(dimension)]):
        found |= region(points + step)
    return found


def _boundary(scene: SceneTables) -> list[Array]:
    """Facets (k, corners, d) of the boundary of each level, or pieces in their place."""
    body, mesh = scene.geometry, scene.mesh
    if isinstance(body, Rectangle | Box) and mesh.pattern == "structured":
        lower, upper = np.array(body.lower), np.array(body.upper)
        levels = []
        for level in range(mesh.count):
            if mesh.cells is not None:
                counts = np.array(mesh.cells[level])
            else:
                assert mesh.sizes is not None
                counts = np.ceil((upper - lower) / mesh.sizes[level] * (1 - 1e-9)).astype(int)
            levels.append(_faces(lower, upper, counts))
        return levels
    if isinstance(body, Rectangle | Polygon):
        outline = body.outline()
        share = np.linspace(0.0, 1.0, _PER_EDGE + 1)[:, None]
        ends = np.roll(outline, -1, axis=0)
        lines = [a + share * (b - a) for a, b in zip(outline, ends, strict=True)]
        return [np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])]
    return []  # known from its mesh alone, or meshed by nobody


def _faces(lower: Array, upper: Array, counts: NDArray[np.int64]) -> Array:
    """Edges (k, 2, 2) of a divided rectangle, or squares (k, 4, 3) of a divided box."""
    dimension = len(counts)
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(lower, upper, counts, strict=True)]
    found = []
    for normal in range(dimension):
        others = [k for k in range(dimension) if k != normal]
        grid = np.meshgrid(*[np.arange(counts[k]) for k in others], indexing="ij")
        first = [g.ravel() for g in grid]
        for end in (0, int(counts[normal])):
            corners = []
            for step in product((0, 1), repeat=dimension - 1):
                point = np.empty((len(first[0]), dimension))
                point[:, normal] = axes[normal][end]
                for k, index, s in zip(others, first, step, strict=True):
                    point[:, k] = axes[k][index + s]
                corners.append(point)
            found.append(np.stack(corners, axis=1))
    return np.concatenate(found)
