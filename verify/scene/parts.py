"""Parts of the boundary of a body, as a scene names them."""

import numpy as np
from numpy.typing import NDArray

from verify.geometry.nearest import feet
from verify.scene.geometry import Box, Geometry, Polygon, Rectangle
from verify.scene.regions import parse_region

_TOLERANCE = 1e-9  # of the body's size: a point closer than that to a part is on it


def on_part(
    geometry: Geometry, where: str, points: NDArray[np.float64], size: float
) -> NDArray[np.bool_]:
    """Tell which points (n, d) of the boundary lie on the part `where`, its ends included.

    `size` is that of the body, m: within 1e-9 of it a point is on a part; so the node at the end
    of ``x < 0.3`` is, whichever way it was rounded.
    """
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


def on_formula(
    where: str,
    points: NDArray[np.float64],
    away: NDArray[np.float64],
    size: float,
) -> NDArray[np.bool_]:
    """Tell which points (n, d) of facets lie on the part of an inequality, or 1e-9 beside them do.

    `away` (n, d, d) projects onto what is normal to the facet of each: there alone a part is met
    by points that are not on it, so that ``x < 0`` is a face.
    """
    region = parse_region(where, points.shape[1])
    found = region(points)
    for step in np.moveaxis(_TOLERANCE * size * away, 1, 0):
        found |= region(points + step) | region(points - step)
    return found


def on_named(
    geometry: Geometry, where: str, points: NDArray[np.float64], size: float
) -> NDArray[np.bool_]:
    """Tell which points (n, d) lie on the part of that name, of a body of a size, m."""
    return _on_named(geometry, where, points, _TOLERANCE * size)


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
            foot = feet(points, outline[edge], outline[(edge + 1) % len(outline)])
            found |= np.linalg.norm(points - foot, axis=1) <= tolerance
    return found
