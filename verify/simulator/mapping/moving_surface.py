"""A surface whose vertices move with the unknowns of a cut body: x = X + W u.

Every vertex belongs to one piece: its weights are its barycentric coordinates in the parent
element, its nodes the dof nodes of the piece (barycentric mapping, thesis 3.2.2). Forces go
back by the transpose, so that the virtual work of a force on the surface and of what the solver
gets is the same.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.simulator.arrays.growing_array import GrowingArray
from verify.simulator.arrays.row_numbers import RowNumbers, number_of_row
from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import check_floats

__all__ = ["MovingSurface"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class MovingSurface:
    """Facets (segments in 2D, triangles in 3D) that come and go, and vertices that only come.

    Parameters
    ----------
    corners : int
        Corners of an element: the length of a vertex's row of weights.
    space : int
        Dimension of the points.

    Attributes
    ----------
    material : GrowingArray
        (v, s) positions X of the vertices in the material frame, in metres.
    nodes, weights : GrowingArray
        (v, corners) dof nodes and weights of each vertex: the rows of W.
    facets : GrowingArray
        (f, k) vertices; the first is -1 where a facet is no longer in use.
    facet_piece : GrowingArray
        (f,) piece on whose surface it lies.
    inner : GrowingArray
        (f,) whether it lies on a cut.
    retired : int
        How many facets have been taken out of use.
    in_order : bool
        Whether neighbours among the facets in use are near each other: not always.
    """

    in_order = False

    def __init__(self, corners: int, space: int, facet_corners: int) -> None:
        self.material = GrowingArray(np.empty((0, space)))
        self.nodes = GrowingArray(np.empty((0, corners), dtype=np.int64))
        self.weights = GrowingArray(np.empty((0, corners)))
        self.facets = GrowingArray(np.empty((0, facet_corners), dtype=np.int64))
        self.facet_piece = GrowingArray(np.empty(0, dtype=np.int64))
        self.inner = GrowingArray(np.empty(0, dtype=bool))
        self.retired: int = 0
        self._keys = RowNumbers(corners + 1)

    def add(
        self,
        point: _Ints,
        material: _Floats,
        weights: _Floats,
        counts: NDArray[np.bool_],
        piece: _Ints,
        inner: NDArray[np.bool_],
        piece_cells: _Ints,
        owner: _Ints,
        bounds: _Ints,
    ) -> None:
        """Append facets, and a vertex for each point and set of unknowns from which it moves.

        Parameters
        ----------
        point : (q, k) int array
            Number of the material point of each corner.
        material : (q, k, s) float array
            Where it is, in metres.
        weights : (q, k, c) float array
            Of the dof nodes of its piece.
        counts : (q, k, c) bool array
            Whether a corner moves with a node: where it is not, the weight is zero; where it is,
            the weight may still round to zero.
        piece : (q, k) int array
            Piece of each corner; that of the first is the facet's.
        inner : (q,) bool array
        piece_cells : (p, c) int array
            Dof nodes of each piece.
        owner : (q,) int array
            To what each facet belongs; facets of one owner come one after the other.
        bounds : (o, 2) int array
            First facet of each owner and one past the last; written.
        """
        corners = point.size
        table, known, before = self._keys.open_for(corners)
        stores = (self.material, self.nodes, self.weights)
        for store in stores:
            store.extend(corners)
        begin = self.facets.extend(len(point))
        self.facet_piece.extend(len(point))
        self.inner.extend(len(point))
        self.facet_piece.rows[begin:] = piece[:, 0]
        self.inner.rows[begin:] = inner
        count = _add(
            point, material, weights, counts, piece, piece_cells, owner, table, known, before,
            begin, self.material.rows, self.nodes.rows, self.weights.rows, self.facets.rows, bounds,
        )  # fmt: skip
        self._keys.close(count)
        for store in stores:
            store.rows = store.rows[:count]

    def retire(self, facets: _Ints) -> None:
        """Take facets out of use."""
        self.facets.rows[facets, 0] = -1
        self.retired += len(facets)

    @property
    def used(self) -> _Ints:
        """Numbers of the facets in use."""
        return np.flatnonzero(self.facets.rows[:, 0] >= 0)

    def positions(self, displacement: _Floats, out: _Floats | None = None) -> _Floats:
        """Positions (v, s) of the vertices for a displacement (N, s) of the dof nodes.

        Parameters
        ----------
        displacement : (N, s) float array
            In metres.
        out : (v, s) float array, optional
            Written instead of a new array: a step then allocates nothing.

        Raises
        ------
        XfemError
            If `displacement` has fewer rows than there are dof nodes, or an array another shape
            or type.
        """
        self._check(displacement)
        if out is None:
            out = np.empty_like(self.material.rows)
        check_floats("positions", out, self.material.rows.shape)
        _interpolate(self.material.rows, self.nodes.rows, self.weights.rows, displacement, out)
        return out

    def nodal_forces(self, forces: _Floats, out: _Floats) -> _Floats:
        """Add forces (v, s) on the vertices to those on the dof nodes, `out` (N, s): Wᵀf.

        Raises
        ------
        XfemError
            If an array has another shape or type.
        """
        self._check(out)
        check_floats("forces", forces, self.material.rows.shape)
        _spread(self.nodes.rows, self.weights.rows, forces, out)
        return out

    def facet_force(self, facet: int, at: _Floats, force: _Floats, out: _Floats) -> _Floats:
        """Add a force at a point of a facet to the forces on the dof nodes.

        Parameters
        ----------
        facet : int
        at : (k,) float array
            Barycentric coordinates of the point in the facet.
        force : (s,) float array
            In newtons.
        out : (N, s) float array

        Raises
        ------
        XfemError
            If there is no such facet (a contact that is none has the number -1), or a shape is
            wrong.
        """
        self._check(out)
        if not 0 <= facet < len(self.facets.rows):
            raise XfemError(f"facet {facet}; expected one of 0..{len(self.facets.rows) - 1}")
        vertices = self.facets.rows[facet]
        if vertices[0] < 0:
            raise XfemError(f"facet {facet} is no longer in use")
        if np.shape(at) != vertices.shape or np.shape(force) != out.shape[1:]:
            raise XfemError(
                f"force of shape {np.shape(force)} at a place of shape {np.shape(at)}; expected "
                f"{out.shape[1:]} and {vertices.shape}"
            )
        at, force = np.asarray(at, dtype=float), np.asarray(force, dtype=float)
        _spread(self.nodes.rows[vertices], self.weights.rows[vertices], at[:, None] * force, out)
        return out

    def _check(self, nodal: _Floats) -> None:
        kind, space = getattr(nodal, "dtype", type(nodal).__name__), self.material.rows.shape[1]
        if kind != np.float64 or nodal.ndim != 2 or nodal.shape[1] != space:
            raise XfemError(
                f"nodal values of shape {np.shape(nodal)}, {kind}; expected (N, {space}), float64"
            )
        if len(self.nodes) and len(nodal) <= self._largest_node():
            raise XfemError(
                f"{len(nodal)} nodal values; expected at least {self._largest_node() + 1}"
            )

    def _largest_node(self) -> int:
        seen = getattr(self, "_largest", (0, -1))
        if seen[0] < len(self.nodes):
            seen = (len(self.nodes), max(seen[1], int(self.nodes.rows[seen[0] :].max())))
            self._largest = seen
        return seen[1]


@njit(cache=True)
def _add(
    point, material, weights, counts, piece, piece_cells, owner, table, known, count,
    begin, places, nodes, shares, facets, bounds,
):  # fmt: skip
    """Write facets, new vertices and the facets of each owner; the count of vertices."""
    size = nodes.shape[1]
    key = np.empty(size + 1, dtype=np.int64)
    for f in range(len(point)):
        if f == 0 or owner[f] != owner[f - 1]:
            bounds[owner[f], 0] = begin + f
        bounds[owner[f], 1] = begin + f + 1
        for c in range(point.shape[1]):
            key[0] = point[f, c]
            for a in range(size):
                node, k = piece_cells[piece[f, c], a] if counts[f, c, a] else -1, a
                while k > 0 and key[k] > node:
                    key[k + 1] = key[k]
                    k -= 1
                key[k + 1] = node
            before = count
            vertex, count = number_of_row(key, table, known, count)
            facets[begin + f, c] = vertex
            if count > before:
                for i in range(places.shape[1]):
                    places[vertex, i] = material[f, c, i]
                for a in range(size):
                    nodes[vertex, a] = piece_cells[piece[f, c], a]
                    shares[vertex, a] = weights[f, c, a]
    return count


@njit(cache=True)
def _interpolate(material, nodes, weights, displacement, out):
    for v in range(len(nodes)):
        for i in range(material.shape[1]):
            total = material[v, i]
            for k in range(nodes.shape[1]):
                total += weights[v, k] * displacement[nodes[v, k], i]
            out[v, i] = total


@njit(cache=True)
def _spread(nodes, weights, forces, out):
    for v in range(len(nodes)):
        for k in range(nodes.shape[1]):
            for i in range(forces.shape[1]):
                out[nodes[v, k], i] += weights[v, k] * forces[v, i]
