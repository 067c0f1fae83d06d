"""Boundary of a mesh of a scene: its facets, and which of them lie on a named part."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import Scene
from verify.scene.parts import on_part

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

    def facets_on(self, scene: Scene, where: str, key: str) -> _Ints:
        """Numbers of the facets whose nodes all lie on the part `where` of a scene.

        Raises
        ------
        InputError
            If there is none; `key` is the key of the scene that names the part.
        """
        mark = np.zeros(len(self.points), dtype=bool)
        mark[self.nodes[on_part(scene, where, self.points[self.nodes], key)]] = True
        chosen = np.flatnonzero(mark[self.corners].all(axis=1))
        if not len(chosen):
            raise InputError(f"{key}: no boundary facet lies in '{where}'", str(scene.file or ""))
        return chosen

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
