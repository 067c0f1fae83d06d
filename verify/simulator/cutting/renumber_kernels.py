"""Pieces and unknowns of a patch before and after a cut: who descends from whom."""

import numpy as np
from numba import njit

from verify.accelerated.short_sort import sort_short

__all__ = [
    "labelled",
    "match_pieces",
    "number_unknowns",
    "retire",
    "separated",
    "simplices_of",
    "slots_before",
    "write_pieces",
]


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
def slots_before(
    local, changed, patch_cells, patch_nodes, whole_cells, parent, label, values, solid, old,
    first_piece,
):  # fmt: skip
    """Find what the slots of a patch are before its unknowns are numbered anew.

    Parameters
    ----------
    local : (p,) int array
        Place in the patch of the cell of each piece: of the parts of split cells first.
    changed : int array
        Places of the cells that a cut divides.
    patch_cells : (c, d + 1) int array
        Nodes of the patch's cells.
    patch_nodes : int
        How many these are.
    whole_cells : (c,) int array
        Cells of the mesh.
    parent : (q,) int array
        Place of the cell of each part.
    label : (q, cuts) int8 array
    values : (n, cuts) float array
        Level sets at the nodes.
    solid, old : (q,) arrays
        Whether a part has a volume, and from which piece it comes.
    first_piece : (m,) int array
        Of each cell.

    Returns
    -------
    cell : (p,) int array
    touched, home : (p, d + 1) bool arrays
        Whether a slot is at a node of changed cells, and whether the node lies in the part.
    solid, old : (p,) arrays
        As above, of all pieces.
    """
    count, parts, corners = len(local), len(parent), patch_cells.shape[1]
    inner = np.zeros(patch_nodes, dtype=np.bool_)
    for place in changed:
        for node in patch_cells[place]:
            inner[node] = True
    cell, every_old = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int64)
    every_solid = np.ones(count, dtype=np.bool_)
    touched = np.empty((count, corners), dtype=np.bool_)
    home = np.ones((count, corners), dtype=np.bool_)
    for p in range(count):
        cell[p] = whole_cells[local[p]]
        every_old[p] = first_piece[cell[p]]
        if p < parts:
            every_old[p], every_solid[p] = old[p], solid[p]
        for a in range(corners):
            touched[p, a] = inner[patch_cells[local[p], a]]
            if p >= parts:
                continue
            node = patch_cells[parent[p], a]
            for cut in range(label.shape[1]):
                side = 1 if values[node, cut] >= 0.0 else -1
                home[p, a] = home[p, a] and (label[p, cut] == 0 or label[p, cut] == side)
    return cell, touched, home, every_solid, every_old


@njit(cache=True)
def _place_in(ascending, value):
    """Place of the first that is not below a value (`np.searchsorted` takes longer to compile)."""
    low, high = 0, len(ascending)
    while low < high:
        middle = (low + high) // 2
        if ascending[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def simplices_of(cells, whole_cells, parent, piece, place, fraction):
    """Sub-simplices with a volume in pieces of some cells, cell by cell.

    Parameters
    ----------
    cells : (k,) int array
        Ascending.
    whole_cells, parent, piece : int arrays
        The cell of a sub-simplex is ``whole_cells[parent[piece]]``.
    place : (p,) int array
        Where each piece is stored, -1 for those that are left out.
    fraction : (s,) float array
        Share of each sub-simplex.

    Returns
    -------
    rows : (r,) int array
        Sub-simplices, those of a cell in the order in which they are given.
    bounds : (k, 2) int array
        First place of each cell in `rows`, and one past the last.
    """
    owner, bounds = np.empty(len(piece), dtype=np.int64), np.zeros((len(cells), 2), dtype=np.int64)
    for s in range(len(piece)):
        cell = whole_cells[parent[piece[s]]]
        k = _place_in(cells, cell)
        owner[s] = -1
        has_volume = fraction[s] > 0.0 and place[piece[s]] >= 0
        if has_volume and k < len(cells) and cells[k] == cell:
            owner[s] = k
            bounds[k, 1] += 1
    total = 0
    for k in range(len(cells)):
        bounds[k, 0], total = total, total + bounds[k, 1]
        bounds[k, 1] = bounds[k, 0]
    rows = np.empty(total, dtype=np.int64)
    for s in range(len(piece)):
        if owner[s] >= 0:
            rows[bounds[owner[s], 1]] = s
            bounds[owner[s], 1] += 1
    return rows, bounds


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
