"""Supports and tractions that would act nowhere, found before anything is solved.

A traction needs a part of the boundary's facets; a support that, or a node of the structured meshes
of the scene. Of other meshes nothing is known but that they have nodes at the corners.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from verify.scene.geometry import Box, Polygon, Rectangle
from verify.scene.held_facets import held_facets
from verify.scene.part_pieces import pieces_on_part
from verify.scene.parts import on_part
from verify.scene.physics import Traction
from verify.scene.tables import SceneTables

Array = NDArray[np.float64]


def check_parts_act(scene: SceneTables) -> None:
    """Raise ValueError if a support's inequality holds nothing of a level, or a traction's none."""
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
    """Key, inequality, and whether more than a node is needed, of supports and tractions."""
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
    """Refuse a part that has nothing of facets (k, corners, d), and for a support no node."""
    points = facets.reshape(-1, scene.dimension)
    size = float(np.ptp(points, axis=0).max())
    for key, where, area in parts:
        if not area and on_part(scene.geometry, where, points, size).any():
            continue
        if area:
            nothing = not len(pieces_on_part(scene.geometry, where, facets).facet)
        else:
            nothing = not held_facets(scene.geometry, where, facets).held.any()
        if nothing:
            what = "facet" if area else "node"
            raise ValueError(f"{key}: no {what} of the boundary lies in '{where}'{where_it_is}")


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
        return [np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)]
    return []  # known from its mesh alone, or meshed by nobody


def _faces(lower: Array, upper: Array, counts: NDArray[np.int64]) -> Array:
    """Edges (k, 2, 2) of a divided rectangle, or half squares (k, 3, 3) of a divided box."""
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
            square = np.stack(corners, axis=1)
            halves = [square] if dimension == 2 else [square[:, :3], square[:, 1:]]
            found.extend(halves)
    return np.concatenate(found)
