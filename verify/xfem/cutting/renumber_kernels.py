"""Pieces and unknowns of a patch before and after a cut: who descends from whom."""

import numpy as np
from numba import njit

from verify.xfem.short_sort import sort_short

__all__ = ["labelled", "match_pieces", "number_unknowns", "retire", "separated", "write_pieces"]


@njit(cache=True)
def match_pieces(parent, label, side, solid, piece_label, first_piece, next_piece, old, changed):
    """Write the stored piece (p,) of which each piece of a patch is a part.

    A piece is part of another of the same cell if every cut that made the other has it on the
    same `side`. `changed` (p,) tells whether its labels differ. Returns the first piece that is
    part of none, or -1.
    """
    orphan = -1
    for p in range(len(parent)):
        old[p] = -1
        stored = first_piece[parent[p]]
        while stored >= 0:
            fits, same = True, True
            for k in range(label.shape[1]):
                same = same and piece_label[stored, k] == label[p, k]
                if piece_label[stored, k] != 0 and piece_label[stored, k] != side[p, k]:
                    fits = False
            if fits:
                old[p], changed[p] = stored, not same
                break
            stored = next_piece[stored]
        if old[p] < 0 and solid[p] and orphan < 0:
            orphan = p
    return orphan


@njit(cache=True)
def number_unknowns(
    group, alive, home, touched, old, piece_cells, mesh_nodes, count, number, source
):
    """Give every group of slots its unknown; the count of unknowns, or -1 - (slot in conflict).

    A group keeps the unknown from which it descends; if several descend from one, that in which
    the node lies keeps it (else the first), and the others get new numbers and it as `source`.
    `number` (groups,) is written for groups at touched nodes, and -1 for others.
    """
    groups = len(number)
    ancestor = np.empty(groups, dtype=np.int64)
    at_home = np.zeros(groups, dtype=np.bool_)
    for g in range(groups):
        ancestor[g] = number[g] = -1
    for p in range(len(group)):
        for a in range(group.shape[1]):
            if not (alive[p] and touched[p, a]):
                continue
            g, unknown = group[p, a], piece_cells[old[p], a]
            if ancestor[g] >= 0 and ancestor[g] != unknown:
                return -1 - p
            ancestor[g] = unknown
            at_home[g] = at_home[g] or (home[p, a] and unknown < mesh_nodes)
    order = np.empty(groups, dtype=np.int64)
    for g in range(groups):
        order[g] = ancestor[g] * groups + g
    sort_short(order)
    for k in range(groups):
        order[k] %= groups
    before = count
    k = 0
    while k < groups and ancestor[order[k]] < 0:
        k += 1
    while k < groups:
        end, keeper = k, order[k]
        while end < groups and ancestor[order[end]] == ancestor[order[k]]:
            if at_home[order[end]] and not at_home[keeper]:
                keeper = order[end]
            end += 1
        for j in range(k, end):
            g = order[j]
            if g == keeper:
                number[g] = ancestor[g]
            else:
                number[g] = count
                source[count - before] = ancestor[g]
                count += 1
        k = end
    return count


@njit(cache=True)
def write_pieces(
    cell,
    group,
    touched,
    number,
    solid,
    changed,
    old,
    fraction,
    label,
    next_piece,
    piece_cells,
    piece_parent,
    piece_fraction,
    piece_label,
    count,
    place,
    moved,
):
    """Write the pieces of a patch into the store; the count of pieces.

    The first part of a stored piece takes its place, further ones are appended. `place` (p,) is
    the stored piece of each, -1 for those without volume; `moved` (p,) if it has new unknowns.
    """
    owner = np.empty(len(old), dtype=np.int64)
    for p in range(len(old)):
        place[p] = owner[p] = -1
        if not solid[p]:
            continue
        stored, first = old[p], True
        for q in range(p - 1, -1, -1):
            if cell[q] != cell[p]:
                break
            if solid[q] and owner[q] == stored:
                first = False
                break
        owner[p] = stored
        if first:
            place[p] = stored
        else:
            place[p] = count
            for a in range(group.shape[1]):
                piece_cells[count, a] = piece_cells[stored, a]
            piece_parent[count] = cell[p]
            next_piece[count] = next_piece[stored]
            next_piece[stored] = count
            count += 1
    for p in range(len(old)):
        row = place[p]
        if row < 0:
            continue
        for a in range(group.shape[1]):
            if touched[p, a]:
                moved[p] = moved[p] or piece_cells[row, a] != number[group[p, a]]
                piece_cells[row, a] = number[group[p, a]]
        if changed[p]:
            piece_fraction[row] = fraction[p]
            for k in range(label.shape[1]):
                piece_label[row, k] = label[p, k]
    return count


@njit(cache=True)
def retire(sub_piece, sub_range, cells):
    """Mark the sub-simplices of some cells as no longer in use."""
    for cell in cells:
        for k in range(sub_range[cell, 0], sub_range[cell, 1]):
            sub_piece[k] = -1


@njit(cache=True)
def labelled(cells, cut, piece_label, first_piece, next_piece):
    """Whether any piece of each cell has a side of the cut."""
    found = np.zeros(len(cells), dtype=np.bool_)
    for k in range(len(cells)):
        piece = first_piece[cells[k]]
        while piece >= 0:
            found[k] = found[k] or piece_label[piece, cut] != 0
            piece = next_piece[piece]
    return found


@njit(cache=True)
def separated(cells, label, numbers, cut, piece_label, first_piece, next_piece):
    """Whether a cut has split every stored piece of which each given piece may be a part.

    `numbers` says which cuts the columns of `label` (p, q) are.
    """
    found = np.zeros(len(cells), dtype=np.bool_)
    for p in range(len(cells)):
        stored = first_piece[cells[p]]
        every, some = True, False
        while stored >= 0 and every:
            fits = True
            for k in range(len(numbers)):
                side = piece_label[stored, numbers[k]]
                if label[p, k] != 0 and side != 0 and side != label[p, k]:
                    fits = False
            if fits:
                some = True
                every = piece_label[stored, cut] != 0
            stored = next_piece[stored]
        found[p] = some and every
    return found
