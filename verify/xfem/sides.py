"""On which side of the cuts parts of cells, and the material of dof nodes, lie."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["PieceSides", "node_sides", "piece_sides"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


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
        Dof nodes of each piece.
    label : (p, cuts) int8 array
        Its sides, as in `PhantomMesh`.
    pieces : PieceSides
        Of the pieces that are not just their whole cells.
    """
    side = np.empty((len(node_parent), label.shape[1]), dtype=np.int8)
    own = np.arange(len(node_parent)) < len(level_sets)
    nodes = cells[pieces.rows].ravel()
    for cut in range(label.shape[1]):
        above, below = np.zeros((2, len(node_parent)), dtype=bool)
        above[cells[label[:, cut] > 0]] = True
        below[cells[label[:, cut] < 0]] = True
        weight = np.repeat(pieces.share * pieces.side[:, cut], cells.shape[1])
        vote = np.bincount(nodes, weight, minlength=len(node_parent))
        level = level_sets[node_parent, cut]
        # a node exactly on the cut has its material where its pieces are
        says = np.where((vote == 0.0) | (own & (level != 0.0)), level, vote)
        side[:, cut] = np.where(above != below, np.where(above, 1, -1), np.where(says >= 0, 1, -1))
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
        See `verify.xfem.phantom.SubCells`.
    """
    share = np.bincount(sub_piece, sub_fraction, minlength=len(label))
    rows = np.flatnonzero(share > 0.0)
    weights = np.zeros(corners.shape)
    np.add.at(weights, sub_piece, sub_fraction[:, None] * sub_barycentric.mean(axis=1))
    level = np.einsum("pi,pic->pc", weights[rows], level_sets[corners[rows]])
    side = np.where(label[rows] != 0, label[rows], np.where(level >= 0.0, 1, -1)).astype(np.int8)
    return PieceSides(rows, side, share[rows])
