"""The cut body as a mesh of pieces of cells: standard finite elements with a weight.

Every piece of a cell becomes a whole cell of its own (phantom nodes; Hansbo & Hansbo 2004) whose
stiffness, mass and load count by the piece's share of the volume. The space is the one of the
shifted Heaviside enrichment (2.48), in side-wise unknowns. Force, mass and solvers need not know of
cuts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy.sparse import csr_array

from verify.xfem.arrays import Bools, Floats, Ints, Sides
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut
from verify.xfem.join import join_parts, node_sides, number_nodes, piece_sides
from verify.xfem.mesh import SimplexMesh, connected
from verify.xfem.pieces import split_cells
from verify.xfem.zero_points import ZeroPoints


@dataclass(frozen=True)
class SubCells:
    """Sub-simplices of the split cells.

    Attributes
    ----------
    piece : (k,) int array
        Piece to which each belongs.
    points : (k, d + 1) int array
        Numbers of the vertices; equal numbers are equal points, mesh nodes keep theirs.
    barycentric : (k, d + 1, d + 1) float array
        Barycentric coordinates of the vertices (second axis) in the parent cell.
    fraction : (k,) float array
        Share in the volume of the parent cell, positive.
    zero_points : ZeroPoints
        Positions of all numbered points, and the edges on which the new ones lie.
    """

    piece: Ints
    points: Ints
    barycentric: Floats
    fraction: Floats
    zero_points: ZeroPoints


class Constraint(Protocol):
    """Corners of a cut mesh that follow dof nodes, u = C û; see `verify.xfem.aggregation`.

    Attributes
    ----------
    corners : PhantomMesh
        The same body with a dof node for each corner.
    extension : (N_corners, N) csr_array
        C: corner values from values at the dof nodes; it reproduces linear fields.
    restriction : (N, N_corners) csr_array
        Cᵀ.
    node : (N_corners,) int array
        Dof node of each corner; −1 for one that follows others.
    """

    @property
    def corners(self) -> "PhantomMesh": ...  # noqa: D102
    @property
    def extension(self) -> csr_array: ...  # noqa: D102
    @property
    def restriction(self) -> csr_array: ...  # noqa: D102
    @property
    def node(self) -> Ints: ...  # noqa: D102

    def pattern(self, couplings: Ints) -> Any:
        """Make the sparsity of CᵀKC, with further couplings (k, 2) of dof nodes."""
        ...

    def mass(self, of_corners: Any) -> Any:
        """Make the mass CᵀMC of the dof nodes from the mass M of the corners."""
        ...


@dataclass(frozen=True)
class PhantomMesh:
    """A cut mesh.

    With cell aggregation (`verify.xfem.aggregation`) some corners of the pieces have no unknown of
    their own but follow others. `cells` counts corners; all arrays of N rows count dof nodes, and
    `cells` must not index them. `extend` and `restrict` lead from one to the other. `corners` is
    the mesh before aggregation, where both are the same.

    Attributes
    ----------
    mesh : SimplexMesh
        The mesh before the cut.
    cells : (p, d + 1) int array
        Corners of each piece, ordered by parent: dof nodes if nothing is aggregated.
    parent : (p,) int array
        Cell of the uncut mesh.
    fraction : (p,) float array
        V_piece / V_parent, in (0, 1].
    label : (p, cuts) int8 array
        Side of each cut that splits the parent; 0 where the cut does not split it.
    node_parent : (N,) int array
        Node of the uncut mesh. The first n dof nodes are the nodes of the mesh, each with the
        material in which it lies. If that is of round-off size, it has other material around it.
        Further ones are phantom nodes.
    level_sets : (n, cuts) float array
        Nodal level set of each cut as used: snapped to zero within round-off, in metres.
    sub_cells : SubCells
        Sub-simplices of the split cells.
    snapped : int
        Nodal level-set values within round-off taken as exactly zero.
    dropped : int
        Pieces of round-off size, left out: the piece beside them has the share of at most 2⁻⁵² of
        the cell that each may have.
    aggregation : Constraint, optional
        Corners that follow the dof nodes of a root cell.
    kept_side : (N, cuts) int8 array, optional
        Sides that dof nodes keep where the cut has moved past them; without it `node_side` follows
        from the pieces.
    """

    mesh: SimplexMesh
    cells: Ints
    parent: Ints
    fraction: Floats
    label: Sides
    node_parent: Ints
    level_sets: Floats
    sub_cells: SubCells
    snapped: int
    dropped: int
    aggregation: Constraint | None = None
    kept_side: Sides | None = None

    @property
    def node_count(self) -> int:
        """Number of dof nodes."""
        return len(self.node_parent)

    @property
    def corners(self) -> "PhantomMesh":
        """The same body with a dof node for each corner; itself if nothing is aggregated."""
        return self if self.aggregation is None else self.aggregation.corners

    @cached_property
    def corner_node(self) -> Ints:
        """(N_corners,) the dof node of each corner; −1 for those that have none."""
        if self.aggregation is None:
            return np.arange(self.node_count)
        return self.aggregation.node

    @cached_property
    def node_corner(self) -> Ints:
        """(N,) the corner that each dof node is."""
        own = np.flatnonzero(self.corner_node >= 0)
        corner = np.empty(self.node_count, dtype=np.int64)
        corner[self.corner_node[own]] = own
        return corner

    def extend(self, values: Floats) -> Floats:
        """Return corner values (N_corners, d) of nodal values (N, d)."""
        return values if self.aggregation is None else self.aggregation.extension @ values

    def restrict(self, forces: Floats) -> Floats:
        """Return nodal forces (N, d) that do the same work as forces at corners (N_corners, d)."""
        return forces if self.aggregation is None else self.aggregation.restriction @ forces

    @cached_property
    def node_points(self) -> Floats:
        """(N, space) material position of the dof nodes, in metres."""
        return self.mesh.points[self.node_parent]

    @cached_property
    def split(self) -> Bools:
        """(p,) whether a piece is described by sub-simplices: it is not just its whole cell."""
        return np.bincount(self.sub_cells.piece, minlength=len(self.cells)) > 0

    @cached_property
    def part(self) -> Ints:
        """(p,) first of the pieces of a cell that have all unknowns in common: together one part.

        Where cuts end on one another they leave pieces that none keeps apart. So does a cut that
        goes through one cell only: its sides are joined all around.
        """
        part = np.arange(len(self.cells))
        rows = np.flatnonzero(self.split)
        keys = np.concatenate([self.parent[rows, None], self.cells[rows]], axis=1)
        _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        part[rows] = rows[first[number.ravel()]]
        return part

    @cached_property
    def part_fraction(self) -> Floats:
        """(p,) share of the part of each piece in the volume of its cell."""
        total = np.bincount(self.part, self.fraction, minlength=len(self.part))
        return np.asarray(total[self.part])

    @cached_property
    def piece_side(self) -> Sides:
        """(p, cuts) side of each cut on which a piece lies, whether split by it or not."""
        weights = np.ones(self.cells.shape)
        weights[self.split] = self.shape_integrals[self.split]
        return piece_sides(self.level_sets, self.mesh.cells[self.parent], self.label, weights)

    @cached_property
    def node_side(self) -> Sides:
        """(N, cuts) side of each cut on which the material of a dof node lies."""
        if self.aggregation is not None:
            return self.corners.node_side[self.node_corner]
        if self.kept_side is not None:
            return self.kept_side
        share = np.where(self.split, self.fraction, 0.0)
        return node_sides(
            self.level_sets, self.node_parent, self.cells, self.label, self.piece_side, share
        )

    @cached_property
    def volumes(self) -> Floats:
        """(p,) volume of each piece, in m^d."""
        return self.fraction * self.mesh.measures[self.parent]

    @cached_property
    def enriched_nodes(self) -> Ints:
        """Nodes of the uncut mesh that have more than one dof node."""
        return np.flatnonzero(np.bincount(self.node_parent) > 1)

    @cached_property
    def shape_integrals(self) -> Floats:
        """(p, d + 1) exact integrals of the shape functions over the pieces, in m^d."""
        # ∫ N_i dV = V Σ_s f_s λ̄_i(s): share and mean barycentric coordinates of sub-simplex s
        corners = self.cells.shape[1]
        integrals = np.repeat(self.volumes[:, None] / corners, corners, axis=1)
        integrals[self.split] = 0.0
        sub = self.sub_cells
        share = sub.fraction[:, None] * sub.barycentric.mean(axis=1)
        share *= self.mesh.measures[self.parent[sub.piece], None]
        for column, values in zip(integrals.T, share.T, strict=True):
            column += np.bincount(sub.piece, values, len(column))
        return integrals

    @cached_property
    def piece_centroids(self) -> Floats:
        """(p, space) centroid of each piece, in metres."""
        # x̄ = Σ_i x_i ∫ N_i dV / V
        weights = self.shape_integrals / self.volumes[:, None]
        return np.einsum("pi,pij->pj", weights, self.mesh.points[self.mesh.cells[self.parent]])

    @cached_property
    def node_piece_points(self) -> Floats:
        """(N, space) a point inside the material of each unknown: centroid of its largest piece."""
        if self.aggregation is not None:
            return self.corners.node_piece_points[self.node_corner]
        corners = self.cells.shape[1]
        flat, piece = self.cells.ravel(), np.repeat(np.arange(len(self.cells)), corners)
        order = np.lexsort([self.volumes[piece], flat])
        last = np.flatnonzero(np.diff(flat[order], append=-1))
        return self.piece_centroids[piece[order[last]]]

    @cached_property
    def solid_simplices(self) -> tuple[Ints, Floats, Floats]:
        """The material as simplices: piece (q,), barycentric corners (q, d + 1, d + 1), share.

        Whole cells and the sub-simplices of split ones; what integrals over the body run over.
        """
        whole = np.flatnonzero(~self.split)
        corners = self.cells.shape[1]
        sub = self.sub_cells
        eye = np.broadcast_to(np.eye(corners), (len(whole), corners, corners))
        return (
            np.concatenate([whole, sub.piece]),
            np.concatenate([eye, sub.barycentric]),
            np.concatenate([np.ones(len(whole)), sub.fraction]),
        )

    @cached_property
    def bodies(self) -> Ints:
        """(N,) number of the free body to which each dof node belongs."""
        if self.aggregation is not None:
            return self.corners.bodies[self.node_corner]
        first, others = self.cells[:, :1], self.cells[:, 1:]
        row = np.broadcast_to(first, others.shape).ravel()
        return connected(self.node_count, row, others.ravel())


def cut_mesh(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "inside",
    opened: Bools | None = None,
) -> PhantomMesh:
    """Cut a mesh.

    Parameters
    ----------
    mesh : SimplexMesh
        The uncut mesh, in the material frame.
    cuts : sequence of Cut
        In any order; they may cross, branch, touch and run through nodes or along faces.
    tip : {"inside", "extended", "through", "nearest"}
        Treatment of elements in which a cut ends; see `verify.xfem.pieces.split_cells`.
    opened : (m, cuts) bool array, optional
        Cells that each cut has opened; the others are as whole as if it did not meet them.

    Raises
    ------
    XfemError
        If the cuts are no sequence, one is in another space than the mesh, or the tip rule is
        unknown. If a level set is not finite, a depth is NaN, or `opened` has a wrong shape.

    Notes
    -----
    A branch ends on the *realised* cut from which it leaves, which for a curved cut is off the
    given one by O(h²). It goes on to there over elements in which the given stem lies in between.

    Examples
    --------
    Eight of 32 triangles are cut, and each of ten nodes has a second unknown:

    >>> import verify.xfem as xfem
    >>> mesh = xfem.rectangle_mesh((4, 4))
    >>> phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.6, 0.0], [1.0, 0.0])])
    >>> len(phantom.cells), phantom.node_count - len(mesh.points)
    (40, 10)
    """
    partition = split_cells(mesh, cuts, tip, opened=opened)
    solid = partition.solid
    joined = join_parts(mesh, partition, solid)
    node_parent, numbering = number_nodes(mesh, partition, joined, solid)

    # two numberings of pieces: `joined` has the pieces of the partition, then the whole cells of
    # the patch; the result has its solid pieces and the rest of the cells, ordered by cell
    rows = np.flatnonzero(np.pad(solid, (0, len(joined.group) - len(solid)), constant_values=True))
    rows = rows[np.argsort(joined.piece_cell[rows], kind="stable")]
    count = np.ones(len(mesh.cells), dtype=np.int64)
    count[joined.cells] = np.bincount(joined.piece_cell[rows], minlength=len(joined.cells))
    parent = np.repeat(np.arange(len(mesh.cells)), count)
    in_patch = np.zeros(len(mesh.cells), dtype=bool)
    in_patch[joined.cells] = True
    number = np.full(len(joined.group), -1)
    number[rows] = np.flatnonzero(in_patch[parent])
    cells = mesh.cells[parent]
    cells[number[rows]] = numbering[joined.group[rows]]
    label, share = np.zeros((len(parent), len(cuts)), dtype=np.int8), np.ones(len(parent))
    split = number[: len(solid)][solid]
    label[split], share[split] = partition.label[solid], partition.fraction[solid]
    sub = partition.simplices
    return PhantomMesh(
        mesh=mesh,
        cells=cells,
        parent=parent,
        fraction=share,
        label=label,
        node_parent=node_parent,
        level_sets=partition.points.values[: len(mesh.points)],
        sub_cells=SubCells(
            number[sub.piece], sub.points, sub.barycentric, sub.fraction, partition.points
        ),
        snapped=partition.snapped,
        dropped=int((~solid).sum()),
    )
