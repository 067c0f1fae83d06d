"""A patch of skin over a plane: its outline, openings in it, and its height."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from verify.simulator.anatomy.plane_mesh import mesh_of_about
from verify.xfem.arrays import Floats, Ints


@dataclass(frozen=True)
class Patch:
    """Skin as a height over a plane.

    Attributes
    ----------
    outline : (k, 2) float array
        Outer border, m.
    height : callable
        z (n,) at points (n, 2), m.
    holes : list of (k, 2) float arrays
        Borders of openings, m.
    """

    outline: Floats
    height: Callable[[Floats], Floats]
    holes: list[Floats] = field(default_factory=list)

    def triangulate(self, triangles: int) -> tuple[Floats, Ints, int]:
        """Mesh the patch with about so many triangles.

        Returns
        -------
        points : (n, 3) float array
        triangles : (m, 3) int array
            Anticlockwise seen from outside the body.
        rim : int
            Number of points on the outer border, which are the first.
        """
        plane, cells, rim = mesh_of_about(self.outline, self.holes, triangles)
        return np.column_stack([plane, self.height(plane)]), cells, rim
