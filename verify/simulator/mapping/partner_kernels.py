"""The piece on the other side of a face: the one that moves with the same unknowns there."""

from numba import njit

__all__ = ["partner"]


@njit(cache=True)
def partner(piece, cell, opposite, body):
    """Give the piece across the face of the cell opposite to a corner, -1 if there is none.

    `body` is as `CutElements`.
    """
    cells, _, neighbours, piece_cells, _, _, first_piece, next_piece = body
    other = neighbours[cell, opposite]
    found = first_piece[other] if other >= 0 else -1
    while found >= 0:
        same = True
        for a in range(cells.shape[1]):
            for b in range(cells.shape[1]):
                if a != opposite and cells[other, b] == cells[cell, a]:
                    same = same and piece_cells[found, b] == piece_cells[piece, a]
        if same:
            return found
        found = next_piece[found]
    return -1
