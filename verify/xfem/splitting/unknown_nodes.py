"""Numbers of the unknown nodes of a cut mesh, and on which side of the cuts each lies."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.xfem.mesh import SimplexMesh
from verify.xfem.splitting.joining import PatchSlots
from verify.xfem.splitting.partition import Partition

__all__ = ["PieceSides", "node_sides", "number_groups", "piece_sides"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


def number_groups(
    mesh: SimplexMesh, partition: Partition, slots: PatchSlots, solid: NDArray[np.bool_]
) -> tuple[_Ints, _Ints]:
    """Mesh node (N,) of each unknown node, and the unknown node of each group of slots.

    The first unknown nodes are the nodes of the mesh, each with the material in which it lies.

    Parameters
    ----------
    mesh : SimplexMesh
    partition : Partition
    slots : PatchSlots
    solid : (p,) bool array
        Pieces that have a volume; groups without any get the number -1.
    """
    nodes = mesh.cells[slots.cells[slots.piece_cell]]
    pieces = len(partition.parent)
    alive = np.ones(len(nodes), dtype=bool)
    alive[:pieces] = solid
    groups = slots.group.max(initial=-1) + 1
    node_of = np.full(groups, -1)
    node_of[slots.group[alive]] = nodes[alive]

    # the material in which a node lies keeps the node's number
    home = np.ones(nodes.shape, dtype=bool)
    sign = np.where(partition.points.values[nodes[:pieces]] >= 0.0, 1, -1)
    label = partition.label[:, None, :]
    home[:pieces] = ((label == 0) | (label == sign)).all(axis=2)
    is_home = np.zeros(groups, dtype=bool)
    is_home[slots.group[home & alive[:, None]]] = True

    inner = np.zeros(len(mesh.points), dtype=bool)
    inner[mesh.cells[np.unique(partition.parent)]] = True
    used = np.flatnonzero(node_of >= 0)
    used = used[inner[node_of[used]]]
    used = used[np.lexsort([used, ~is_home[used], node_of[used]])]
    first = np.diff(node_of[used], prepend=-1) != 0
    number = np.full(groups, -1)
    number[used[first]] = node_of[used[first]]
    number[used[~first]] = len(mesh.points) + np.arange(int((~first).sum()))
    # around nodes that touch no split cell the patch is not complete, but nothing is cut either
    outer = np.flatnonzero((node_of >= 0) & ~inner[node_of])
    number[outer] = node_of[outer]
    return np.concatenate([np.arange(len(mesh.points)), node_of[used[~first]]]), number


class PieceSides(NamedTuple):
    """Sides of the cuts on which some pieces lie.

    Attributes
    ----------
    rows : (s,) int array
        The pieces.
    side : (s, cuts) int8 array
        Of a cut that splits it the label; else where its centroid is: a cut that leaves a piece of
        a split cell whole may have all nodes of the cell on its other side.
    share : (s,) float array
        Volume over that of the cell.
    """

    rows: _Ints
    side: NDArray[np.int8]
    share: _Floats


def node_sides(
    level_sets: _Floats,
    node_parent: _Ints,
    cells: _Ints,
    label: NDArray[np.int8],
    pieces: PieceSides,
) -> NDArray[np.int8]:
    """Side (N, cuts) of each cut on which the material of each unknown lies.

    It is that of its labelled pieces if they agree. Where no cut has split them, or they lie
    around the end of it, it is that of the node for the unknown of the node's own material. An
    unknown beyond another cut says nothing by the place of its node: it lies where its pieces do.

    Parameters
    ----------
    level_sets : (n, cuts) float array
        At the nodes of the mesh, in metres.
    node_parent : (N,) int array
        Node of each unknown; the first n are those of the nodes' own material.
    cells : (p, d + 1) int array
        Unknown nodes of each piece.
    label : (p, cuts) int8 array
        Its sides, as in `VirtualMesh`.
    pieces : PieceSides
        Of the pieces that are not just their whole cells.
    """
    side = np.zeros((len(node_parent), label.shape[1]), dtype=np.int8)
    vote = np.zeros(side.shape)
    _write_sides(
        level_sets, node_parent, cells, label, pieces.rows, pieces.side, pieces.share, vote, side
    )
    return side


def piece_sides(
    level_sets: _Floats,
    corners: _Ints,
    label: NDArray[np.int8],
    sub_piece: _Ints,
    sub_barycentric: _Floats,
    sub_fraction: _Floats,
) -> PieceSides:
    """Sides of the pieces that consist of sub-simplices.

    Parameters
    ----------
    level_sets : (n, cuts) float array
        At the nodes of the mesh, in metres.
    corners : (p, d + 1) int array
        Nodes of the cell of each piece.
    label : (p, cuts) int8 array
    sub_piece, sub_barycentric, sub_fraction
        See `verify.xfem.virtual.SubCells`.
    """
    share = np.bincount(sub_piece, sub_fraction, minlength=len(label))
    rows = np.flatnonzero(share > 0.0)
    weights = np.zeros(corners.shape)
    np.add.at(weights, sub_piece, sub_fraction[:, None] * sub_barycentric.mean(axis=1))
    level = np.einsum("pi,pic->pc", weights[rows], level_sets[corners[rows]])
    side = np.where(label[rows] != 0, label[rows], np.where(level >= 0.0, 1, -1)).astype(np.int8)
    return PieceSides(rows, side, share[rows])


@njit(cache=True)
def _write_sides(level_sets, node_parent, cells, label, rows, side_of_row, share, vote, side):
    disagreed = 2
    cuts = label.shape[1]
    for p in range(len(cells)):
        for cut in range(cuts):
            if label[p, cut] == 0:
                continue
            for node in cells[p]:
                if side[node, cut] == 0:
                    side[node, cut] = label[p, cut]
                elif side[node, cut] != label[p, cut]:
                    side[node, cut] = disagreed
    for r in range(len(rows)):
        for node in cells[rows[r]]:
            for cut in range(cuts):
                vote[node, cut] += share[r] * side_of_row[r, cut]
    for node in range(len(node_parent)):
        for cut in range(cuts):
            if side[node, cut] == 0 or side[node, cut] == disagreed:
                says = vote[node, cut]
                level = level_sets[node_parent[node], cut]
                # a node exactly on the cut has its material where its pieces are
                if says == 0.0 or (node < len(level_sets) and level != 0.0):
                    says = level
                side[node, cut] = 1 if says >= 0.0 else -1
