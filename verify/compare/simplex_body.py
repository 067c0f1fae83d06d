"""Simplices in space with cuts that end somewhere: the base of solids and membranes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.facet_kernels import distance_to_segments
from verify.compare.splitting import measures
from verify.geometry.patches import Patch

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SimplexBody:
    """Tetrahedra, or triangles in space, with cuts.

    Parameters
    ----------
    corners : (m, k + 1, 3) array
        Simplices that make up the body.
    cuts : mapping of str to sequence of Patch
        The cuts as asked, not trimmed.
    front : (f, 2, 3) array
        Where cuts end inside the body, as segments: of a membrane, tips, without length.
    box : (2, 3) array, optional
        Lower and upper corner, if it is a box.
    """

    corners: Array
    cuts: Mapping[str, Sequence[Patch]]
    front: Array
    box: Array | None = None
    dimension = 3

    @property
    def cell_dimension(self) -> int:
        """Dimension k of the simplices: 3 of a solid, 2 of a membrane."""
        return self.corners.shape[1] - 1

    @property
    def measure(self) -> float:
        """Volume, m³, or area, m²."""
        return float(measures(self.corners).sum())

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.corners.reshape(-1, 3), axis=0)))

    @property
    def patches(self) -> list[Patch]:
        """Patches of all cuts."""
        return [patch for patches in self.cuts.values() for patch in patches]

    @property
    def has_cuts(self) -> bool:
        """Whether anything is cut."""
        return bool(self.cuts)

    def tip_distance(self, points: Array) -> Array:
        """Distance (n,) of points (n, 3) to the nearest front; infinite without one."""
        return distance_to_segments(points, self.front)

    def frames_at(self, points: Array) -> Array | None:
        """Two tangents and the normal (n, 3, 3) of a surface at points (n, 3); a solid has none."""
        return None
