"""Sides of the cuts (+1 or −1) on which pieces and dof nodes lie.

The *label* of a piece has the sides of the cuts that split it off, 0 for the others. Its *side* of
those is that of its centroid: a cut that leaves a piece of a split cell whole may have all nodes of
the cell on its other side. The side of a dof node is that of its pieces.
"""

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints, Sides

# of the absolute sum: a vote, or a centroid, as close as that to neither side is on none, whatever
# the order of the sum
_TIE = 1e-12


def piece_sides(level_sets: Floats, corners: Ints, label: Sides, weights: Floats) -> Sides:
    """Sides (p, cuts) of the cuts on which pieces lie; plus where a centroid is on the cut.

    Parameters
    ----------
    level_sets : (n, cuts) float array
        At the nodes of the mesh, in metres.
    corners : (p, d + 1) int array
        Nodes of the cell of each piece.
    label : (p, cuts) int8 array
    weights : (p, d + 1) float array
        Barycentric coordinates of the centroids, up to a positive factor.
    """
    # φ(centroid) = Σ_i λ_i φ_i, a corner at a time: there may be hundreds of cuts
    level, whole = np.zeros((2, *label.shape))
    for w, nodes in zip(weights.T, corners.T, strict=True):
        share = w[:, None] * level_sets[nodes]
        level += share
        whole += np.abs(share)
    side = np.where(level >= -_TIE * whole, 1, -1)
    return np.where(label != 0, label, side).astype(np.int8)


def node_sides(
    level_sets: Floats,
    node_parent: Ints,
    cells: Ints,
    label: Sides,
    piece_side: Sides,
    share: Floats,
) -> Sides:
    """Sides (N, cuts) of the cuts on which the material of each dof node lies.

    For each cut, the first of these that applies:

    1. all labelled pieces of the dof node are on one side: that;
    2. it is of the node's own material, and the node is not on the cut: the side of the node;
    3. its pieces in split cells lie on one side by the larger share, beyond round-off: that. So a
       dof node beyond another cut lies where its pieces do, not where its node is;
    4. else the side of the node, plus on the cut.

    Parameters
    ----------
    level_sets : (n, cuts) float array
        At the nodes of the mesh, in metres.
    node_parent : (N,) int array
        Node of each dof node.
    cells : (p, d + 1) int array
        Dof nodes of each piece.
    label, piece_side : (p, cuts) int8 array
    share : (p,) float array
        Volume over that of the cell; 0 for whole cells, which have no vote.
    """
    side = np.empty((len(node_parent), label.shape[1]), dtype=np.int8)
    # where a node's own material has no volume, its number is of an unknown beyond a cut
    own = np.zeros(len(node_parent), dtype=bool)
    piece, cut = np.nonzero(label)
    level = level_sets[node_parent[cells[piece]], cut[:, None]]
    against = np.zeros(cells.shape, dtype=np.int64)
    np.add.at(against, piece, label[piece, cut][:, None] * level < 0.0)
    own[cells[against == 0]] = True
    voters = np.flatnonzero(share)
    nodes = cells[voters].ravel()
    for k in range(label.shape[1]):
        above, below = (_at_any(cells[sign * label[:, k] > 0], len(side)) for sign in (1, -1))
        weight = np.repeat(share[voters] * piece_side[voters, k], cells.shape[1])
        vote = np.bincount(nodes, weight, minlength=len(node_parent))
        vote[np.abs(vote) <= _TIE * np.bincount(nodes, np.abs(weight), len(node_parent))] = 0.0
        level = level_sets[node_parent, k]
        # a node exactly on the cut has its material where its pieces are
        told = np.where((vote == 0.0) | (own & (level != 0.0)), level, vote)
        side[:, k] = np.where(above != below, np.where(above, 1, -1), np.where(told >= 0, 1, -1))
    return side


def _at_any(cells: Ints, count: int) -> Bools:
    found = np.zeros(count, dtype=bool)
    found[cells] = True
    return found
