"""Twins of the kernels that divide and join pieces: plain numpy, all at once, by other means.

Division looks up nothing: the points on cut edges come with it. Bisection searches all simplices
for each point. Joining makes a graph of slots and asks scipy for its components.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from verify.xfem.splitting.clipping import staircase

__all__ = ["bisected", "crossed", "divided", "joined"]


def crossed(points, piece, label, values, cut):
    """Edges (q, 2) from plus to minus and their pieces (q,), as `crossed_edges`."""
    open_ = np.flatnonzero(label[piece, cut] == 0)
    plus = values[points[open_], cut] >= 0.0
    row, a, b = np.nonzero(plus[:, :, None] & ~plus[:, None, :])
    ids = points[open_[row]]
    k = np.arange(len(row))
    return np.stack([ids[k, a], ids[k, b]], axis=1), piece[open_[row]]


def _entries(plus):
    """Staircase entries of simplices with these signs (q, corners), and the simplex of each."""
    stairs = staircase(plus.shape[1])
    pattern = plus @ (1 << np.arange(plus.shape[1]))
    count = stairs.start[pattern + 1] - stairs.start[pattern]
    local = np.repeat(np.arange(len(plus)), count)
    within = np.arange(len(local)) - np.repeat(np.cumsum(count) - count, count)
    return stairs.start[pattern][local] + within, local


def _numbers(ids, plus, cut, find):
    """(q, c, c) number of the zero point between corners a (plus) and b (minus); of a if a = b."""
    row, a, b = np.nonzero(plus[:, :, None] & ~plus[:, None, :])
    number = np.zeros((*ids.shape, ids.shape[1]), dtype=np.int64)
    number[row, a, b] = find(cut, ids[row, a], ids[row, b])
    corner = np.arange(ids.shape[1])
    number[:, corner, corner] = ids
    return number


def divided(simplices, values, cut, active, below, find):
    """Simplices after the division, those not clipped first, as `divide_simplices`."""
    piece, points, barycentric, fraction, sign = simplices
    plus = values[points, cut] >= 0.0
    touched = active[piece]
    clipped = touched & plus.any(axis=1) & ~plus.all(axis=1)
    moved = np.where(touched & ~plus.any(axis=1), below[piece], piece)
    rows = np.flatnonzero(clipped)
    order = np.argsort(points[rows], axis=1, kind="stable")
    ids = np.take_along_axis(points[rows], order, axis=1)
    corners = np.take_along_axis(barycentric[rows], order[:, :, None], axis=1)
    above = values[ids, cut] >= 0.0
    level = values[ids, cut]
    with np.errstate(divide="ignore", invalid="ignore"):
        r = level[:, :, None] / (level[:, :, None] - level[:, None, :])
        s = -level[:, None, :] / (level[:, :, None] - level[:, None, :])
    diagonal = np.arange(ids.shape[1])
    r[:, diagonal, diagonal], s[:, diagonal, diagonal] = 0.0, 1.0
    number = _numbers(ids, above, cut, find)
    stairs = staircase(ids.shape[1])
    entry, local = _entries(above)
    at, p, m = local[:, None], stairs.plus[entry], stairs.minus[entry]
    kind, a, b = (stairs.factors[entry][:, :, k] for k in range(3))
    share = np.where(kind == 0, r[at, a, b], s[at, a, b]).prod(axis=1)
    turned = np.sign(np.linalg.det(np.eye(ids.shape[1])[order]))
    new = (
        np.where(stairs.side[entry] > 0, piece[rows[local]], below[piece[rows[local]]]),
        number[at, p, m],
        s[at, p, m][..., None] * corners[at, p] + r[at, p, m][..., None] * corners[at, m],
        fraction[rows[local]] * share,
        sign[rows[local]] * turned[local] * stairs.sign[entry],
    )
    kept = (moved[~clipped], *(x[~clipped] for x in simplices[1:]))
    return tuple(np.concatenate(pair) for pair in zip(kept, new, strict=True))


def bisected(order, ends, r, s, nodes, points, barycentric, fraction):
    """Points, corners and shares after bisection, in no particular order, as `bisect_along`."""
    for z, (plus, minus) in enumerate(ends):
        has = (points == plus).any(axis=1) & (points == minus).any(axis=1)
        row = np.arange(int(has.sum()))
        ids, corners, share = points[has], barycentric[has], fraction[has]
        at, to = (ids == plus).argmax(axis=1), (ids == minus).argmax(axis=1)
        middle = s[z] * corners[row, at] + r[z] * corners[row, to]
        parts = [(points[~has], barycentric[~has], fraction[~has])]
        for local, part in ((at, s[z]), (to, r[z])):
            half, half_corners = ids.copy(), corners.copy()
            half[row, local], half_corners[row, local] = nodes + order[z], middle
            parts.append((half, half_corners, share * part))
        points, barycentric, fraction = (np.concatenate(x) for x in zip(*parts, strict=True))
    return points, barycentric, fraction


def _regions(nodes, cutting, values, find):
    """Divide faces (f, d) by the cuts that matter to their cells.

    Face (q,), sides (q, cuts) and corners (q, d) of each region.
    """
    face, sides = np.arange(len(nodes)), np.zeros(cutting.shape, dtype=np.int8)
    stairs = staircase(nodes.shape[1])
    for cut in range(cutting.shape[1]):
        chosen, plus = cutting[face, cut], values()[nodes, cut] >= 0.0
        sides[:, cut] = np.where(chosen, np.where(plus.all(axis=1), 1, -1), 0)
        mixed = chosen & plus.any(axis=1) & ~plus.all(axis=1)
        ids = np.sort(nodes[mixed], axis=1)
        above = values()[ids, cut] >= 0.0
        entry, local = _entries(above)
        number = _numbers(ids, above, cut, find)
        parts = number[local[:, None], stairs.plus[entry], stairs.minus[entry]]
        part_sides = sides[mixed][local]
        part_sides[:, cut] = stairs.side[entry]
        nodes = np.concatenate([nodes[~mixed], parts])
        face = np.concatenate([face[~mixed], face[mixed][local]])
        sides = np.concatenate([sides[~mixed], part_sides])
    return face, sides, nodes


def joined(mesh, partition):
    """Group (p, d + 1) of each slot of the patch, as `join_slots`."""
    split = np.unique(partition.parent)
    around = np.isin(mesh.cells, mesh.cells[split]).any(axis=1)
    patch = np.flatnonzero(around)
    whole = np.setdiff1d(patch, split)
    piece_cell = np.concatenate([partition.parent, whole])
    label = np.zeros((len(piece_cell), partition.label.shape[1]), dtype=np.int8)
    label[: len(partition.parent)] = partition.label
    cell, opposite = np.nonzero(around[:, None] & (mesh.neighbours >= 0))
    other = mesh.neighbours[cell, opposite]
    once = around[other] & (other > cell)
    cell, opposite, other = cell[once], opposite[once], other[once]
    corners = mesh.dim + 1
    keep = np.array([[j for j in range(corners) if j != k] for k in range(corners)])
    nodes = np.sort(mesh.cells[cell[:, None], keep[opposite]], axis=1)
    relevant = np.zeros((len(mesh.cells), label.shape[1]), dtype=bool)
    np.logical_or.at(relevant, piece_cell, label != 0)
    points = partition.points
    face, sides, region = _regions(
        nodes, relevant[cell] | relevant[other], lambda: points.values, points.find
    )
    alive = np.ones(len(piece_cell), dtype=bool)
    alive[: len(partition.parent)] = partition.fraction > 0.0
    first, second = [], []
    for f, side, corners_of in zip(face, sides, region, strict=True):
        if len(set(corners_of)) < len(corners_of):
            continue  # no area: contact in a corner or an edge only
        pair = []
        for c in (cell[f], other[f]):
            mine = np.flatnonzero(piece_cell == c)
            fits = ((label[mine] == 0) | (label[mine] == side)).all(axis=1)
            (piece,) = mine[fits]
            pair.append(piece * corners + (mesh.cells[c] == nodes[f][:, None]).argmax(axis=1))
        if all(alive[slots[0] // corners] for slots in pair):  # others join nothing
            first.append(pair[0])
            second.append(pair[1])
    for tie in partition.tied:
        first.append(tie[0] * corners + np.arange(corners))
        second.append(tie[1] * corners + np.arange(corners))
    size = len(piece_cell) * corners
    a, b = np.concatenate(first), np.concatenate(second)
    graph = coo_array((np.ones(len(a)), (a, b)), shape=(size, size))
    return connected_components(graph, directed=False)[1].reshape(-1, corners)
