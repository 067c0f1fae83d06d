"""Points on lines, and triangles bisected at those on their edges."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.xfem.cutting.point_numbers import runs_through
from verify.xfem.row_numbers import find_row, number_of_row

__all__ = ["CUTS", "LINE", "EdgeRecord", "bisect_facets", "record_points"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

CUTS = 3  # as `PointNumbers.supports` lists them, after the nodes
_NODES = 4
_FACE = 3  # corners of a face
LINE = _FACE + 1  # a line: the nodes of an edge or a face, and the cut that crosses it
_NONE = np.iinfo(np.int64).max


class EdgeRecord(NamedTuple):
    """Points and the lines on which they lie.

    Attributes
    ----------
    nodes : (n, s) float array
        Mesh nodes, in metres.
    positions : (z, s) float array
        Zero points, numbered after these.
    supports : (z, 7) int array
        See `PointNumbers`.
    table, known : int arrays
        Lines by their nodes and cut (`verify.xfem.row_numbers`).
    first : (l,) int array
        First entry of each line.
    entries : (e, 2) int array
        Zero point, and the next entry of the same line or -1.
    directions : (l, s) float array
        Along which the points of a line are ordered; zero until it is first asked for.
    met : tuple of arrays
        Mesh nodes through which cuts run, see `PointNumbers.nodes_on_cuts`.
    """

    nodes: _Floats
    positions: _Floats
    supports: _Ints
    table: _Ints
    known: _Ints
    first: _Ints
    entries: _Ints
    directions: _Floats
    met: tuple[_Ints, _Ints, NDArray[np.bool_]]


@njit(cache=True)
def record_points(zero, supports, table, known, lines, first, entries, used):
    """Enter points into the lists of their lines; the counts of lines and entries."""
    row = np.empty(LINE, dtype=np.int64)
    for z in zero:
        if supports[z, _FACE] != _NONE:
            continue  # inside an element: nobody else meets it
        for k in range(_FACE):
            row[k] = supports[z, k]
        for k in range(_NODES, _NODES + CUTS):
            if supports[z, k] == _NONE:
                continue
            # on an edge of the mesh the cut does not matter
            row[_FACE] = supports[z, k] if row[_FACE - 1] != _NONE else _NONE
            line, lines = number_of_row(row, table, known, lines)
            entries[used, 0], entries[used, 1] = z, first[line]
            first[line] = used
            used += 1
            if row[_FACE] == _NONE:
                break
    return lines, used


@njit(cache=True)
def _join(number, record, row):
    """Insert the mesh nodes of a point into the ascending row[:3]; False if there is no room."""
    nodes = len(record.nodes)
    for k in range(1 if number < nodes else _NODES):
        value = number if number < nodes else record.supports[number - nodes, k]
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


@njit(cache=True)
def _after(at, number, than, other):
    """Whether a point comes after another on a line; equal places are ordered by number."""
    return at > than or (at == than and number > other)


@njit(cache=True)
def _between(x, y, line, record):
    """Give (a point of the line's list strictly between x and y or -1, its share from x to y).

    The order on a line is that of projections on one direction, taken when the line is first
    asked for: points that nearly coincide are in the same order for every facet.
    """
    direction, unset, space = record.directions[line], True, record.nodes.shape[1]
    for i in range(space):
        unset = unset and direction[i] == 0.0
    total, start, end = 0.0, 0.0, 0.0
    for i in range(space):
        a, b = _place(x, i, record), _place(y, i, record)
        if unset:
            direction[i] = b - a
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
def _on_cut(number, cut, record, row):
    """Whether a cut runs exactly through a point."""
    nodes = len(record.nodes)
    if number < nodes:
        return runs_through(cut, number, record.met, row)
    found = False
    for j in range(_NODES, _NODES + CUTS):
        found = found or record.supports[number - nodes, j] == cut
    return found


@njit(cache=True)
def _inner_point(x, y, record, row):
    """Give (a recorded point strictly between x and y or -1, its share from x to y)."""
    nodes = len(record.nodes)
    for k in range(LINE):
        row[k] = _NONE
    if not (_join(x, record, row) and _join(y, record, row)):
        return -1, 0.0
    on_edge = row[_FACE - 1] == _NONE
    for k in range(1 if on_edge else 2 * CUTS):
        if not on_edge:
            # a line in a face of the mesh: of each cut on which x or y lies
            number, other = (x, y) if k < CUTS else (y, x)
            if number < nodes:
                continue
            row[_FACE] = record.supports[number - nodes, _NODES + k % CUTS]
            if row[_FACE] == _NONE:
                continue
            if not _on_cut(other, row[_FACE], record, row[LINE:]):
                continue
        line = find_row(row[:LINE], record.table, record.known)
        if line < 0:
            continue
        z, share = _between(x, y, line, record)
        if z >= 0:
            return z, share
    return -1, 0.0


@njit(cache=True)
def _copy(ids, places, k, into_ids, into_places, at):
    for a in range(3):
        into_ids[at, a] = ids[k, a]
        for i in range(places.shape[2]):
            into_places[at, a, i] = places[k, a, i]


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
        Most triangles to make.

    Returns
    -------
    facets, at : (q, 3), (q, 3, c) arrays
    source : (q,) int array
        Triangle of which each is a part, ascending.
    enough : bool
        Whether there was room for all.
    """
    width = at.shape[2]
    ids, places = np.empty((room, 3), dtype=np.int64), np.empty((room, 3, width))
    open_ids, open_places = np.empty((room, 3), dtype=np.int64), np.empty((room, 3, width))
    source, row = np.empty(room, dtype=np.int64), np.empty(LINE + 2, dtype=np.int64)
    count, top = 0, 1
    for t in range(len(facets)):
        _copy(facets, at, t, open_ids, open_places, 0)
        top = 1
        while top > 0:
            top -= 1
            if count == room or top + 2 > room:
                return ids, places, source, False
            # either it stays, or its two halves are looked at
            _copy(open_ids, open_places, top, ids, places, count)
            z, share, begin, end = np.int64(-1), 0.0, np.int64(0), np.int64(0)
            while z < 0 and end < 3:
                begin, end = end, end + 1
                z, share = _inner_point(ids[count, begin], ids[count, end % 3], record, row)
            if z < 0:
                source[count] = t
                count += 1
                continue
            end %= 3
            for replaced in (begin, end):
                _copy(ids, places, count, open_ids, open_places, top)
                open_ids[top, replaced] = z
                for i in range(width):
                    open_places[top, replaced, i] = (1.0 - share) * places[
                        count, begin, i
                    ] + share * places[count, end, i]
                a, b, c = open_ids[top, 0], open_ids[top, 1], open_ids[top, 2]
                # all three on one line: nothing is left of that half
                if a != b and b != c and c != a:
                    top += 1
    return ids[:count], places[:count], source[:count], True
