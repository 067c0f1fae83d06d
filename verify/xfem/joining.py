"""Which pieces share their unknowns: identity by contact across faces, not by sign vectors.

A *slot* is a piece together with a node of its cell. Two slots at one node are the same unknown
when the pieces, in cells that share a face with that node, touch across the face. Tips, mouths,
parallel, crossing and branching cuts, cuts through nodes and along faces all follow from this one
rule (formulation: "one set of node values per piece of material connected inside the element").
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from verify.xfem.clipping import staircase
from verify.xfem.mesh import SimplexMesh
from verify.xfem.split import Partition, clip_pattern
from verify.xfem.zero_points import ZeroPoints

__all__ = ["PatchSlots", "join_slots"]

_Ints = NDArray[np.int64]


@dataclass(frozen=True)
class PatchSlots:
    """Slots of all cells around the nodes of split cells.

    Attributes
    ----------
    cells : (c,) int array
        The cells of the patch, ascending.
    piece_cell : (p,) int array
        Place in `cells` of each piece of the patch: the pieces of the partition first, then the
        cells that are not split.
    group : (p, d + 1) int array
        Connected component of each slot.
    """

    cells: _Ints
    piece_cell: _Ints
    group: _Ints


def join_slots(mesh: SimplexMesh, partition: Partition) -> PatchSlots:
    """Join the slots of all pieces that touch, around the nodes of split cells."""
    split = np.unique(partition.parent)
    patch = _cells_around(mesh, np.unique(mesh.cells[split]))
    place = np.full(len(mesh.cells), -1)
    place[patch] = np.arange(len(patch))
    whole = np.setdiff1d(patch, split, assume_unique=True)
    piece_cell = place[np.concatenate([partition.parent, whole])]
    label = np.concatenate(
        [partition.label, np.zeros((len(whole), partition.label.shape[1]), dtype=np.int8)]
    )
    first, second, nodes = _interior_faces(mesh, patch, place)
    touching = _touching_pieces(nodes, first, second, piece_cell, label, partition.points)
    corners = mesh.dim + 1
    pairs = [
        _slots(mesh.cells[patch], piece_cell, pieces, nodes[face])
        for face, pieces in ((touching[0], touching[1]), (touching[0], touching[2]))
    ]
    a, b = pairs[0].ravel(), pairs[1].ravel()
    size = len(piece_cell) * corners
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(size, size))
    _, group = connected_components(graph, directed=False)
    return PatchSlots(patch, piece_cell, group.reshape(-1, corners).astype(np.int64))


def _cells_around(mesh: SimplexMesh, nodes: _Ints) -> _Ints:
    mark = np.zeros(len(mesh.points), dtype=bool)
    mark[nodes] = True
    return np.flatnonzero(mark[mesh.cells].any(axis=1))


def _interior_faces(mesh: SimplexMesh, patch: _Ints, place: _Ints) -> tuple[_Ints, _Ints, _Ints]:
    """Faces between two cells of the patch: both cells (places) and the nodes (f, d), sorted."""
    across = np.where(mesh.neighbours[patch] >= 0, place[mesh.neighbours[patch]], -1)
    cell, opposite = np.nonzero(across > np.arange(len(patch))[:, None])
    corners = mesh.dim + 1
    keep = np.array([[j for j in range(corners) if j != k] for k in range(corners)])
    nodes = mesh.cells[patch[cell][:, None], keep[opposite]]
    return cell, across[cell, opposite], np.sort(nodes, axis=1)


def _touching_pieces(
    nodes: _Ints,
    first: _Ints,
    second: _Ints,
    piece_cell: _Ints,
    label: NDArray[np.int8],
    points: ZeroPoints,
) -> tuple[_Ints, _Ints, _Ints]:
    """(face, piece on one side, piece on the other) for all pieces that touch."""
    relevant = np.zeros((piece_cell.max(initial=-1) + 1, label.shape[1]), dtype=bool)
    np.logical_or.at(relevant, piece_cell, label != 0)
    face, sides = _face_regions(nodes, relevant[first] | relevant[second], points)
    region, pieces = [], []
    for cell in (first, second):
        at, piece = _pieces_of(cell[face], piece_cell)
        fits = ((label[piece] == 0) | (label[piece] == sides[at])).all(axis=1)
        region.append(at[fits])
        pieces.append(piece[fits])
    # the pieces of a cell partition the plane of its face: exactly one fits each region
    assert np.array_equal(region[0], region[1])
    assert np.array_equal(region[0], np.arange(len(face)))
    found = np.unique(np.stack([face, pieces[0], pieces[1]]), axis=1)
    return found[0], found[1], found[2]


def _face_regions(
    nodes: _Ints, cutting: NDArray[np.bool_], points: ZeroPoints
) -> tuple[_Ints, NDArray[np.int8]]:
    """Divide faces by the cuts that matter to their cells: face and side (q, cuts) per region."""
    face = np.arange(len(nodes))
    sides = np.zeros(cutting.shape, dtype=np.int8)
    stairs = staircase(nodes.shape[1])
    for index in range(cutting.shape[1]):
        chosen = cutting[face, index]
        plus = points.values[nodes, index] >= 0.0
        sides[:, index] = np.where(chosen, np.where(plus.all(axis=1), 1, -1), 0)
        mixed = chosen & plus.any(axis=1) & ~plus.all(axis=1)
        if not mixed.any():
            continue
        rows = np.flatnonzero(mixed)
        ids = np.sort(nodes[rows], axis=1)
        above = points.values[ids, index] >= 0.0
        entry, local = clip_pattern(above)
        row, a, b = np.nonzero(above[:, :, None] & ~above[:, None, :])
        number = np.zeros((*ids.shape, ids.shape[1]), dtype=np.int64)
        number[row, a, b] = points.find(index, ids[row, a], ids[row, b])
        corner = np.arange(ids.shape[1])
        number[:, corner, corner] = ids
        new_nodes = number[local[:, None], stairs.plus[entry], stairs.minus[entry]]
        new_sides = sides[rows[local]]
        new_sides[:, index] = stairs.side[entry]
        nodes = np.concatenate([nodes[~mixed], new_nodes])
        face = np.concatenate([face[~mixed], face[rows[local]]])
        sides = np.concatenate([sides[~mixed], new_sides])
    return face, sides


def _pieces_of(cell: _Ints, piece_cell: _Ints) -> tuple[_Ints, _Ints]:
    """All pieces of each of the given cells: (place in `cell`, piece)."""
    order = np.argsort(piece_cell, kind="stable")
    start = np.searchsorted(piece_cell[order], cell)
    count = np.searchsorted(piece_cell[order], cell, side="right") - start
    at = np.repeat(np.arange(len(cell)), count)
    within = np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count)
    return at, order[start[at] + within]


def _slots(cells: _Ints, piece_cell: _Ints, piece: _Ints, nodes: _Ints) -> _Ints:
    """Slot numbers (q, d) of the given nodes (q, d) in the given pieces (q,)."""
    corners = cells.shape[1]
    local = (cells[piece_cell[piece]][:, None, :] == nodes[:, :, None]).argmax(axis=2)
    return piece[:, None] * corners + local
