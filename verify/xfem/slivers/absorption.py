"""A cut mesh in which some pieces are absorbed by others: the one step behind sliver policies.

A piece that is absorbed moves with the linear field of the piece that absorbs it, continued into
its place. For linear simplices that is no more than adding its volume there: the gradient is the
same constant. So the result is a cut mesh like any other, and neither statics nor dynamics
knows about slivers. Stiffness and side-wise mass of a piece grow by the same factor, so the bound
of the explicit step by that of the uncut elements stays.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from verify.xfem.virtual import SubCells, VirtualMesh

__all__ = ["Absorption", "absorb"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Absorption:
    """What became of the pieces and unknowns of a cut mesh.

    Attributes
    ----------
    piece : (p,) int array
        New number of the piece that holds the material of each old one.
    node : (N,) int array
        New number of each old unknown node, −1 if only absorbed pieces used it.
    extension : (N, N_new) csr_array
        Old unknowns from the new ones: those that are gone follow the field of the piece that
        has absorbed theirs. Its transpose carries nodal forces the other way.
    """

    piece: _Ints
    node: _Ints
    extension: csr_array


def absorb(virtual: VirtualMesh, into: _Ints) -> tuple[VirtualMesh, Absorption]:
    """Let pieces absorb others.

    Parameters
    ----------
    virtual : VirtualMesh
    into : (p,) int array
        Piece that absorbs each piece; itself if it stays. A piece that absorbs must stay.

    Raises
    ------
    ValueError
        If a piece is to be absorbed by one that does not stay.
    """
    if not np.array_equal(into[into], into):
        raise ValueError("a piece is absorbed by one that does not stay")
    stays = into == np.arange(len(into))
    number = np.cumsum(stays) - 1
    node_parent, node = _renumber(virtual, stays)
    gone = np.flatnonzero(~stays)
    moved = virtual.mesh.measures[virtual.parent] / virtual.mesh.measures[virtual.parent[into]]
    fraction = virtual.fraction.copy()
    np.add.at(fraction, into[gone], (virtual.fraction * moved)[gone])
    old_of_new = np.empty(len(node_parent), dtype=np.int64)
    old_of_new[node[node >= 0]] = np.flatnonzero(node >= 0)
    treated = replace(
        virtual,
        cells=node[virtual.cells[stays]],
        parent=virtual.parent[stays],
        fraction=fraction[stays],
        label=virtual.label[stays],
        node_parent=node_parent,
        node_side=virtual.node_side[old_of_new],
        sub_cells=_sub_cells(virtual, into, number),
    )
    extension = _extension(virtual, into, node, len(node_parent))
    return treated, Absorption(number[into], node, extension)


def _renumber(virtual: VirtualMesh, stays: NDArray[np.bool_]) -> tuple[_Ints, _Ints]:
    """Mesh node of each new unknown; new number of each old one, -1 if no piece uses it.

    Each mesh node keeps at least one unknown, because every cell keeps a piece; the first of them
    takes the node's number.
    """
    is_used = np.zeros(virtual.node_count, dtype=bool)
    is_used[virtual.cells[stays]] = True
    used = np.flatnonzero(is_used)
    parent = virtual.node_parent[used]
    order = np.argsort(parent, kind="stable")
    used, parent = used[order], parent[order]
    first = np.diff(parent, prepend=-1) != 0
    nodes = len(virtual.mesh.points)
    node = np.full(virtual.node_count, -1)
    node[used[first]] = parent[first]
    node[used[~first]] = nodes + np.arange(int((~first).sum()))
    return np.concatenate([np.arange(nodes), parent[~first]]), node


def _continued(virtual: VirtualMesh, cell: _Ints, into: _Ints) -> _Floats:
    """(q, d + 1, d + 1) barycentric coordinates of the corners of `cell` in the cells `into`.

    Exactly 0 and 1 at common nodes, so that common points of the cut are recognised.
    """
    mesh = virtual.mesh
    corners = mesh.points[mesh.cells[cell]]
    at = np.einsum(
        "qcj,qij->qci", corners - mesh.points[mesh.cells[into, :1]], mesh.gradients[into]
    )
    at[:, :, 0] += 1.0
    same = mesh.cells[cell][:, :, None] == mesh.cells[into][:, None, :]
    common = same.any(axis=2)
    at[common] = same[common]
    return at


def _sub_cells(virtual: VirtualMesh, into: _Ints, number: _Ints) -> SubCells:
    sub, mesh = virtual.sub_cells, virtual.mesh
    target = into[sub.piece]
    before, home = virtual.parent[sub.piece], virtual.parent[target]
    out = np.flatnonzero(before != home)
    if len(out) == 0:
        return replace(sub, piece=number[target])
    barycentric, fraction = sub.barycentric.copy(), sub.fraction.copy()
    barycentric[out] = sub.barycentric[out] @ _continued(virtual, before[out], home[out])
    fraction[out] *= mesh.measures[before[out]] / mesh.measures[home[out]]
    cell = before if sub.cell is None else sub.cell
    in_cell = sub.barycentric if sub.in_cell is None else sub.in_cell
    # a whole cell that absorbs is from now on described by sub-simplices: itself is one
    is_whole = np.zeros(len(into), dtype=bool)
    is_whole[target[out]] = True
    is_whole[sub.piece] = False
    whole = np.flatnonzero(is_whole)
    itself = np.broadcast_to(np.eye(mesh.dim + 1), (len(whole), mesh.dim + 1, mesh.dim + 1))
    return SubCells(
        piece=number[np.concatenate([target, whole])],
        points=np.concatenate([sub.points, mesh.cells[virtual.parent[whole]]]),
        barycentric=np.concatenate([barycentric, itself]),
        fraction=np.concatenate([fraction, np.ones(len(whole))]),
        zero_points=sub.zero_points,
        cell=np.concatenate([cell, virtual.parent[whole]]),
        in_cell=np.concatenate([in_cell, itself]),
    )


def _extension(virtual: VirtualMesh, into: _Ints, node: _Ints, count: int) -> csr_array:
    kept = np.flatnonzero(node >= 0)
    gone = np.flatnonzero(into != np.arange(len(into)))
    at = _continued(virtual, virtual.parent[gone], virtual.parent[into[gone]])
    row, corner = np.nonzero(node[virtual.cells[gone]] < 0)
    lost = virtual.cells[gone][row, corner]
    # an unknown that several absorbed pieces used takes the mean of what they follow
    weights = at[row, corner] / np.bincount(lost, minlength=len(node))[lost][:, None]
    columns = node[virtual.cells[into[gone]]][row]
    rows = np.broadcast_to(lost[:, None], columns.shape)
    return csr_array(
        (
            np.concatenate([np.ones(len(kept)), weights.ravel()]),
            (np.concatenate([kept, rows.ravel()]), np.concatenate([node[kept], columns.ravel()])),
        ),
        shape=(len(node), count),
    )
