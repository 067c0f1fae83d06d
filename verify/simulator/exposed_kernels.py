"""Facets of elements and of their sub-simplices that lie on the surface of the material."""

from typing import NamedTuple

import numpy as np
from numba import njit

from verify.simulator.growing_body import GrowingBody
from verify.xfem.arrays import Floats, Ints, Sides


class CutElements(NamedTuple):
    """Elements of a mesh and their pieces; see `GrowingBody`."""

    cells: Ints
    neighbours: Ints
    piece_cells: Ints
    first_piece: Ints
    next_piece: Ints


class SubSimplices(NamedTuple):
    """Sub-simplices of split elements, of each by `sub_range` (m, 2); see `GrowingBody`."""

    sub_range: Ints
    sub_piece: Ints
    sub_points: Ints
    sub_barycentric: Floats
    sub_sign: Sides


def cut_elements(body: GrowingBody) -> CutElements:
    """Collect the elements of a body as it is now."""
    mesh = body.mesh
    return CutElements(
        mesh.cells, mesh.neighbours, body.piece_cells.rows, body.first_piece, body.next_piece.rows
    )  # fmt: skip


def sub_simplices(body: GrowingBody) -> SubSimplices:
    """Collect the sub-simplices of a body as it is now."""
    return SubSimplices(
        body.sub_range, body.sub_piece.rows, body.sub_points.rows, body.sub_barycentric.rows,
        body.sub_sign.rows,
    )  # fmt: skip


@njit(cache=True)
def _same_facet(s, skip, t, other, sub_points):
    """Tell whether the facets of two simplices opposite to these corners have the same points."""
    corners, same = sub_points.shape[1], True
    for i in range(corners):
        found = i == skip
        for j in range(corners):
            found = found or (j != other and sub_points[s, i] == sub_points[t, j])
        same = same and found
    return same


@njit(inline="always")
def _find_facet(s, skip, begin, end, sub_points):
    """Give another simplex from `begin` to `end` with the facet of s opposite to `skip`, or -1."""
    corners, total = sub_points.shape[1], -sub_points[s, skip]
    for k in range(corners):
        total += sub_points[s, k]
    for t in range(begin, end):
        if t == s:
            continue
        rest = -total
        for k in range(corners):
            rest += sub_points[t, k]
        for other in range(corners):
            # the sums tell most facets apart
            if sub_points[t, other] == rest and _same_facet(s, skip, t, other, sub_points):
                return t
    return -1


@njit(inline="always")
def _mark_shared(begin, end, sub_piece, sub_points, sums, shared):
    """Mark the facets (k, d + 1) that two simplices of one piece share; `sums` (k,) is room."""
    corners = sub_points.shape[1]
    for s in range(begin, end):
        sums[s - begin] = 0
        for k in range(corners):
            sums[s - begin] += sub_points[s, k]
            shared[s - begin, k] = False
    for s in range(begin, end):
        for t in range(s + 1, end):
            if sub_piece[t] != sub_piece[s]:
                continue
            more = sums[t - begin] - sums[s - begin]
            for skip in range(corners):
                for other in range(corners):
                    # the sums tell most facets apart
                    apart = sub_points[t, other] - sub_points[s, skip] != more
                    if not apart and _same_facet(s, skip, t, other, sub_points):
                        shared[s - begin, skip] = shared[t - begin, other] = True


@njit(cache=True)
def _face_of(barycentric, skip):
    """Find the corner opposite to the face of the element in which a facet lies, or -1."""
    for a in range(barycentric.shape[1]):
        flat = True
        for k in range(barycentric.shape[0]):
            flat = flat and (k == skip or barycentric[k, a] == 0.0)
        if flat:
            return a
    return -1


@njit(cache=True)
def _meets(piece, other, cell, across, opposite, body):
    """Tell whether pieces of two cells move together at the nodes of the face between these."""
    cells, piece_cells, same = body.cells, body.piece_cells, True
    for a in range(cells.shape[1]):
        for b in range(cells.shape[1]):
            if a != opposite and cells[across, b] == cells[cell, a]:
                same = same and piece_cells[other, b] == piece_cells[piece, a]
    return same


@njit(cache=True)
def _partner(piece, cell, opposite, body):
    """Give the piece across the face of the cell opposite to a corner, -1 if there is none."""
    across = body.neighbours[cell, opposite]
    found = body.first_piece[across] if across >= 0 else -1
    while found >= 0 and not _meets(piece, found, cell, across, opposite, body):
        found = body.next_piece[found]
    return found


@njit(inline="always")
def _is_whole(points, skip, nodes):
    """Tell whether a facet is a whole face of the element: all its points are nodes."""
    whole = True
    for k in range(len(points)):
        node = k == skip
        for a in range(len(nodes)):
            node = node or points[k] == nodes[a]
        whole = whole and node
    return whole


@njit(cache=True)
def _beyond(piece, cell, opposite, body, parts, orientation, out, count):
    """Expose parts of a whole face beyond which there is a piece that moves otherwise.

    They are the facets of the cell across, turned about. Gives the count of facets.
    """
    ids, at, piece_of, cell_of, inner = out
    sub_range, sub_piece, sub_points, sub_barycentric, sub_sign = parts
    cells, neighbours = body.cells, body.neighbours
    across, corners = neighbours[cell, opposite], cells.shape[1]
    for s in range(sub_range[across, 0], sub_range[across, 1]):
        if _meets(piece, sub_piece[s], cell, across, opposite, body):
            continue
        for skip in range(corners):
            face = _face_of(sub_barycentric[s], skip)
            if face < 0 or neighbours[across, face] != cell:
                continue
            k = 0
            for v in range(corners):
                if v == skip:
                    continue
                ids[count, k] = sub_points[s, v]
                for b in range(corners):
                    at[count, k, b] = 0.0
                    for j in range(corners):
                        if cells[across, j] == cells[cell, b]:
                            at[count, k, b] = sub_barycentric[s, v, j]
                k += 1
            piece_of[count], cell_of[count], inner[count] = piece, cell, True
            _turn(ids[count], at[count], -orientation[across] * sub_sign[s], skip)
            count += 1
    return count


@njit(cache=True)
def _whole_facet(cell, across, body, parts):
    """Give the simplex of the cell across of which their whole face is one facet, or -1."""
    for t in range(parts.sub_range[across, 0], parts.sub_range[across, 1]):
        for other in range(body.cells.shape[1]):
            face = _face_of(parts.sub_barycentric[t], other)
            if face < 0 or body.neighbours[across, face] != cell:
                continue
            if _is_whole(parts.sub_points[t], other, body.cells[across]):
                return t
    return -1


@njit(cache=True)
def _is_parted(cell, across, body, parts):
    """Tell whether pieces that move otherwise meet in facets that one side of a face has alone.

    A cut that ends between two cells may have divided one of them since, and pieces of round-off
    size go with others: then the facets differ. Then both sides show all facets without an equal,
    as otherwise the hidden parts could differ in size and leave a gap in the surface. Where all of
    them move together, none is shown.
    """
    sub_range, sub_piece, sub_points, sub_barycentric, _ = parts
    own, beyond = sub_range[cell], sub_range[across]
    for s in range(own[0], own[1]):
        for skip in range(sub_points.shape[1]):
            face = _face_of(sub_barycentric[s], skip)
            if face < 0 or body.neighbours[cell, face] != across:
                continue
            if _find_facet(s, skip, beyond[0], beyond[1], sub_points) >= 0:
                continue
            for t in range(beyond[0], beyond[1]):
                for other in range(sub_points.shape[1]):
                    back = _face_of(sub_barycentric[t], other)
                    if back < 0 or body.neighbours[across, back] != cell:
                        continue
                    if _find_facet(t, other, own[0], own[1], sub_points) >= 0:
                        continue
                    if not _meets(sub_piece[s], sub_piece[t], cell, across, face, body):
                        return True
    return False


@njit(inline="always")
def _rows(room, corners):
    """Point numbers, barycentric corners, piece, cell and whether on a cut, not yet written."""
    return (
        np.empty((room, corners - 1), dtype=np.int64),
        np.empty((room, corners - 1, corners)),
        np.empty(room, dtype=np.int64),
        np.empty(room, dtype=np.int64),
        np.empty(room, dtype=np.bool_),
    )


@njit(cache=True)
def _write_facet(points, at, skip, whose, sign, out, count):
    """Expose the facet of a simplex opposite to a corner; `whose` is piece, cell, if on a cut."""
    k = 0
    for b in range(len(points)):
        if b == skip:
            continue
        out[0][count, k] = points[b]
        for a in range(len(points)):
            out[1][count, k, a] = at[b, a]
        k += 1
    out[2][count], out[3][count], out[4][count] = whose
    _turn(out[0][count], out[1][count], sign, skip)
    return count + 1


@njit(inline="always")
def _expose_whole(cell, split, body, parts, orientation, unit, out, count):
    """Expose the facets of an element that is not split; give the count of facets."""
    piece = body.first_piece[cell]
    for a in range(body.cells.shape[1]):
        across = body.neighbours[cell, a]
        if _partner(piece, cell, a, body) < 0:
            whose = (piece, cell, across >= 0)
            count = _write_facet(body.cells[cell], unit, a, whose, orientation[cell], out, count)
        elif split[across]:
            count = _beyond(piece, cell, a, body, parts, orientation, out, count)
    return count


@njit(inline="always")
def _expose_split(cell, body, parts, orientation, shared, out, count):
    """Expose facets of sub-simplices that no other of their piece shares; give the count."""
    sub_range, sub_piece, sub_points, sub_barycentric, sub_sign = parts
    neighbours = body.neighbours
    begin, end = sub_range[cell, 0], sub_range[cell, 1]
    for s in range(begin, end):
        for skip in range(sub_points.shape[1]):
            if shared[s - begin, skip]:
                continue
            piece, face = sub_piece[s], _face_of(sub_barycentric[s], skip)
            across = neighbours[cell, face] if face >= 0 else -1
            if across >= 0 and _partner(piece, cell, face, body) >= 0:
                # the same facet of the cell across may belong to a piece that moves otherwise
                begin_across, end_across = sub_range[across, 0], sub_range[across, 1]
                same = _find_facet(s, skip, begin_across, end_across, sub_points)
                whole = _is_whole(sub_points[s], skip, body.cells[cell])
                parted = False
                if same < 0 and not whole:
                    same = _whole_facet(cell, across, body, parts)
                    parted = same < 0 and _is_parted(cell, across, body, parts)
                if not parted and (
                    same < 0 or _meets(piece, sub_piece[same], cell, across, face, body)
                ):
                    if whole:
                        count = _beyond(piece, cell, face, body, parts, orientation, out, count)
                    continue
            whose = (piece, cell, face < 0 or across >= 0)
            sign = orientation[cell] * sub_sign[s]
            count = _write_facet(sub_points[s], sub_barycentric[s], skip, whose, sign, out, count)
    return count


@njit(cache=True)
def exposed_facets(wanted, split, body, parts, orientation):
    """Find facets of these cells on the surface of the material.

    Returns for each: point numbers (q, d), barycentric corners (q, d, d + 1), piece, cell, and
    whether it lies on a cut. Facets are oriented outwards. `body` is as `CutElements`, `parts` as
    `SubSimplices`, `orientation` (m,) counts by element.
    """
    sub_range, sub_piece, sub_points = parts.sub_range, parts.sub_piece, parts.sub_points
    corners, most, longest = body.cells.shape[1], 0, 1
    for cell in wanted:
        own = sub_range[cell, 1] - sub_range[cell, 0]
        most += corners * max(1, own)
        longest = max(longest, own)
        for a in range(corners):
            across = body.neighbours[cell, a]
            if across >= 0:
                most += corners * (sub_range[across, 1] - sub_range[across, 0])
    out, count = _rows(most, corners), np.int64(0)
    unit = np.empty((corners, corners))
    for a in range(corners):
        for b in range(corners):
            unit[a, b] = 1.0 if a == b else 0.0
    sums = np.empty(longest, dtype=np.int64)
    shared = np.empty((longest, corners), dtype=np.bool_)
    for cell in wanted:
        if split[cell]:
            begin, end = sub_range[cell, 0], sub_range[cell, 1]
            _mark_shared(begin, end, sub_piece, sub_points, sums, shared)
            count = _expose_split(cell, body, parts, orientation, shared, out, count)
        else:
            count = _expose_whole(cell, split, body, parts, orientation, unit, out, count)
    ids, at, piece_of, cell_of, inner = out
    return ids[:count], at[:count], piece_of[:count], cell_of[:count], inner[:count]


@njit(cache=True)
def _turn(ids, at, sign, skipped):
    """Orient the facet opposite to a corner of a simplex of that orientation outwards."""
    if (sign > 0) == (skipped % 2 == 0):
        return
    ids[0], ids[1] = ids[1], ids[0]
    for a in range(at.shape[1]):
        at[0, a], at[1, a] = at[1, a], at[0, a]
