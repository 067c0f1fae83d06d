"""Test of a point of a virtual element: is it in its piece's share of the material."""

from numba import njit

__all__ = ["is_material"]


@njit(cache=True)
def is_material(piece, cell, at, cells, piece_label, levels):
    """Whether the level sets at barycentric coordinates have the signs of the piece."""
    for cut in range(piece_label.shape[1]):
        if piece_label[piece, cut] == 0:
            continue
        level = 0.0
        for a in range(len(at)):
            level += at[a] * levels[cells[cell, a], cut]
        if (level >= 0.0) != (piece_label[piece, cut] > 0):
            return False
    return True
