"""A scene on one mesh level as arrays: mesh, boundary, held nodes, loads.

Two meshes are offered. The *background* mesh ignores the cuts; it is the one that unfitted
methods cut through. The *conforming* mesh is the background mesh with the cuts imprinted and
opened (nodes doubled); any plain finite element program can solve on it.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from verify.compare.hooke import hooke
from verify.scene import Material, Scene, Support

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeldNodes:
    """Prescribed displacements; where two supports hold the same node, the later one wins.

    Attributes
    ----------
    nodes : (k,) int array
    components : tuple of int
        Indices of the components held.
    values : (k, len(components)) array
        m.
    across : list of (node, side point (d,), values)
        Background mesh only: for a node of a boundary facet that a cut crosses, the value of the
        prescribed field on the other side of the cut, continued to the node.
    ended : list of (nodes of a facet, corners (r, d, d) of simplices, m)
        Facets in which the part ends, and what of each lies on it: where a cut crosses one, a side
        is held if that lies on it.
    support : Support, optional
        What the scene says: its ``values(points, factor)`` are those of a factor in time.
    """

    nodes: NDArray[np.int64]
    components: tuple[int, ...]
    values: Array
    across: list[tuple[int, Array, Array]] = field(default_factory=list)
    ended: list[tuple[NDArray[np.int64], Array]] = field(default_factory=list)
    support: Support | None = None


@dataclass(frozen=True)
class Load:
    """A dead load on facets (Pa) or cells (N/m³).

    Attributes
    ----------
    simplices : (k, d) or (k, d + 1) int array
        Nodes of the facets or cells that are loaded; a facet in which the load ends is there once
        for each of the simplices that are loaded of it.
    uniform : (d,) array or None
        Its value, if it is the same everywhere.
    points, weights, values : (k, q, d), (k, q), (k, q, d) arrays
        Its values at quadrature points; the weights contain the measure.
    barycentric : (k, q, corners) array
        The quadrature points in each facet or cell.
    corners : (k, corners, d) array, optional
        Of what is loaded, m; None if that is all of each facet or cell.
    history : list of (time, factor), optional
        By what the load is multiplied in time; see `verify.scene.physics`.
    """

    simplices: NDArray[np.int64]
    uniform: Array | None
    points: Array
    weights: Array
    values: Array
    barycentric: Array
    history: list[tuple[float, float]] | None = None
    corners: Array | None = None


@dataclass(frozen=True)
class Problem:
    """A scene on one mesh level.

    Attributes
    ----------
    scene : Scene
    level : int
    size : float
        Element size h of the level, m.
    points : (n, d) array
        m; doubled on the cuts if `conforming`.
    cells : (m, d + 1) int array
    boundary : (b, d) int array
        Nodes of the facets on the outer boundary; the faces of a cut are not among them.
    conforming : bool
    cut_facets : (f, d, d) array
        Corners of the facets along the cuts, if `conforming`.
    held : list of HeldNodes
    loads : list of Load
    """

    scene: Scene
    level: int
    size: float
    points: Array
    cells: NDArray[np.int64]
    boundary: NDArray[np.int64]
    conforming: bool
    cut_facets: Array
    held: list[HeldNodes]
    loads: list[Load]

    def prescribed(self) -> tuple[NDArray[np.bool_], Array]:
        """Which components (n, d) of which nodes are held, and their values (n, d), m."""
        mark, value = np.zeros(self.points.shape, dtype=bool), np.zeros(self.points.shape)
        for support in self.held:
            at = np.ix_(support.nodes, support.components)
            mark[at], value[at] = True, support.values
        return mark, value

    def nodal_forces(self) -> Array:
        """Consistent forces (n, d) of all loads on linear elements, N (per metre in 2D)."""
        force = np.zeros(self.points.shape)
        for load in self.loads:
            shares = np.einsum("kq,kqi,kqc->kic", load.weights, load.barycentric, load.values)
            np.add.at(force, load.simplices, shares)
        return force

    def free_pieces(self) -> Array:
        """Centroids (k, d) of the pieces of the body that are held in too few components.

        A piece has 3 rigid motions in the plane and 6 in space; one that is held in fewer
        components has no static answer, and direct solvers do not always notice. On a background
        mesh the body is one piece, whatever the cuts.
        """
        m, corners = self.cells.shape
        cell = np.repeat(np.arange(m), corners)
        link = coo_array((np.ones(m * corners), (cell, self.cells.ravel())))
        _, node_piece = connected_components(link.T @ link, directed=False)
        held = np.bincount(node_piece, self.prescribed()[0].sum(axis=1))
        loose = np.flatnonzero(held < (3 if self.points.shape[1] == 2 else 6))
        cell_piece, middle = node_piece[self.cells[:, 0]], self.points[self.cells].mean(axis=1)
        return np.array([middle[cell_piece == k].mean(axis=0) for k in loose]).reshape(
            -1, self.points.shape[1]
        )

    def material_number(self) -> NDArray[np.int64]:
        """Return the number (m,) of each cell's material: 0, or 1 + that of a region."""
        return self.scene.material.number_at(self.points[self.cells].mean(axis=1))

    def lame(self) -> tuple[Any, Any]:
        """Lamé constants λ, μ in Pa; in plane stress the λ of the plane problem.

        Two numbers; where materials differ by region (m, 1) arrays, one row for each cell, which
        multiply what an element has at its quadrature points.
        """
        material = self.scene.material
        pairs = np.array([_lame(one) for one in material.each])
        if material.is_uniform:
            return float(pairs[0, 0]), float(pairs[0, 1])
        lam, mu = pairs[self.material_number()].T
        return lam[:, None], mu[:, None]

    def density(self) -> Any:
        """Density in kg/m³, NaN if there is none: a number, or (m, 1) like `lame`."""
        material = self.scene.material
        each = np.array([np.nan if one.density is None else one.density for one in material.each])
        return float(each[0]) if material.is_uniform else each[self.material_number()][:, None]


def _lame(material: Material) -> tuple[float, float]:
    law = hooke(material)
    return float(law.lame), float(law.shear)
