"""From where a tool is to the material that is there: the inverse of the deformation.

Tools move in the present, cuts are made in the material frame. A point is followed from piece to
piece through faces whose unknowns they share, so it never passes through a cut.
"""

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.cut_elements import cut_elements
from verify.simulator.mapping.material_share_kernels import is_material
from verify.simulator.mapping.membrane_pull_back_kernels import pull_back_to_membrane
from verify.simulator.mapping.partner_kernels import partner
from verify.simulator.simplex_kernels import signed_volume
from verify.xfem.errors import XfemError

__all__ = ["pull_back"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_ON_FACE = -1e-12  # barycentric coordinates: that far outside is on the face


def pull_back(
    cutter: SemiProgressiveCutter, displacement: _Floats, points: ArrayLike, start: ArrayLike
) -> tuple[_Floats, _Ints]:
    """Material position of points in the deformed body.

    A membrane does not fill the space in which its tool moves: there it is the nearest material
    point that is found, by a walk down in distance from the starting piece. Where a membrane is
    folded so that a path of nearer and nearer points does not lead to the nearest of all, start
    from the piece of a contact (`SurfaceCollider.nearest`), which is a global search.

    Parameters
    ----------
    cutter : SemiProgressiveCutter
    displacement : (N, s) float array
        Of the dof nodes, in metres.
    points : (q, s) array_like
        Where the tool is, in metres.
    start : (q,) array_like of int
        Piece from which to look for each: that of the last contact (`Contacts.piece`).

    Returns
    -------
    material : (q, s) float array
        Of a point outside the material: as if the last piece went on (of a membrane: at its edge).
    piece : (q,) int array
        Piece in which it lies; -1 outside the material (in an open cut, or beside the edge of a
        membrane, too), or where the walk was lost among inverted elements.

    Raises
    ------
    XfemError
        If shapes do not match, a number is not finite or a starting piece does not exist.
    """
    body = cutter.body
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
    for name, values in (("points", places), ("displacement", displacement)):
        if not np.isfinite(values).all():
            raise XfemError(f"{name}: a number is not finite")
    walk = _pull_back if body.mesh.dim == space else pull_back_to_membrane
    return walk(places, pieces, displacement, cut_elements(body), cutter.level_sets)


@njit(cache=True)
def _coordinates(place, piece, cell, displacement, body, simplex, at):
    """Write the barycentric coordinates of a place in the deformed virtual element."""
    cells, points, piece_cells = body.cells, body.points, body.piece_cells
    corners, space = simplex.shape
    for a in range(corners):
        for i in range(space):
            simplex[a, i] = points[cells[cell, a], i] + displacement[piece_cells[piece, a], i]
    whole, least = signed_volume(simplex), np.inf
    is_regular = 0.0 < abs(whole) < np.inf
    for a in range(corners):
        for i in range(space):
            simplex[a, i] = place[i]
        at[a] = signed_volume(simplex) / whole if is_regular else -1.0
        for i in range(space):
            simplex[a, i] = points[cells[cell, a], i] + displacement[piece_cells[piece, a], i]
        least = min(least, at[a])
    return least


@njit(cache=True)
def _pull_back(places, pieces, displacement, body, levels):
    cells, points, _, _, piece_parent, piece_label, first_piece, next_piece = body
    count, space = places.shape
    corners = cells.shape[1]
    material, found = np.empty((count, space)), np.empty(count, dtype=np.int64)
    simplex, at = np.empty((corners, space)), np.empty(corners)
    for q in range(count):
        piece, found[q] = pieces[q], -1
        for _ in range(len(cells)):
            cell, place = piece_parent[piece], places[q]
            least = _coordinates(place, piece, cell, displacement, body, simplex, at)
            if least >= _ON_FACE:
                # beside a tip the pieces of an element overlap: the one with material here counts
                other = first_piece[cell]
                while other >= 0 and found[q] < 0:
                    least = _coordinates(place, other, cell, displacement, body, simplex, at)
                    if least >= _ON_FACE and is_material(
                        other, cell, at, cells, piece_label, levels
                    ):
                        found[q] = piece = other
                    other = next_piece[other]
            _coordinates(place, piece, cell, displacement, body, simplex, at)
            for i in range(space):
                material[q, i] = 0.0
                for a in range(corners):
                    material[q, i] += at[a] * points[cells[cell, a], i]
            if found[q] >= 0:
                break
            # out through the face that is farthest behind and not free
            across, farthest = -1, _ON_FACE
            for a in range(corners):
                if at[a] < farthest:
                    beyond = partner(piece, cell, a, body)
                    if beyond >= 0:
                        across, farthest = beyond, at[a]
            if across < 0:
                break
            piece = across
    return material, found
