"""In which element, and in which piece of it, a material point lies.

A point outside the mesh belongs to the element whose smallest barycentric coordinate at it is
largest; on a common face several elements tie.
"""

import numpy as np
from numba import njit

__all__ = [
    "barycentric",
    "corner_cells",
    "corner_pieces",
    "cut_at",
    "locate",
    "locate_many",
    "place_parts",
]

_DEEP = 128  # twice the height of any heap of boxes
_TIE = 1e-9  # barycentric coordinates: closer than that to a face is on it
_INWARDS = 1e-5  # how far from a corner to the centre of its facet its piece is looked up
_SNAP = 1e-12  # barycentric coordinates below that are zero: the vertex is on the face


@njit(cache=True)
def barycentric(x, cell, tree, out):
    """Write the barycentric coordinates (d + 1,) of x; return the smallest."""
    cells, points, gradients = tree.cells, tree.points, tree.gradients
    smallest, origin = np.inf, points[cells[cell, 0]]
    for a in range(cells.shape[1]):
        value = 1.0 if a == 0 else 0.0
        for i in range(len(x)):
            value += gradients[cell, a, i] * (x[i] - origin[i])
        out[a] = value
        smallest = min(smallest, value)
    return smallest


@njit(cache=True)
def _first_reach(x, reach, tree, stack):
    """Give the reach, doubled until the box of a cell comes within it."""
    low, high, order = tree.low, tree.high, tree.order
    least, top = np.inf, 1
    stack[0] = 1
    while top > 0:
        top -= 1
        node, gap = stack[top], 0.0
        for i in range(len(x)):
            gap = max(gap, low[node, i] - x[i], x[i] - high[node, i])
        if gap >= least:
            continue
        if node < len(order):
            stack[top], stack[top + 1] = 2 * node, 2 * node + 1
            top += 2
        else:
            least = gap
    while reach < least:
        reach *= 2.0
    return reach


@njit(cache=True)
def _cells_about(x, reach, tree, stack, found):
    """Write the cells whose boxes come within reach of x; give their count."""
    low, high, order = tree.low, tree.high, tree.order
    count, top = 0, 1
    stack[0] = 1
    while top > 0:
        top -= 1
        node, apart = stack[top], False
        for i in range(len(x)):
            apart = apart or x[i] < low[node, i] - reach or x[i] > high[node, i] + reach
        if apart:
            continue
        if node < len(order):
            stack[top], stack[top + 1] = 2 * node, 2 * node + 1
            top += 2
        else:
            found[count] = order[node - len(order)]
            count += 1
    return count


@njit(cache=True)
def locate(x, tree):
    """Give the cell of x."""
    reach, low, high, order, cells = tree.reach, tree.low, tree.high, tree.order, tree.cells
    trial, stack = np.empty(cells.shape[1]), np.empty(_DEEP, dtype=np.int64)
    best, at = -np.inf, -1
    while at < 0:
        stack[0], top = 1, 1
        while top > 0:
            top -= 1
            node, apart = stack[top], False
            for i in range(len(x)):
                if x[i] < low[node, i] - reach or x[i] > high[node, i] + reach:
                    apart = True
            if apart:
                continue
            if node < len(order):
                stack[top], stack[top + 1] = 2 * node, 2 * node + 1
                top += 2
                continue
            cell = order[node - len(order)]
            smallest = barycentric(x, cell, tree, trial)
            if smallest > best:
                best, at = smallest, cell
        if at < 0:
            reach = _first_reach(x, 2.0 * reach, tree, stack)
    return at


@njit(cache=True)
def locate_many(places, tree):
    """Cells (q,), barycentric coordinates (q, d + 1)."""
    found = np.empty(len(places), dtype=np.int64)
    at = np.empty((len(places), tree.cells.shape[1]))
    for q in range(len(places)):
        found[q] = locate(places[q], tree)
        barycentric(places[q], found[q], tree, at[q])
    return found, at


@njit(cache=True)
def cut_at(places, cut, tree, body):
    """Whether a cell that holds each place (q, s) is split by a cut.

    `tree` is as `ElementTree`, `body` as `CutElements`.
    """
    piece_label, first_piece, next_piece = body.piece_label, body.first_piece, body.next_piece
    found, count = np.zeros(len(places), dtype=np.bool_), len(tree.order)
    trial, stack = np.empty(tree.cells.shape[1]), np.empty(_DEEP, dtype=np.int64)
    about, least = np.empty(count, dtype=np.int64), np.empty(count)
    for q in range(len(places)):
        count, wider, best = 0, tree.reach, -np.inf
        while count == 0:
            count = _cells_about(places[q], wider, tree, stack, about)
            if count == 0:
                wider = _first_reach(places[q], 2.0 * wider, tree, stack)
        for k in range(count):
            least[k] = barycentric(places[q], about[k], tree, trial)
            best = max(best, least[k])
        for k in range(count):
            if least[k] < min(best, 0.0) - _TIE:
                continue
            piece = first_piece[about[k]]
            while piece >= 0:
                found[q] = found[q] or piece_label[piece, cut] != 0
                piece = next_piece[piece]
    return found


@njit(cache=True)
def _depth(x, cell, least, tree):
    """Give the smallest barycentric coordinate of x, or one that is at most `least`."""
    cells, points, gradients = tree.cells, tree.points, tree.gradients
    smallest, origin, a = np.inf, cells[cell, 0], 0
    while a < cells.shape[1] and smallest > least:
        value = 1.0 if a == 0 else 0.0
        for i in range(len(x)):
            value += gradients[cell, a, i] * (x[i] - points[origin, i])
        smallest = min(smallest, value)
        a += 1
    return smallest


@njit(cache=True)
def _among(x, some, near, tree):
    """Give the cell of x of some cells, as `locate` does of all; -1 if x is in the box of none."""
    best, at = -np.inf, np.int64(-1)
    floor, ceiling, reach = near.floor, near.ceiling, tree.reach
    for cell in some:
        i = 0
        while i < len(x) and floor[cell, i] - reach <= x[i] <= ceiling[cell, i] + reach:
            i += 1
        if i < len(x):
            continue
        smallest = _depth(x, cell, best, tree)
        if smallest > _TIE:  # inside of it, so in no other
            return cell
        if smallest > best:
            best, at = smallest, cell
    return at


@njit(cache=True)
def corner_cells(chosen, corners, facet, likely, near, tree, found, weights, at):
    """Find the cell of each corner of chosen facets, looked up a little inside the facet.

    Of `corners` (q, k, s) those of the facets `chosen` are looked up. Each is a part of a given
    `facet` (q,). Cells that are `likely` (q, n) are tried first: where a place is inside of one,
    it is in no other. Then those `near` the given facet, as `NearCells`: no box of another cell
    holds the place. Writes the cells `found` (q, k), and the coordinates (q, k, d + 1) of the
    corner, `weights`, and of the place inside, `at`.
    """
    cells = tree.cells
    _, size, space = corners.shape
    inside = np.empty(space)
    for q in chosen:
        some = near.cells[near.starts[facet[q]] : near.starts[facet[q] + 1]]
        for k in range(size):
            for i in range(space):
                inside[i] = (1.0 - _INWARDS) * corners[q, k, i]
                for j in range(size):
                    inside[i] += _INWARDS / size * corners[q, j, i]
            cell = np.int64(-1)
            tried = cell
            for trial in likely[q]:
                if trial == tried:
                    continue
                tried = trial
                if _depth(inside, trial, _TIE, tree) > _TIE:
                    cell = trial
                    break
            if cell < 0:
                cell = _among(inside, some, near, tree)
            if cell < 0:
                cell = locate(inside, tree)
            barycentric(inside, cell, tree, at[q, k])
            found[q, k] = cell
            barycentric(corners[q, k], cell, tree, weights[q, k])
            total = 0.0
            for a in range(cells.shape[1]):
                if abs(weights[q, k, a]) <= _SNAP:
                    weights[q, k, a] = 0.0
                total += weights[q, k, a]
            for a in range(cells.shape[1]):
                weights[q, k, a] /= total


@njit(cache=True)
def place_parts(vertices, facets, source, parts, whole, known, near, tree):
    """Find where the corners of parts of facets are, and in which cell.

    Parameters
    ----------
    vertices : (v, s) float array
        Of the given facets.
    facets : (f, k) int array
    source : (q,) int array
        Given facet of which each is a part.
    parts : (q, k, k) float array
        Barycentric coordinates of the corners in it.
    whole : (q,) bool array
        Whether a part is the facet itself, of which all is known.
    known : (f, k), (f, k, d + 1), (f, k, d + 1) arrays
        What `corner_cells` has found for the given facets.
    near : NearCells
    tree : ElementTree

    Returns
    -------
    places : (q, k, s) float array
        In metres.
    cell, weights, at : (q, k), (q, k, d + 1), (q, k, d + 1) arrays
        As `corner_cells` gives them.
    """
    known_cell, known_weights, known_at = known
    cells = tree.cells
    count, size, space = len(source), facets.shape[1], vertices.shape[1]
    places = np.empty((count, size, space))
    cell = np.empty((count, size), dtype=np.int64)
    weights = np.empty((count, size, cells.shape[1]))
    at = np.empty_like(weights)
    chosen, more = np.empty(count, dtype=np.int64), 0
    for q in range(count):
        facet = source[q]
        for k in range(size):
            cell[q, k] = known_cell[facet, k]
            if whole[q]:
                for i in range(space):
                    places[q, k, i] = vertices[facets[facet, k], i]
                for a in range(cells.shape[1]):
                    weights[q, k, a] = known_weights[facet, k, a]
                    at[q, k, a] = known_at[facet, k, a]
            else:
                for i in range(space):
                    place = 0.0
                    for j in range(size):
                        place += parts[q, k, j] * vertices[facets[facet, j], i]
                    places[q, k, i] = place
        if not whole[q]:
            chosen[more] = q
            more += 1
    corner_cells(chosen[:more], places, source, cell.copy(), near, tree, cell, weights, at)
    return places, cell, weights, at


@njit(cache=True)
def corner_pieces(cell, at, label, levels, body):
    """Piece (q, k) of each corner of facets, from its cell and the place `at` inside the facet.

    `label` (q, cuts) are the sides on which the cuts that split a facet have left it; on which
    side of the others a corner is, the level sets (n, cuts) tell.
    """
    cells, piece_label = body.cells, body.piece_label
    first_piece, next_piece = body.first_piece, body.next_piece
    count, size = cell.shape
    found = np.empty((count, size), dtype=np.int64)
    for q in range(count):
        for k in range(size):
            best, best_agree, piece = -1, 0, first_piece[cell[q, k]]
            while piece >= 0:
                agree = 0
                for cut in range(piece_label.shape[1]):
                    if piece_label[piece, cut] == 0:
                        continue
                    side = label[q, cut]
                    if side == 0:
                        level = 0.0
                        for a in range(cells.shape[1]):
                            level += at[q, k, a] * levels[cells[cell[q, k], a], cut]
                        side = 1 if level >= 0.0 else -1
                    # of all pieces the right one agrees with every cut; else the nearest to it
                    agree += 1 if side == piece_label[piece, cut] else -1000
                if best == -1 or agree > best_agree:
                    best, best_agree = piece, agree
                piece = next_piece[piece]
            found[q, k] = best
    return found
