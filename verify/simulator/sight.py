"""First point of a simulated body on a line of sight."""

import numpy as np

from verify.simulator.surfaces import Picture
from verify.xfem.arrays import Floats


def place_in_sight(picture: Picture, eye: Floats, towards: Floats) -> Floats | None:
    """Find where a line of sight meets the skin first.

    Parameters
    ----------
    picture : Picture
    eye : (3,) float array
        m; what lies behind it is not seen.
    towards : (3,) float array

    Returns
    -------
    (3,) float array or None
        The place in the uncut body, m; None where only the faces of cuts, or nothing, are met.

    Notes
    -----
    Intersection of a line with triangles by Möller and Trumbore, J. Graphics Tools 2 (1997) 21.
    """
    a, b, c = (picture.points[picture.triangles[:, k]] for k in range(3))
    across = np.cross(towards, c - a)
    volume = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", eye - a, across) / volume
        normal = np.cross(eye - a, b - a)
        v = normal @ towards / volume
        distance = np.einsum("ij,ij->i", c - a, normal) / volume
        met = np.flatnonzero((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance >= 0.0))
    if len(met) == 0:
        return None
    first = met[np.argmin(distance[met])]
    if picture.inner[first]:
        return None
    weights = np.array([1.0 - u[first] - v[first], u[first], v[first]])
    return np.asarray(weights @ picture.material[picture.triangles[first]])
