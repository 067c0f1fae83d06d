"""Cuts that open one after the other on one mesh that conforms to all of them."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reference.meshing import ConformingMesh, open_cut
from verify.scene import (
    ArcCut,
    CylinderCut,
    DiscCut,
    PolygonCut,
    PolylineCut,
    Scene,
    SphereCut,
    SweptCut,
)
from verify.scene.planar import distance_to_outline, distance_to_polyline, inside_polygon

__all__ = ["partly_opened"]

Array = NDArray[np.float64]


def partly_opened(scene: Scene, mesh: ConformingMesh, opened: Sequence[bool]) -> ConformingMesh:
    """Give a mesh with all cuts open again, with some of them open only; cells stay in order.

    Parameters
    ----------
    scene : Scene
    mesh : ConformingMesh
    opened : sequence of bool
        Whether each cut of the scene is open. A facet belongs to the cut that it is closest to:
        one on a curved cut is off by its own sagitta, and cuts do not lie on each other.
    """
    if all(opened):
        return mesh
    parents = int(mesh.parent.max()) + 1
    points = np.empty((parents, mesh.dimension))
    points[mesh.parent] = mesh.points
    keep = np.zeros(len(mesh.cut_facets), dtype=bool)
    if any(opened):
        corners = points[mesh.cut_facets]
        places = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
        off = [
            _distance(cut, places.reshape(-1, mesh.dimension)).reshape(places.shape[:2])
            for cut in scene.cuts
        ]
        nearest = np.max(off, axis=2).argmin(axis=0)
        keep = np.asarray(opened, dtype=bool)[nearest]
    return open_cut(points, mesh.parent[mesh.cells], mesh.cut_facets[keep])


def _distance(cut: object, points: Array) -> Array:
    """Distance (n,) of points to a cut, m; beside a disc or a sector only about it."""
    match cut:
        case PolylineCut():
            return distance_to_polyline(points, cut.vertices())
        case ArcCut():
            x, y = (points - np.asarray(cut.centre)).T
            return _from_arc(x, y, cut.radius, cut.start, cut.sweep)
        case PolygonCut():
            return _from_polygon(points, np.array(cut.points, dtype=float))
        case SweptCut():
            along = np.array(cut.along, dtype=float)
            quads = [
                np.stack([a, b, b + along, a + along])
                for a, b in pairwise(np.array(cut.points, dtype=float))
            ]
            return np.asarray(
                np.min([_from_polygon(points, quad) for quad in quads], axis=0), dtype=float
            )
        case DiscCut():
            *plane, height = cut.axes() @ (points - np.array(cut.centre)).T
            share = np.hypot(*(plane / np.array(cut.semi_axes)[:, None]))
            beyond = np.hypot(*plane) * (1.0 - 1.0 / np.maximum(share, 1.0))
            return np.asarray(np.hypot(height, beyond))
        case SphereCut():
            first, second, along = cut.axes() @ (points - np.array(cut.centre)).T
            across = np.hypot(first, second)
            return _from_arc(along, across, cut.radius, 0.0, cut.opening)
    assert isinstance(cut, CylinderCut)
    x, y, z = cut.axes() @ (points - np.array(cut.base)).T
    beyond = np.maximum(np.maximum(-z, z - cut.height), 0.0)
    return np.asarray(np.hypot(_from_arc(x, y, cut.radius, cut.start, cut.sweep), beyond))


def _from_arc(x: Array, y: Array, radius: float, start: float, sweep: float) -> Array:
    """Distance of points to an arc about the origin; angles in degrees."""
    angle = np.mod(np.rad2deg(np.arctan2(y, x)) - start, 360.0)
    beyond = np.maximum(angle - sweep, 0.0)
    beyond = np.deg2rad(np.minimum(beyond, 360.0 - angle)) * radius
    off: Array = np.hypot(np.hypot(x, y) - radius, np.where(angle > sweep, beyond, 0.0))
    return off


def _from_polygon(points: Array, corners: Array) -> Array:
    """Distance of points to a plane polygon (k, 3) in space."""
    origin = corners.mean(axis=0)
    axes = np.linalg.svd(corners - origin)[2]
    outline = (corners - origin) @ axes[:2].T
    *plane, height = axes @ (points - origin).T
    place = np.column_stack(plane)
    beyond = np.where(inside_polygon(place, outline), 0.0, distance_to_outline(place, outline))
    return np.asarray(np.hypot(height, beyond))
