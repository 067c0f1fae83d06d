"""Degrees of freedom that pieces share: by contact across faces, not by sign vectors.

Take two pieces in cells that share a face, and a node of the face. Both have the same dof node
there if they touch across the face, in an area (2D: a length). Pieces that touch in a corner or an
edge only are apart: they could turn about it. A piece without volume joins nothing. Tips, mouths,
parallel, crossing and branching cuts, cuts through nodes and along faces all follow from this one
rule.

A tip closes so: the face between the last divided cell and the whole one ahead has two regions, one
on either side of the cut. The whole cell has one piece, label 0, that touches across both. Hence
both sides share the dof nodes of that face, and the jump is zero on it. So a cut through a single
cell inside the mesh makes two pieces and no unknown.

Inside a cell pieces are apart, except pieces of one part (`Partition.one_part`). The ends of cuts
enter there, and by the choice of divided cells. Regions of faces ignore them: whole level sets
bound the regions.

A piece has a *side* of every cut; its *label* is 0 for cuts that do not split it off. The side is
taken at its centroid: a cut that leaves a piece whole may have all nodes of the cell on its other
side. A dof node lies on the side of its pieces.
"""

from dataclasses import dataclass

import numpy as np

from verify.compiled import njit
from verify.xfem.arrays import Bools, Floats, Ints, Sides
from verify.xfem.clip import Partition, staircase, staircase_entries
from verify.xfem.mesh import SimplexMesh, cells_at, connected, facets_of, neighbours_across
from verify.xfem.zero_points import ZeroPoints


@dataclass(frozen=True)
class PatchNodes:
    """Equivalence classes of (piece, local node) in all cells around the nodes of split cells.

    Attributes
    ----------
    cells : (c,) int array
        The cells of the patch, ascending.
    piece_cell : (p,) int array
        Place in `cells` of each piece of the patch: the pieces of the partition first, then the
        cells that are not split.
    group : (p, d + 1) int array
        Class of each local node.
    """

    cells: Ints
    piece_cell: Ints
    group: Ints


def join_parts(mesh: SimplexMesh, partition: Partition, solid: Bools) -> PatchNodes:
    """Join the local nodes of one part, and of pieces that touch, around the nodes of split cells.

    Parameters
    ----------
    mesh : SimplexMesh
    partition : Partition
    solid : (p,) bool array
        Pieces of the partition that have a volume; the others join nothing.
    """
    near = np.zeros(len(mesh.points), dtype=bool)
    near[mesh.cells[partition.parent]] = True
    patch = cells_at(mesh.cells, near)
    parent = np.searchsorted(patch, partition.parent)
    whole = np.flatnonzero(np.bincount(parent, minlength=len(patch)) == 0)
    piece_cell = np.concatenate([parent, whole])
    label = np.zeros((len(piece_cell), partition.label.shape[1]), dtype=np.int8)
    label[: len(solid)] = partition.label
    alive = np.concatenate([solid, np.ones(len(whole), dtype=bool)])

    # faces inside the patch, each once, from the cell with the smaller number
    across = neighbours_across(mesh.cells[patch])
    here, opposite = np.nonzero(across > np.arange(len(patch))[:, None])
    there = across[here, opposite]
    corners = mesh.dim + 1
    on_face = facets_of(np.arange(corners)[None])
    nodes = mesh.cells[patch[here, None], on_face[opposite]]

    # cuts divide a face into regions; across each of them one piece of either side touches another
    dividing = np.zeros((len(patch), label.shape[1]), dtype=bool)
    piece, cut = np.nonzero(partition.label)
    dividing[piece_cell[piece], cut] = True
    face, side = _regions(nodes, dividing[here] | dividing[there], partition.points)
    first, second = (_fitting(piece_cell, label, cells[face], side) for cells in (here, there))
    touch = alive[first] & alive[second]
    first, second, face = first[touch], second[touch], face[touch]
    local = on_face[opposite[face]]
    other = mesh.cells[patch[there[face]]]
    other_local = (other[:, None, :] == nodes[face][:, :, None]).argmax(axis=2)
    pairs = partition.one_part[:, :, None] * corners + np.arange(corners)
    one = np.concatenate([(first[:, None] * corners + local).ravel(), pairs[:, 0].ravel()])
    two = np.concatenate([(second[:, None] * corners + other_local).ravel(), pairs[:, 1].ravel()])
    group = connected(len(piece_cell) * corners, one, two).reshape(-1, corners)
    return PatchNodes(patch, piece_cell, group)


def _regions(nodes: Ints, dividing: Bools, points: ZeroPoints) -> tuple[Ints, Sides]:
    """Find the face (q,) and sides (q, cuts) of the regions into which cuts divide faces.

    Parameters
    ----------
    nodes : (f, d) int array
        Corners of each face.
    dividing : (f, cuts) bool array
        Cuts that divide a cell beside the face.
    points : ZeroPoints
    """
    # cuts come in the order of their numbers, not of the division: points may be new here, and are
    # added. Only sides leave this function; points tell empty regions.
    face, side = np.arange(len(nodes)), np.zeros(dividing.shape, dtype=np.int8)
    stairs, left = staircase(nodes.shape[1]), dividing.copy()
    while left.any():
        # of each face the first cut that is left: faces do not wait for one another
        first, some = left.argmax(axis=1), left.any(axis=1)
        left[some, first[some]] = False
        chosen = np.flatnonzero(some[face])
        cut = first[face[chosen]]
        plus = points.values[nodes[chosen], cut[:, None]] >= 0.0
        side[chosen, cut] = np.where(plus.all(axis=1), 1, -1)
        both = plus.any(axis=1) & ~plus.all(axis=1)
        mixed, cut = chosen[both], cut[both]
        ids = np.sort(nodes[mixed], axis=1)
        entry, of = staircase_entries(points.values[ids, cut[:, None]] >= 0.0)
        number = points.on_edges(cut, ids)
        regions = number[of[:, None], stairs.plus[entry], stairs.minus[entry]]
        region_side = side[mixed[of]]
        region_side[np.arange(len(of)), cut[of]] = stairs.side[entry]
        rest = np.ones(len(face), dtype=bool)
        rest[mixed] = False
        nodes = np.concatenate([nodes[rest], regions])
        face = np.concatenate([face[rest], face[mixed[of]]])
        side = np.concatenate([side[rest], region_side])
    # a zero point that is a corner comes twice: there the region has no area (2D: no length)
    ordered = np.sort(nodes, axis=1)
    area = (ordered[:, 1:] != ordered[:, :-1]).all(axis=1)
    return face[area], side[area]


def _fitting(piece_cell: Ints, label: Sides, cells: Ints, side: Sides) -> Ints:
    """Return the piece (q,) of each cell that has a region of its face with sides (q, cuts).

    It is one: a side of every cut leads down the divisions of a cell to exactly one piece. Hence
    pieces of round-off size keep their rows, and pieces of one part stay several: their union is in
    general no intersection of sides, so that no label would fit.
    """
    order = np.argsort(piece_cell, kind="stable")
    ends = np.cumsum(np.bincount(piece_cell))
    first, end = np.concatenate([[0], ends])[cells], ends[cells]
    count = end - first
    of = np.repeat(np.arange(len(cells)), count)
    piece = order[np.arange(len(of)) + np.repeat(end - np.cumsum(count), count)]
    fits = ((label[piece] == 0) | (label[piece] == side[of])).all(axis=1)
    if not np.array_equal(of[fits], np.arange(len(cells))):
        raise RuntimeError("the pieces of a cell do not partition the plane of a face")
    return piece[fits]


def number_nodes(
    mesh: SimplexMesh, partition: Partition, joined: PatchNodes, solid: Bools
) -> tuple[Ints, Ints]:
    """Mesh node (N,) of each dof node, and the dof node of each class; −1 for one without volume.

    The first dof nodes are the nodes of the mesh, each with the material in which it lies; if that
    has no volume, with other material around it.

    Parameters
    ----------
    mesh : SimplexMesh
    partition : Partition
    joined : PatchNodes
    solid : (p,) bool array
        Pieces of the partition that have a volume.
    """
    nodes = mesh.cells[joined.cells[joined.piece_cell]]
    pieces = len(partition.parent)
    alive = np.ones(len(nodes), dtype=bool)
    alive[:pieces] = solid
    groups = joined.group.max(initial=-1) + 1
    node_of = np.full(groups, -1)
    node_of[joined.group[alive]] = nodes[alive]

    # The material in which a node lies keeps the node's number. On cuts through the node that is
    # the one above most of them: there may be none above all, as where a cut runs along a wall.
    # Only numbers depend on that, not the space.
    rank = np.zeros(nodes.shape, dtype=np.int64)
    piece, cut = np.nonzero(partition.label)
    level = partition.points.values[nodes[piece], cut[:, None]]
    side = partition.label[piece, cut][:, None]
    beyond, below = np.zeros((2, pieces, nodes.shape[1]), dtype=np.int64)
    np.add.at(beyond, piece, side * level < 0.0)
    np.add.at(below, piece, (side < 0) & (level == 0.0))
    rank[:pieces] = np.where(beyond > 0, 1 + partition.label.shape[1], below)
    group_rank = np.full(groups, np.iinfo(np.int64).max)
    np.minimum.at(group_rank, joined.group[alive], rank[alive])

    inner = np.zeros(len(mesh.points), dtype=bool)
    inner[mesh.cells[partition.parent]] = True
    used = np.flatnonzero(node_of >= 0)
    used = used[inner[node_of[used]]]
    used = used[np.lexsort([used, group_rank[used], node_of[used]])]
    first = np.diff(node_of[used], prepend=-1) != 0
    number = np.full(groups, -1)
    number[used[first]] = node_of[used[first]]
    number[used[~first]] = len(mesh.points) + np.arange(int((~first).sum()))
    # around nodes that touch no split cell the patch is not complete, but nothing is cut either
    outer = np.flatnonzero((node_of >= 0) & ~inner[node_of])
    number[outer] = node_of[outer]
    return np.concatenate([np.arange(len(mesh.points)), node_of[used[~first]]]), number


# of the absolute sum: a vote, or a centroid, as close as that to neither side is on none, whatever
# the order of the sum
_TIE = 1e-12


@njit(cache=True)
def piece_sides(level_sets: Floats, corners: Ints, label: Sides, weights: Floats) -> Sides:
    """Tell the sides (p, cuts) of the cuts on which pieces lie; plus on the cut.

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
    # φ(centroid) = Σ_i λ_i φ_i, in one pass: there may be a thousand cuts
    side = np.empty_like(label)
    for piece in range(len(label)):
        for k in range(label.shape[1]):
            level = whole = 0.0
            for i in range(corners.shape[1]):
                share = weights[piece, i] * level_sets[corners[piece, i], k]
                level += share
                whole += abs(share)
            own = 1 if level >= -_TIE * whole else -1
            side[piece, k] = own if label[piece, k] == 0 else label[piece, k]
    return side


def node_sides(
    level_sets: Floats,
    node_parent: Ints,
    cells: Ints,
    label: Sides,
    piece_side: Sides,
    share: Floats,
) -> Sides:
    """Tell the sides (N, cuts) of the cuts on which the material of each dof node lies.

    For each cut, the first of these that applies:

    1. all labelled pieces of the dof node are on one side: that side;
    2. it is of the node's own material, and the node is not on the cut: the side of the node;
    3. its pieces in split cells lie on one side by the larger share, beyond round-off: that side;
       a dof node beyond another cut lies where its pieces do, not where its node is;
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
        Volume over the volume of the cell; 0 for whole cells, which have no vote.
    """
    on_cut = level_sets == 0.0
    side = np.where(level_sets >= 0.0, np.int8(1), np.int8(-1))[node_parent]
    # where a node's own material has no volume, its number is of an unknown beyond a cut
    own = np.zeros(len(node_parent), dtype=bool)
    piece, cut = np.nonzero(label)
    level = level_sets[node_parent[cells[piece]], cut[:, None]]
    within = np.ones(cells.shape, dtype=bool)
    row, corner = np.nonzero(label[piece, cut][:, None] * level < 0.0)
    within[piece[row], corner] = False
    own[cells[within]] = True
    # pieces vote where the node does not tell: for another material than the node's own, or where
    # the node is exactly on a cut
    asks = ~own | on_cut.any(axis=1)[node_parent]
    voters = np.flatnonzero((share > 0.0) & asks[cells].any(axis=1))
    nodes, number = np.unique(cells[voters], return_inverse=True)
    number, count = number.ravel(), len(nodes)
    for k in range(label.shape[1]):
        weight = np.repeat(share[voters] * piece_side[voters, k], cells.shape[1])
        vote = np.bincount(number, weight, count)
        heard = np.abs(vote) > _TIE * np.bincount(number, np.abs(weight), count)
        heard &= ~own[nodes] | on_cut[node_parent[nodes], k]
        side[nodes[heard], k] = np.where(vote[heard] > 0.0, 1, -1)
    # where all labelled pieces are on one side
    at, of = cells[piece].ravel(), np.repeat(cut, cells.shape[1])
    pairs, number = np.unique(at * label.shape[1] + of, return_inverse=True)
    total = np.bincount(number, np.repeat(label[piece, cut], cells.shape[1]))
    told = np.abs(total) == np.bincount(number)
    side[np.divmod(pairs[told], label.shape[1])] = np.sign(total[told])
    return side
