"""Boundary of a mesh of a scene: its facets, and which of them lie on a named part."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import Scene
from verify.scene.parts import HeldFacets, Pieces, held_nodes, pieces_on_part

_Ints = NDArray[np.int64]
_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Boundary:
    """Facets on the boundary of a body, of any mesh of simplices.

    Attributes
    ----------
    points : (n, d) array
        Nodes of the mesh, m.
    cells : (m, k + 1) int array
        Of k = d dimensions, or of a membrane k = d − 1.
    facets : (b, 2) int array
        Cell and opposite local node of each facet.
    """

    points: _Floats
    cells: _Ints
    facets: _Ints

    @cached_property
    def corners(self) -> _Ints:
        """Nodes (b, k) of each facet."""
        cell, opposite = self.facets.T
        on_facet = np.ones((len(cell), self.cells.shape[1]), dtype=bool)
        on_facet[np.arange(len(cell)), opposite] = False
        corners: _Ints = self.cells[cell][on_facet].reshape(len(cell), -1)
        return corners

    @cached_property
    def nodes(self) -> _Ints:
        """Nodes of the boundary, ascending."""
        return np.unique(self.corners)

    @cached_property
    def places(self) -> _Floats:
        """Corners (b, k, d) of each facet, m."""
        places: _Floats = self.points[self.corners]
        return places

    def loaded(self, scene: Scene, where: str, key: str) -> Pieces:
        """Pieces of the facets that lie on the part `where` of a scene, on which a load acts.

        Raises
        ------
        InputError
            If there is none; `key` is the key of the scene that names the part.
        """
        pieces = pieces_on_part(scene.geometry, where, self.places)
        if not len(pieces.facet):
            raise no_facet(scene, where, key)
        return pieces

    def held(self, scene: Scene, where: str, key: str) -> tuple[_Ints, HeldFacets]:
        """Nodes (h,) that a support on the part `where` holds, ascending, and by which facets.

        Raises
        ------
        InputError
            If there is none.
        """
        facets = np.searchsorted(self.nodes, self.corners), self.places
        found, by = held_nodes(scene, where, self.points[self.nodes], facets, key)
        return self.nodes[found], by

    def outward_normals(self, chosen: _Ints) -> _Floats:
        """Return the unit normals (q, d) of some facets (q,); of a membrane's edge in its plane."""
        corners, (cell, opposite) = self.points[self.corners[chosen]], self.facets[chosen].T
        outward = corners[:, 0] - self.points[self.cells[cell, opposite]]
        edges = corners[:, 1:] - corners[:, :1]
        if self.points.shape[1] == 2:
            normals = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
        elif self.cells.shape[1] == 4:
            normals = np.cross(edges[:, 0], edges[:, 1])
        else:
            normals = np.cross(edges[:, 0], np.cross(edges[:, 0], outward))
        normals *= np.sign(np.einsum("qc,qc->q", normals, outward))[:, None]
        unit: _Floats = normals / np.linalg.norm(normals, axis=1)[:, None]
        return unit


def no_facet(scene: Scene, where: str, key: str) -> InputError:
    """Error of a load on a part of no area."""
    return InputError(f"{key}: no boundary facet lies in '{where}'", str(scene.file or ""))
