"""Contact of pieces across faces, and the groups of slots that it joins."""

import numpy as np
from numba import njit

from verify.xfem.arrays.row_numbers import point_on_edge

__all__ = ["join_across_faces", "join_tied", "number_groups", "patch_around"]


@njit(cache=True)
def patch_around(parent, cells, nodes):
    """Cells around the nodes of split cells, and the pieces there.

    Parameters
    ----------
    parent : (q,) int array
        Cell of each piece of the split ones.
    cells : (m, d + 1) int array
    nodes : int
        Number of nodes.

    Returns
    -------
    patch : (c,) int array
        The cells, ascending.
    place : (m,) int array
        Place of each cell among them, -1 if it is not.
    piece_cell : (p,) int array
        Place in `patch` of each piece: those given, then the cells that are not split.
    starts, pieces : (c + 1,), (p,) int arrays
        Pieces of each cell of the patch, ascending.
    """
    split, mark = np.zeros(len(cells), dtype=np.bool_), np.zeros(nodes, dtype=np.bool_)
    for cell in parent:
        split[cell] = True
        for node in cells[cell]:
            mark[node] = True
    patch, place = np.empty(len(cells), dtype=np.int64), np.empty(len(cells), dtype=np.int64)
    count, whole = 0, 0
    for cell in range(len(cells)):
        near = False
        for node in cells[cell]:
            near = near or mark[node]
        place[cell] = -1
        if near:
            place[cell], patch[count] = count, cell
            count += 1
            whole += not split[cell]
    piece_cell = np.empty(len(parent) + whole, dtype=np.int64)
    for p in range(len(parent)):
        piece_cell[p] = place[parent[p]]
    at = len(parent)
    for k in range(count):
        if not split[patch[k]]:
            piece_cell[at] = k
            at += 1
    starts, pieces = np.zeros(count + 1, dtype=np.int64), np.empty(at, dtype=np.int64)
    for p in range(at):
        starts[piece_cell[p] + 1] += 1
    for k in range(count):
        starts[k + 1] += starts[k]
    free = starts[:-1].copy()
    for p in range(at):
        pieces[free[piece_cell[p]]] = p
        free[piece_cell[p]] += 1
    return patch[:count].copy(), place, piece_cell, starts, pieces


@njit(cache=True)
def _root(slot, towards):
    while towards[slot] != slot:
        towards[slot] = towards[towards[slot]]
        slot = towards[slot]
    return slot


@njit(cache=True)
def _fitting(begin, end, pieces, label, side):
    """Give the piece of a cell that has a region of its face: exactly one does, else -1."""
    found = -1
    for k in range(begin, end):
        piece, fits = pieces[k], True
        if piece < len(label):
            for cut in range(len(side)):
                at = label[piece, cut]
                fits = fits and (at == 0 or at == side[cut])
        if fits:
            if found >= 0:
                return -1
            found = piece
    return found


@njit(cache=True)
def _sort_face(stack, top):
    """Order the corners of a region by their numbers."""
    for i in range(1, stack.shape[1]):
        k = i
        while k > 0 and stack[top, k - 1] > stack[top, k]:
            stack[top, k - 1], stack[top, k] = stack[top, k], stack[top, k - 1]
            k -= 1


@njit(cache=True)
def _is_flat(stack, top):
    """Whether a region has no area (2D: length): a zero point that is a corner comes twice."""
    for i in range(1, stack.shape[1]):
        for k in range(i):
            if stack[top, i] == stack[top, k]:
                return True
    return False


@njit(cache=True)
def _next_region(top, stack, level, sides, relevant, values, stairs, edges, asked):
    """Divide the region on top of the stack until one is left that no relevant cut crosses.

    Returns its place, or -1 if a zero point is missing: then `asked` (3,) says which.
    """
    cuts, size = len(relevant), stack.shape[1]
    while level[top] < cuts:
        cut = level[top]
        level[top] += 1
        if not relevant[cut]:
            continue
        _sort_face(stack, top)
        pattern = 0
        for k in range(size):
            if values[stack[top, k], cut] >= 0.0:
                pattern |= 1 << k
        if pattern == 0 or pattern == (1 << size) - 1:
            sides[top, cut] = -1 if pattern == 0 else 1
            continue
        # the parts go above the region, and the last of them then into its place
        begin, end = stairs.start[pattern], stairs.start[pattern + 1]
        for entry in range(begin, end):
            above = top + 1 + entry - begin
            for k in range(size):
                plus = stack[top, stairs.plus[entry, k]]
                minus = stack[top, stairs.minus[entry, k]]
                point = plus
                if plus != minus:
                    point = point_on_edge(cut, plus, minus, edges, asked)
                if point < 0:
                    return -1
                stack[above, k] = point
            for j in range(cuts):
                sides[above, j] = sides[top, j]
            sides[above, cut], level[above] = stairs.side[entry], level[top]
        last = top + end - begin
        for k in range(size):
            stack[top, k] = stack[last, k]
        sides[top, cut] = sides[last, cut]
        top = last - 1
    return top


@njit(cache=True)
def _join(one, other, towards):
    first, second = _root(one, towards), _root(other, towards)
    if first < second:
        towards[second] = first
    else:
        towards[first] = second


@njit(cache=True)
def join_tied(pairs, corners, towards):
    """Join the slots of pairs (t, 2) of pieces of one cell, at all its corners."""
    for k in range(len(pairs)):
        for a in range(corners):
            _join(pairs[k, 0] * corners + a, pairs[k, 1] * corners + a, towards)


@njit(cache=True)
def _join_face(cell, other, skip, p, q, cells, towards):
    """Join the slots of two pieces at the nodes of a face, given by the corner opposite to it."""
    corners = cells.shape[1]
    for a in range(corners):
        if a == skip:
            continue
        for b in range(corners):
            if cells[other, b] == cells[cell, a]:
                _join(p * corners + a, q * corners + b, towards)


@njit(cache=True)
def _find_relevant(here, there, starts, pieces, label, relevant):
    """Write which cuts divide either of two cells (places in the patch); whether any does."""
    some = False
    for cut in range(label.shape[1]):
        relevant[cut] = False
        for c in (here, there):
            for k in range(starts[c], starts[c + 1]):
                if pieces[k] < len(label) and label[pieces[k], cut] != 0:
                    relevant[cut] = some = True
    return some


@njit(cache=True)
def join_across_faces(
    begin, patch, cells, neighbours, place, starts, pieces, label, solid, values, stairs, edges,
    towards,
):  # fmt: skip
    """Join the slots of pieces that touch across faces, from one cell of a patch on.

    Parameters
    ----------
    begin : int
        Place of the first cell whose faces to look at.
    patch, place : int arrays
        Cells, and the place of every cell of the mesh among them or -1.
    starts, pieces : (c + 1,), (p,) int arrays
        Pieces of each cell of the patch; those past the end of `label` are whole cells.
    label : (q, cuts) int8 array
    solid : (q,) bool array
        Whether a piece has a volume; the others join nothing.
    values : (n, cuts) float array
        Level sets at the points.
    stairs : Staircase
        Of a face.
    edges : EdgeTable
    towards : int array
        A smaller slot of the same group, or the slot itself; overwritten.

    Returns
    -------
    begin : int
        Where to go on, the number of cells if all is done.
    asked : (0 or 1, 3) int array
        Cut and ends of a zero point that is needed for that.
    """
    corners, cuts = cells.shape[1], label.shape[1]
    room = 4 * cuts + 4  # each cut leaves at most two regions more to look at
    stack, level = np.empty((room, corners - 1), dtype=np.int64), np.empty(room, dtype=np.int64)
    sides, relevant = np.zeros((room, cuts), dtype=np.int8), np.zeros(cuts, dtype=np.bool_)
    asked = np.empty((1, 3), dtype=np.int64)
    for here in range(begin, len(patch)):
        cell = patch[here]
        for skip in range(corners):
            across = neighbours[cell, skip]
            there = place[across] if across >= 0 else -1
            if there <= here:
                continue
            for cut in range(cuts):
                sides[0, cut] = 0
            if not _find_relevant(here, there, starts, pieces, label, relevant):
                _join_face(
                    cell, across, skip, pieces[starts[here]], pieces[starts[there]], cells, towards
                )
                continue
            level[0], k, top = 0, 0, np.int64(0)
            for a in range(corners):
                if a != skip:
                    stack[0, k] = cells[cell, a]
                    k += 1
            while top >= 0:
                top = _next_region(
                    top, stack, level, sides, relevant, values, stairs, edges, asked[0]
                )
                if top < 0:
                    return here, asked
                if _is_flat(stack, top):
                    top -= 1
                    continue
                p = _fitting(starts[here], starts[here + 1], pieces, label, sides[top])
                q = _fitting(starts[there], starts[there + 1], pieces, label, sides[top])
                if p < 0 or q < 0:
                    raise RuntimeError("the pieces of a cell do not partition the plane of a face")
                if (p >= len(label) or solid[p]) and (q >= len(label) or solid[q]):
                    _join_face(cell, across, skip, p, q, cells, towards)
                top -= 1
    return len(patch), asked[:0]


@njit(cache=True)
def number_groups(towards):
    """Give the number (slots,) of the group of each slot, in the order of their first slots."""
    number, count = np.empty(len(towards), dtype=np.int64), 0
    for slot in range(len(towards)):
        root = _root(slot, towards)
        if root == slot:
            number[slot] = count
            count += 1
        else:
            number[slot] = number[root]
    return number
