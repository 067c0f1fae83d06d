"""From where a tool is to the material that is there: the inverse of the deformation.

Tools move in the present, cuts are made in the material frame. A point is followed from piece to
piece through faces whose unknowns they share, so it never passes through a cut.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from verify.xfem.cutting.growing_body import GrowingBody
from verify.xfem.errors import XfemError
from verify.xfem.mapping.partner_kernels import partner

__all__ = ["pull_back"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


def pull_back(
    body: GrowingBody, displacement: _Floats, points: ArrayLike, start: ArrayLike
) -> tuple[_Floats, _Ints]:
    """Material position of points in the deformed body.

    Parameters
    ----------
    body : GrowingBody
    displacement : (N, s) float array
        Of the unknown nodes, in metres.
    points : (q, s) array_like
        Where the tool is, in metres.
    start : (q,) array_like of int
        Piece from which to look for each: that of the last contact (`Contacts.piece`).

    Returns
    -------
    material : (q, s) float array
        Of a point outside the body: as if its last piece went on.
    piece : (q,) int array
        Piece in which it lies; -1 outside the body, or where the walk was lost in inverted
        elements.

    Raises
    ------
    XfemError
        If shapes do not match.
    """
    places = np.ascontiguousarray(points, dtype=float)
    pieces = np.ascontiguousarray(start, dtype=np.int64)
    space = body.mesh.space
    if places.shape != (len(pieces), space) or displacement.shape != (body.node_count, space):
        raise XfemError(
            f"points {places.shape}, pieces {pieces.shape}, displacement {displacement.shape}; "
            f"expected (q, {space}), (q,), ({body.node_count}, {space})"
        )
    if len(pieces) and not 0 <= pieces.min() <= pieces.max() < len(body.piece_cells):
        raise XfemError(f"a starting piece outside 0..{len(body.piece_cells) - 1}")
    return _pull_back(
        places,
        pieces,
        displacement,
        body.mesh.points,
        body.mesh.cells,
        body.mesh.neighbours,
        body.piece_cells.rows,
        body.piece_parent.rows,
        body.first_piece,
        body.next_piece.rows,
    )


@njit(cache=True)
def _pull_back(
    places, pieces, displacement, points, cells, neighbours,
    piece_cells, piece_parent, first_piece, next_piece,
):  # fmt: skip
    count, space = places.shape
    corners = cells.shape[1]
    material, found = np.zeros((count, space)), np.full(count, -1)
    matrix, right = np.empty((corners, corners)), np.ones(corners)
    for q in range(count):
        piece = pieces[q]
        for _ in range(len(cells)):
            cell = piece_parent[piece]
            for a in range(corners):
                matrix[corners - 1, a] = 1.0
                for i in range(space):
                    matrix[i, a] = (
                        points[cells[cell, a], i] + displacement[piece_cells[piece, a], i]
                    )
            right[:space] = places[q]
            at = np.linalg.solve(matrix, right)
            material[q] = 0.0
            for a in range(corners):
                material[q] += at[a] * points[cells[cell, a]]
            # out through the face that is farthest behind; if that is free, through the next
            across, outside = -1, False
            for a in np.argsort(at):
                if at[a] >= -1e-12:
                    break
                outside = True
                across = partner(
                    piece, cell, a, cells, neighbours, piece_cells, first_piece, next_piece
                )
                if across >= 0:
                    break
            if not outside:
                found[q] = piece
                break
            if across < 0:
                break
            piece = across
    return material, found
