"""Parts of the boundary of a mesh, as a scene names them."""

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene.geometry import Box, Polygon, Rectangle
from verify.scene.regions import parse_region
from verify.scene.scene import Scene

__all__ = ["on_part"]


def on_part(scene: Scene, where: str, points: NDArray[np.float64], key: str) -> NDArray[np.bool_]:
    """Tell which boundary points lie on the part `where`.

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
    if where == "boundary":
        return np.ones(len(points), dtype=bool)
    if where in scene.geometry.parts():
        found = _on_named(scene.geometry, where, points)
    else:
        found = parse_region(where, scene.dimension)(points)
    if not found.any():
        raise InputError(f"{key}: no node of the boundary lies in '{where}'", str(scene.file or ""))
    return found


def _on_named(geometry: object, where: str, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    tolerance = 1e-9 * float(np.ptp(points, axis=0).max())
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
