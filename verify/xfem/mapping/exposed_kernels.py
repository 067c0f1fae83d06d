"""Facets of elements and of their sub-simplices that lie on the surface of the material."""

import numpy as np
from numba import njit

from verify.xfem.mapping.partner_kernels import partner

__all__ = ["exposed_facets"]


@njit(cache=True)
def _same_set(a, skip_a, b, skip_b):
    for i in range(len(a)):
        if i == skip_a:
            continue
        found = False
        for j in range(len(b)):
            found = found or (j != skip_b and a[i] == b[j])
        if not found:
            return False
    return True


@njit(cache=True)
def _face_of(barycentric, skip):
    """Corner opposite to the face of the element in which a facet lies, or -1."""
    for a in range(barycentric.shape[1]):
        flat = True
        for k in range(barycentric.shape[0]):
            flat = flat and (k == skip or barycentric[k, a] == 0.0)
        if flat:
            return a
    return -1


@njit(cache=True)
def exposed_facets(
    wanted, split, cells, neighbours, piece_cells, first_piece, next_piece,
    sub_range, sub_piece, sub_points, sub_barycentric, sub_sign, orientation,
):  # fmt: skip
    """Facets of these cells on the surface of the material.

    Returns for each: point numbers (q, d), barycentric corners (q, d, d + 1), piece, cell,
    and whether it lies on a cut. Facets are oriented outwards.
    """
    corners = cells.shape[1]
    room = 0
    for cell in wanted:
        room += corners * max(1, sub_range[cell, 1] - sub_range[cell, 0])
    ids = np.empty((room, corners - 1), dtype=np.int64)
    at = np.zeros((room, corners - 1, corners))
    piece_of, cell_of = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64)
    inner = np.empty(room, dtype=np.bool_)
    count = 0
    for cell in wanted:
        begin, end = sub_range[cell, 0], sub_range[cell, 1]
        if not split[cell]:
            piece = first_piece[cell]
            for a in range(corners):
                other = partner(
                    piece, cell, a, cells, neighbours, piece_cells, first_piece, next_piece
                )
                if other >= 0:
                    continue
                k = 0
                for b in range(corners):
                    if b != a:
                        ids[count, k], at[count, k, b] = cells[cell, b], 1.0
                        k += 1
                piece_of[count], cell_of[count] = piece, cell
                inner[count] = neighbours[cell, a] >= 0
                _turn(ids[count], at[count], orientation[cell], a)
                count += 1
            continue
        for s in range(begin, end):
            for skip in range(corners):
                lonely = True
                for t in range(begin, end):
                    if t == s or sub_piece[t] != sub_piece[s]:
                        continue
                    for other in range(corners):
                        if _same_set(sub_points[s], skip, sub_points[t], other):
                            lonely = False
                if not lonely:
                    continue
                face = _face_of(sub_barycentric[s], skip)
                other = -1
                if face >= 0:
                    other = partner(
                        sub_piece[s], cell, face, cells, neighbours, piece_cells, first_piece,
                        next_piece,
                    )  # fmt: skip
                if other >= 0:
                    continue
                k = 0
                for b in range(corners):
                    if b != skip:
                        ids[count, k] = sub_points[s, b]
                        for a in range(corners):
                            at[count, k, a] = sub_barycentric[s, b, a]
                        k += 1
                piece_of[count], cell_of[count] = sub_piece[s], cell
                inner[count] = face < 0 or neighbours[cell, face] >= 0
                _turn(ids[count], at[count], orientation[cell] * sub_sign[s], skip)
                count += 1
    return ids[:count], at[:count], piece_of[:count], cell_of[:count], inner[:count]


@njit(cache=True)
def _turn(ids, at, sign, skipped):
    """Orient the facet opposite to a corner of a simplex of that orientation outwards."""
    if (sign > 0) == (skipped % 2 == 0):
        return
    ids[0], ids[1] = ids[1], ids[0]
    for a in range(at.shape[1]):
        at[0, a], at[1, a] = at[1, a], at[0, a]
