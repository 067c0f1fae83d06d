"""Where the cuts of the sweep go: ever nearer to nodes of the mesh, or to each other."""

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from verify.xfem.cuts import Plane
from verify.xfem.mesh import SimplexMesh

__all__ = [
    "NEAR_NODES",
    "PLACEMENTS",
    "SMALL_FEATURES",
    "Placement",
    "placed_cuts",
    "row_height",
]

Placement = Literal[
    "along faces",
    "along edges",
    "through vertices",
    "two cuts apart",
    "crossing cuts",
    "corner cut off",
]
NEAR_NODES: tuple[Placement, ...] = ("along faces", "along edges", "through vertices")
# the cuts themselves have something as small as ε: a strip, a wedge or a corner
SMALL_FEATURES: tuple[Placement, ...] = ("two cuts apart", "crossing cuts", "corner cut off")
# in the plane, faces are edges
PLACEMENTS: dict[int, tuple[Placement, ...]] = {
    2: tuple(p for p in get_args(Placement) if p != "along edges"),
    3: get_args(Placement),
}

# in the plane without the second component; what contains which nodes for ε = 0
_LEVEL, _ALONG_EDGES, _ASKEW = (0.0, 0.0, 1.0), (-1 / 3, 0.0, 1.0), (-1 / 3, -1 / 5, 1.0)
_STEEP = (1.0, 1 / 7, 1 / 3)
_AWAY = (0.36, 0.48, 0.8)  # from the vertex to where the cuts cross: along neither of them
_STRIP = 0.25  # row heights above the nodes: where the lower one of two cuts runs
_Floats = NDArray[np.float64]


def row_height(dimension: int) -> float:
    """Height of a row of elements across the cut: the unit of ε, in m."""
    return 1.0 / (8.0 if dimension == 2 else 4.0)


def placed_cuts(mesh: SimplexMesh, placement: Placement, size: float) -> tuple[Plane, ...]:
    """Cuts of a unit square or cube at a distance of `size` elements from a degenerate place.

    Raises
    ------
    ValueError
        If there is no such placement.
    """
    if placement not in PLACEMENTS[mesh.dim]:
        expected = ", ".join(PLACEMENTS[mesh.dim])
        raise ValueError(f"cut '{placement}' in {mesh.dim}D; expected one of {expected}")
    kept = [0, -1] if mesh.dim == 2 else [0, 1, 2]
    step = size * row_height(mesh.dim)
    up, corner = np.eye(mesh.dim)[-1], np.full(mesh.dim, 0.5)

    def normal(components: tuple[float, float, float]) -> _Floats:
        return np.array(components)[kept]

    if placement == "along faces":
        return (Plane(corner + step * up, normal(_LEVEL)),)
    if placement == "two cuts apart":
        low = corner + _STRIP * row_height(mesh.dim) * up
        return Plane(low, normal(_LEVEL)), Plane(low + step * up, normal(_LEVEL))
    if placement == "corner cut off":
        # as far along every edge of the body
        return (Plane(step * up, np.ones(mesh.dim)),)
    # the node nearest to the middle, whatever the number of divisions
    corner = mesh.points[np.linalg.norm(mesh.points - corner, axis=1).argmin()]
    if placement == "crossing cuts":
        away = normal(_AWAY)
        crossing = corner + step * away / np.linalg.norm(away)
        return Plane(crossing, normal(_ASKEW)), Plane(crossing, normal(_STEEP))
    along = _ALONG_EDGES if placement == "along edges" else _ASKEW
    return (Plane(corner + step * up, normal(along)),)
