"""Cuts that open one after the other on one mesh that conforms to all of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reference.meshing import ConformingMesh, open_cut
from verify.errors import UnsupportedSceneError
from verify.scene import ArcCut, PolylineCut, Scene
from verify.scene.planar import distance_to_polyline

__all__ = ["partly_opened"]

Array = NDArray[np.float64]
_ON = 1e-9  # of the size of the body: nodes that close to a cut are on it


def partly_opened(scene: Scene, mesh: ConformingMesh, opened: Sequence[bool]) -> ConformingMesh:
    """Give a mesh with all cuts open again, with some of them open only; cells stay in order.

    Parameters
    ----------
    scene : Scene
    mesh : ConformingMesh
    opened : sequence of bool
        Whether each cut of the scene is open. A facet on several cuts is if one of them is.

    Raises
    ------
    UnsupportedSceneError
        If cuts in space do not open at the same time.
    """
    if all(opened):
        return mesh
    parents = int(mesh.parent.max()) + 1
    points = np.empty((parents, mesh.dimension))
    points[mesh.parent] = mesh.points
    keep = np.zeros(len(mesh.cut_facets), dtype=bool)
    if any(opened):
        if mesh.dimension != 2:
            raise UnsupportedSceneError(
                "cuts in space that open one after the other are not offered by the reference yet"
            )
        tolerance = _ON * float(np.ptp(points, axis=0).max())
        for cut, is_open in zip(scene.cuts, opened, strict=True):
            if is_open:
                off = _distance(cut, points)
                keep |= (off[mesh.cut_facets] <= tolerance).all(axis=1)
    return open_cut(points, mesh.parent[mesh.cells], mesh.cut_facets[keep])


def _distance(cut: object, points: Array) -> Array:
    """Distance (n,) of points to a plane cut, m."""
    if isinstance(cut, PolylineCut):
        return distance_to_polyline(points, cut.vertices())
    assert isinstance(cut, ArcCut)
    x, y = (points - np.asarray(cut.centre)).T
    angle = np.mod(np.rad2deg(np.arctan2(y, x)) - cut.start, 360.0)
    beyond = np.maximum(angle - cut.sweep, 0.0)
    beyond = np.deg2rad(np.minimum(beyond, 360.0 - angle)) * cut.radius
    off: Array = np.hypot(np.hypot(x, y) - cut.radius, np.where(angle > cut.sweep, beyond, 0.0))
    return off
