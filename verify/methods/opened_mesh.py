"""A mesh that is already cut: nodes doubled, and a boundary without the faces of the cut."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.xfem.mesh import SimplexMesh

__all__ = ["OpenedMesh"]


class OpenedMesh(SimplexMesh):
    """A mesh whose nodes are doubled along a cut.

    Supports and loads on the boundary of the body must not act on the faces of the cut.
    """

    @cached_property
    def boundary_facets(self) -> NDArray[np.int64]:
        """(b, 2) pairs (cell, local node opposite) of facets that have no twin at their place."""
        facets = np.argwhere(self.neighbours < 0)
        _, place = np.unique(self.points, axis=0, return_inverse=True)
        on_facet = np.arange(self.dim + 1) != facets[:, 1:]
        corners = place.ravel()[self.cells[facets[:, 0]]][on_facet].reshape(len(facets), self.dim)
        _, which, count = np.unique(
            np.sort(corners, axis=1), axis=0, return_inverse=True, return_counts=True
        )
        return facets[count[which.ravel()] == 1]
