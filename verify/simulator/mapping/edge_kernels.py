"""Points on lines, and triangles bisected at those on their edges."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.simulator.arrays.row_numbers import find_row, number_of_row
from verify.simulator.cutting.point_numbers import CUTS, NODES

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_FACE = 3  # corners of a face
LINE = _FACE + 1  # a line: the nodes of an edge or a face, and the cut that crosses it
_NONE = np.iinfo(np.int64).max
_SHORT = 1e-2  # of an edge: what has given a line its direction was too short to be trusted


class EdgeRecord(NamedTuple):
    """Points and the lines on which they lie.

    Attributes
    ----------
    nodes : (n, s) float array
        Mesh nodes, in metres.
    crossed, faced : (n,) bool array
        Whether an edge at the node has a point, and whether a face there has one inside.
    edge_line : (z,) int array
        Line of the edge of the mesh on which each zero point lies, -1 if it is on none.
    positions : (z, s) float array
        Zero points, numbered after these.
    supports : (z, 7) int array
        See `PointNumbers`.
    table, known : int arrays
        Lines by their nodes and cut (`verify.simulator.arrays.row_numbers`).
    first, tally : (l,) int array
        First entry of each line, and how many it has.
    entries : (e, 2) int array
        Zero point, and the next entry of the same line or -1.
    directions : (l, s) float array
        Along which the points of a line are ordered; zero until it is first asked for.
    turned : (1,) int array
        How often a direction was replaced: what was bisected before must be bisected anew.
    met : (n, cuts) bool array
        See `PointNumbers`.
    """

    nodes: _Floats
    crossed: NDArray[np.bool_]
    faced: NDArray[np.bool_]
    edge_line: _Ints
    positions: _Floats
    supports: _Ints
    table: _Ints
    known: _Ints
    first: _Ints
    tally: _Ints
    entries: _Ints
    directions: _Floats
    turned: _Ints
    met: NDArray[np.bool_]


@njit(inline="always")
def _write_ends(x, y, row):
    """Write the row of the edge between two points, none of which is that of a line."""
    row[0], row[1], row[2], row[_FACE] = -1, min(x, y), max(x, y), _NONE


@njit(cache=True)
def record_points(zero, ends, record, lines, used):
    """Enter points into the lists of their lines; the counts of lines and entries."""
    supports, first, tally, entries = record.supports, record.first, record.tally, record.entries
    row = np.empty(LINE, dtype=np.int64)
    for z in zero:
        if supports[z, _FACE] != _NONE:
            continue  # inside an element: nobody else meets it
        # in a face, where the edge on which it was found may be a diagonal; then on cuts
        in_face = supports[z, _FACE - 1] != _NONE
        k = NODES - 1 if in_face else NODES
        while k < NODES + CUTS:
            if k < NODES:
                for j in range(_FACE):
                    record.faced[supports[z, j]] = True
                _write_ends(ends[z, 0], ends[z, 1], row)
            else:
                # on an edge of the mesh the cut does not matter
                for j in range(_FACE):
                    row[j] = supports[z, j]
                row[_FACE] = supports[z, k] if in_face else _NONE
            if k < NODES or supports[z, k] != _NONE:
                line, lines = number_of_row(row, record.table, record.known, lines)
                entries[used, 0], entries[used, 1] = z, first[line]
                first[line] = used
                tally[line] += 1
                used += 1
                if row[_FACE] == _NONE and row[0] >= 0:
                    record.crossed[row[0]] = record.crossed[row[1]] = True
                    record.edge_line[z] = line
                    break
            k += 1
    return lines, used


@njit(cache=True)
def _join(number, nodes, supports, row):
    """Insert the mesh nodes of a point into the ascending row[:3]; False if there is no room."""
    for k in range(1 if number < nodes else NODES):
        value = number if number < nodes else supports[number - nodes, k]
        for j in range(_FACE):
            if row[j] == value:
                value = _NONE
            if row[j] > value:
                value, row[j] = row[j], value
        if value != _NONE:
            return False
    return True


@njit(cache=True)
def _place(number, i, record):
    nodes = len(record.nodes)
    return record.nodes[number, i] if number < nodes else record.positions[number - nodes, i]


@njit(inline="always")
def _after(at, number, than, other):
    """Whether a point comes after another on a line; equal places are ordered by number."""
    return at > than or (at == than and number > other)


@njit(cache=True)
def _direct(x, y, line, record):
    """Set the direction of a line if it has none, or one from points that nearly coincide.

    That of an edge of the mesh is the edge's. Else it leads from one end of the edge that is asked
    for to the farthest point known, and is replaced once there is one far beyond: what is 1e-14
    long may point anywhere.
    """
    direction, space, nodes = record.directions[line], record.nodes.shape[1], len(record.nodes)
    known = 0.0
    for i in range(space):
        known += direction[i] ** 2
    if record.known[line, 0] >= 0 and record.known[line, _FACE - 1] == _NONE:
        if known > 0.0:
            return
        x, y = record.known[line, 0], record.known[line, 1]
    far, longest, entry = y, 0.0, record.first[line]
    while True:
        length = 0.0
        for i in range(space):
            length += (_place(y, i, record) - _place(x, i, record)) ** 2
        if length > longest:
            far, longest = y, length
        if entry < 0:
            break
        y, entry = nodes + record.entries[entry, 0], record.entries[entry, 1]
    if known >= _SHORT**2 * longest:
        return
    along = 0.0
    for i in range(space):
        along += (_place(far, i, record) - _place(x, i, record)) * direction[i]
    record.turned[0] += known > 0.0
    for i in range(space):
        step = _place(far, i, record) - _place(x, i, record)
        direction[i] = step if along >= 0.0 else -step


@njit(inline="always")
def _between(x, y, line, record):
    """Give (a point of the line's list strictly between x and y or -1, its share from x to y).

    The order on a line is that of projections on one direction: points that nearly coincide are in
    the same order for every facet.
    """
    _direct(x, y, line, record)
    direction, space = record.directions[line], record.nodes.shape[1]
    total, start, end = 0.0, 0.0, 0.0
    for i in range(space):
        a, b = _place(x, i, record), _place(y, i, record)
        total += (b - a) ** 2
        start += a * direction[i]
        end += b * direction[i]
    forward = _after(end, y, start, x)
    entry = record.first[line]
    while entry >= 0:
        z = len(record.nodes) + record.entries[entry, 0]
        entry = record.entries[entry, 1]
        if z == x or z == y:  # noqa: SIM109 - `in` takes longer to compile
            continue
        at, along = 0.0, 0.0
        for i in range(space):
            a, b, c = _place(x, i, record), _place(y, i, record), _place(z, i, record)
            at += c * direction[i]
            along += (c - a) * (b - a)
        if _after(at, z, start, x) == forward and _after(end, y, at, z) == forward:
            return z, min(max(along / total, 0.0), 1.0) if total > 0.0 else 0.5
    return -1, 0.0


@njit(cache=True)
def _on_cut(number, line, record):
    """Whether a point lies on the cut of a line, if that is a line in a face."""
    nodes, cut = len(record.nodes), record.known[line, _FACE]
    if cut == _NONE:
        return True
    if number < nodes:
        return record.met[number, cut]
    found = False
    for j in range(NODES, NODES + CUTS):
        found = found or record.supports[number - nodes, j] == cut
    return found


@njit(inline="always")
def _lines(x, y, record, row, found):
    """Write the lines on which an edge may lie that have other points than its ends; their count.

    A line in a face holds no points on edges of the mesh, which are on the lines of these.
    """
    nodes, supports, faced, own = len(record.nodes), record.supports, record.faced, 0
    table, known, tally = record.table, record.known, record.tally
    row[_FACE - 1] = row[_FACE] = _NONE
    if x < nodes and y < nodes:  # nearly always: an edge of the mesh
        row[0], row[1] = min(x, y), max(x, y)
    else:
        row[0] = row[1] = _NONE
        if not (_join(x, nodes, supports, row) and _join(y, nodes, supports, row)):
            return 0
    if row[_FACE - 1] == _NONE:
        zero = max(x, y) - nodes
        found[0] = record.edge_line[zero] if zero >= 0 else -1
        if found[0] < 0:
            found[0] = find_row(row, table, known)
        own = (x >= nodes) + (y >= nodes)
        return 1 if found[0] >= 0 and tally[found[0]] > own else 0
    if not (faced[row[0]] and faced[row[1]] and faced[row[_FACE - 1]]):
        return 0
    # in a face of the mesh: of each cut on which x lies, or y if x is a mesh node
    number, count = (x if x >= nodes else y) - nodes, 0
    for end in (x, y):
        own += end >= nodes and supports[end - nodes, _FACE - 1] != _NONE
    for k in range(NODES, NODES + CUTS):
        row[_FACE] = supports[number, k]
        if row[_FACE] != _NONE:
            found[count] = find_row(row, table, known)
            count += found[count] >= 0 and tally[found[count]] > own
    _write_ends(x, y, row)
    found[count] = find_row(row, table, known)
    count += found[count] >= 0
    return count


@njit(inline="always")
def _copy(ids, places, k, into_ids, into_places, at):
    for a in range(3):
        into_ids[at, a] = ids[k, a]
        for i in range(places.shape[2]):
            into_places[at, a, i] = places[k, a, i]


@njit(inline="always")
def _replace(ids, places, k, begin, end, replaced, z, share):
    """Move a corner of a triangle to a point of its edge; whether it is still a triangle."""
    for i in range(places.shape[2]):
        places[k, replaced, i] = (1.0 - share) * places[k, begin, i] + share * places[k, end, i]
    ids[k, replaced] = z
    # else all three are on one line: nothing is left of it
    return ids[k, 0] != ids[k, 1] and ids[k, 1] != ids[k, 2] and ids[k, 2] != ids[k, 0]


@njit(cache=True)
def bisect_facets(facets, at, record, room):
    """Bisect triangles (t, 3) at all recorded points on their edges.

    Parameters
    ----------
    facets : (t, 3) int array
    at : (t, 3, c) float array
        Coordinates of their corners, of any kind.
    record : EdgeRecord
    room : int
        Most triangles to make, more than are given.

    Returns
    -------
    facets, at : (q, 3), (q, 3, c) arrays
    source : (q,) int array
        Triangle of which each is a part, ascending.
    enough : bool
        Whether there was room for all.
    """
    width, nodes, more = at.shape[2], len(record.nodes), room - len(facets)
    ids, places = np.empty((room, 3), dtype=np.int64), np.empty((room, 3, width))
    later_ids, later_places = np.empty((more, 3), dtype=np.int64), np.empty((more, 3, width))
    source, row = np.empty(room, dtype=np.int64), np.empty(LINE, dtype=np.int64)
    lines = np.empty(CUTS + 1, dtype=np.int64)
    crossed = record.crossed
    zero = np.int64(0)  # a literal 0 would be a type of its own to compile for
    count = zero
    for t in range(len(facets)):
        if count == room:
            return ids, places, source, False
        _copy(facets, at, t, ids, places, count)
        top, k, whole = zero, zero, True
        while whole or top > 0:
            if not whole:
                top -= 1
                _copy(later_ids, later_places, top, ids, places, count)
                k, whole = zero, True
            z, share, begin = np.int64(-1), 0.0, zero
            while z < 0 and k < 3:
                begin, x, y = k, ids[count, k], ids[count, (k + 1) % 3]
                k += 1
                if x < nodes and y < nodes and not (crossed[x] and crossed[y]):
                    continue
                for n in range(_lines(x, y, record, row, lines)):
                    line = lines[n]
                    if z < 0 and _on_cut(x, line, record) and _on_cut(y, line, record):
                        z, share = _between(x, y, line, record)
            if z < 0:
                source[count] = t
                count += 1
                whole = False
                if top > 0 and count == room:
                    return ids, places, source, False
                continue
            if top == more:
                return ids, places, source, False
            end, k = (begin + 1) % 3, zero
            _copy(ids, places, count, later_ids, later_places, top)
            top += _replace(later_ids, later_places, top, begin, end, begin, z, share)
            whole = _replace(ids, places, count, begin, end, end, z, share)
    return ids[:count], places[:count], source[:count], True
