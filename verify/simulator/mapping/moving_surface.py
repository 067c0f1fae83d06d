"""A surface whose vertices move with the unknowns of a cut body: x = X + W u.

Every vertex belongs to one piece: its weights are its barycentric coordinates in the parent
element, its nodes the dof nodes of the piece (barycentric mapping, thesis 3.2.2). Forces go
back by the transpose, so that the virtual work of a force on the surface and of what the solver
gets is the same.
"""

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from verify.simulator.arrays.growing_array import GrowingArray
from verify.simulator.arrays.row_numbers import RowNumbers
from verify.xfem.arrays import Bools, Floats, Ints, check_floats
from verify.xfem.errors import XfemError


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
    """

    def __init__(self, corners: int, space: int, facet_corners: int) -> None:
        self.material = GrowingArray(np.empty((0, space)))
        self.nodes = GrowingArray(np.empty((0, corners), dtype=np.int64))
        self.weights = GrowingArray(np.empty((0, corners)))
        self.facets = GrowingArray(np.empty((0, facet_corners), dtype=np.int64))
        self.facet_piece = GrowingArray(np.empty(0, dtype=np.int64))
        self.inner = GrowingArray(np.empty(0, dtype=bool))
        self.retired: int = 0
        self._keys = RowNumbers()

    def add(
        self,
        point: Ints,
        material: Floats,
        weights: Floats,
        counts: Callable[[Ints], Bools],
        piece: Ints,
        inner: Bools,
        piece_cells: Ints,
        owner: Ints,
        bounds: Ints,
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
        counts : callable
            Whether corners (n,), counted through all facets, move with each node (n, c): where not,
            the weight is zero; where so, the weight may still round to zero.
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
        if len(point) == 0:
            return
        # one vertex for a point and the nodes from which it moves
        pairs = point.ravel() << 32 | piece.ravel()
        _, first, pair = np.unique(pairs, return_index=True, return_inverse=True)
        nodes = piece_cells[piece.ravel()[first]]
        moved = np.sort(np.where(counts(first), nodes, -1))
        vertex, new = self._keys.number(np.column_stack([point.ravel()[first], moved]))
        corner = first[new]
        begin = len(self.facets)
        self.material.append(material.reshape(point.size, -1)[corner])
        self.nodes.append(nodes[new])
        self.weights.append(weights.reshape(point.size, -1)[corner])
        self.facets.append(vertex[pair].reshape(point.shape))
        self.facet_piece.append(piece[:, 0])
        self.inner.append(inner)
        change = np.flatnonzero(np.diff(owner, prepend=-1))
        bounds[owner[change], 0] = begin + change
        bounds[owner[change], 1] = begin + np.append(change[1:], len(owner))

    def retire(self, facets: Ints) -> None:
        """Take facets out of use."""
        self.facets.rows[facets, 0] = -1
        self.retired += len(facets)

    @property
    def used(self) -> Ints:
        """Numbers of the facets in use."""
        return np.flatnonzero(self.facets.rows[:, 0] >= 0)

    def positions(self, displacement: Floats, out: Floats | None = None) -> Floats:
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
        found = self.material.rows + self._mapping @ displacement[: self._mapping.shape[1]]
        if out is None:
            return np.asarray(found)
        check_floats("positions", out, found.shape)
        out[:] = found
        return out

    def nodal_forces(self, forces: Floats, out: Floats) -> Floats:
        """Add forces (v, s) on the vertices to those on the dof nodes, `out` (N, s): Wᵀf.

        Raises
        ------
        XfemError
            If an array has another shape or type.
        """
        self._check(out)
        check_floats("forces", forces, self.material.rows.shape)
        out[: self._mapping.shape[1]] += self._mapping.T @ forces
        return out

    def facet_force(self, facet: int, at: Floats, force: Floats, out: Floats) -> Floats:
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
        shares = at[:, None] * self.weights.rows[vertices]
        np.add.at(out, self.nodes.rows[vertices], shares[:, :, None] * force)
        return out

    def _check(self, nodal: Floats) -> None:
        kind, space = getattr(nodal, "dtype", type(nodal).__name__), self.material.rows.shape[1]
        if kind != np.float64 or nodal.ndim != 2 or nodal.shape[1] != space:
            raise XfemError(
                f"nodal values of shape {np.shape(nodal)}, {kind}; expected (N, {space}), float64"
            )
        if len(nodal) < self._mapping.shape[1]:
            raise XfemError(
                f"{len(nodal)} nodal values; expected at least {self._mapping.shape[1]}"
            )

    @property
    def _mapping(self) -> csr_array:
        """W (v, N), with the dof nodes up to the last from which a vertex moves."""
        nodes = self.nodes.rows
        known: csr_array | None = getattr(self, "_known_mapping", None)
        if known is None or known.shape[0] != len(nodes):
            starts = np.arange(0, nodes.size + 1, nodes.shape[1])
            shape = (len(nodes), int(nodes.max(initial=-1)) + 1)
            known = csr_array((self.weights.rows.ravel(), nodes.ravel(), starts), shape)
            self._known_mapping = known
        return known
