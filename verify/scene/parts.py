"""Parts of the boundary of a body, as a scene names them."""

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene.geometry import Box, Geometry, Polygon, Rectangle
from verify.scene.regions import parse_region
from verify.scene.scene import Scene

_TOLERANCE = 1e-9  # of the body's size: a point closer than that to a part is on it


def on_part(scene: Scene, where: str, points: NDArray[np.float64], key: str) -> NDArray[np.bool_]:
    """Tell which boundary points lie on the part `where`, its ends included.

    A point within 1e-9 of the body's size of a part is on it; so the node at the end of
    ``x < 0.3`` is, whichever way it was rounded.

    Parameters
    ----------
    scene : Scene
    where : str
        Name of a part, ``boundary``, or an inequality.
    points : (n, d) array
        Points of the boundary, m.
    key : str
        Key of the scene that names the part, for the message.

    Returns
    -------
    (n,) bool array

    Raises
    ------
    InputError
        If there is none.
    """
    size = float(np.ptp(points, axis=0).max(initial=0.0))
    found = _found(scene.geometry, where, points, size)
    if not found.any():
        raise InputError(f"{key}: no node of the boundary lies in '{where}'", str(scene.file or ""))
    return found


def copies_on_part(
    scene: Scene,
    where: str,
    points: NDArray[np.float64],
    beside: tuple[NDArray[np.int64], NDArray[np.float64]],
    key: str,
) -> NDArray[np.bool_]:
    """Tell which nodes of the boundary of a cut body lie on the part `where`, each on its own side.

    Where a cut comes out of the body, a place has a copy of its node for every side. A copy is on
    the part if the boundary of its own material beside it is, in the middle of a facet: so a part
    may end there, and the cut may come out beside that end by less than half a facet. Where no
    copy is on it so, the part is a mere point or line and holds those whose place is on it.

    Parameters
    ----------
    scene, where, key
        As of `on_part`.
    points : (n, d) array
        Places of the nodes, m, equal to the last bit for the copies of one.
    beside : (k,) int array and (k, d) array
        Facets of the boundary, or parts of such: a node of each, and its centroid, m.

    Raises
    ------
    InputError
        If there is none.
    """
    size = float(np.ptp(points, axis=0).max(initial=0.0))
    _, place, count = np.unique(points, axis=0, return_inverse=True, return_counts=True)
    place = place.ravel()
    copied = count[place] > 1
    node, centroid = beside[0][copied[beside[0]]], beside[1][copied[beside[0]]]
    own = np.zeros(len(points), dtype=bool)
    own[node[_found(scene.geometry, where, centroid, size)]] = True
    decided = np.zeros(len(count), dtype=bool)
    decided[place[own]] = True
    if decided.all():
        return own
    rest = ~decided[place]
    own[rest] = _found(scene.geometry, where, points[rest], size)
    if not own.any():
        return on_part(scene, where, points, key)  # which says so
    return own


def lie_on_part(
    scene: Scene, where: str, points: NDArray[np.float64], size: float
) -> NDArray[np.bool_]:
    """Tell which points (n, d) lie on the part `where`; it may be none.

    `size` is that of the body, m: within 1e-9 of it a point is on a part.
    """
    return _found(scene.geometry, where, points, size)


def on_edges(scene: Scene, where: str, corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which edges (k,) of a closed polyline `corners` (k, 2) lie on the part `where`.

    Each is judged by its middle: meant for an outline that has corners where parts end.
    """
    size = float(np.ptp(corners, axis=0).max())
    return _found(scene.geometry, where, 0.5 * (corners + np.roll(corners, -1, axis=0)), size)


def _found(
    geometry: Geometry, where: str, points: NDArray[np.float64], size: float
) -> NDArray[np.bool_]:
    if where == "boundary":
        return np.ones(len(points), dtype=bool)
    tolerance = _TOLERANCE * size
    if where in geometry.parts():
        return _on_named(geometry, where, points, tolerance)
    dimension = geometry.dimension
    region = parse_region(where, dimension)
    found = region(points)
    for step in tolerance * np.vstack([np.eye(dimension), -np.eye(dimension)]):
        found |= region(points + step)
    return found


def _on_named(
    geometry: Geometry, where: str, points: NDArray[np.float64], tolerance: float
) -> NDArray[np.bool_]:
    if isinstance(geometry, Box):
        axis = {"left": 0, "right": 0, "front": 1, "back": 1, "bottom": 2, "top": 2}[where]
        end = geometry.lower if where in ("left", "front", "bottom") else geometry.upper
        on_plane: NDArray[np.bool_] = np.abs(points[:, axis] - end[axis]) <= tolerance
        return on_plane
    assert isinstance(geometry, Rectangle | Polygon)
    outline = geometry.outline()
    found = np.zeros(len(points), dtype=bool)
    for edge, name in enumerate(geometry.parts()):  # a name may be given to several edges
        if name == where:
            start = outline[edge]
            along = outline[(edge + 1) % len(outline)] - start
            share = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
            found |= np.linalg.norm(points - start - share[:, None] * along, axis=1) <= tolerance
    return found
