"""Contacts of pieces: across the faces of the mesh, and across a cut inside a cell."""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.mesh import equal_rows, facets_of
from verify.xfem.phantom import PhantomMesh

_Ints = NDArray[np.int64]
_Floats = NDArray[np.float64]


def face_contacts(phantom: PhantomMesh, near: bool = False) -> tuple[_Ints, _Ints]:
    """Pairs of pieces (k,), (k,) of neighbouring cells that share all unknowns of their face.

    Parameters
    ----------
    phantom : PhantomMesh
    near : bool
        Leave out cells that have no node in common with a split one.
    """
    mesh = phantom.mesh
    chosen = np.ones(len(mesh.cells), dtype=bool)
    if near:
        around = np.zeros(len(mesh.points), dtype=bool)
        around[mesh.cells[phantom.parent[phantom.split]]] = True
        chosen = around[mesh.cells].any(axis=1)
    cells = np.flatnonzero(chosen)
    across = mesh.neighbours[cells]
    row, local = np.nonzero((across > cells[:, None]) & chosen[across])
    cell, across = cells[row], across[row, local]
    count = np.bincount(phantom.parent, minlength=len(mesh.cells))
    start = np.cumsum(count) - count
    pairs = count[cell] * count[across]
    face = np.repeat(np.arange(len(cell)), pairs)
    within = np.arange(len(face)) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    first = start[cell[face]] + within // count[across[face]]
    second = start[across[face]] + within % count[across[face]]
    # the unknowns of mesh nodes are shared wherever both pieces have them; a cut along a face
    # separates cells that have one piece each, so that counting pieces would not do
    plain = (phantom.cells < len(mesh.points)).all(axis=1)
    check = np.flatnonzero(~(plain[first] & plain[second]))
    mine = _face_unknowns(phantom, first[check], local[face[check]])
    other_local = (mesh.neighbours[across[face[check]]] == cell[face[check], None]).argmax(axis=1)
    theirs = _face_unknowns(phantom, second[check], other_local)
    shared = np.ones(len(face), dtype=bool)
    shared[check] = (mine == theirs).all(axis=1)
    return first[shared], second[shared]


def _face_unknowns(phantom: PhantomMesh, piece: _Ints, local: _Ints) -> _Ints:
    """Unknowns (q, d) of the pieces on the face opposite to a corner, ascending."""
    corners = phantom.cells.shape[1]
    on_face = np.arange(corners) != local[:, None]
    return np.sort(phantom.cells[piece][on_face].reshape(-1, corners - 1), axis=1)


def sibling_contacts(phantom: PhantomMesh, cells: _Ints) -> tuple[_Ints, _Ints, _Floats]:
    """Pairs of pieces inside the given cells, and the area of the cut between them.

    Pieces with a piece without volume between them do not appear.
    """
    sub, corners = phantom.sub_cells, phantom.cells.shape[1]
    wanted = np.zeros(len(phantom.mesh.cells), dtype=bool)
    wanted[cells] = True
    rows = np.flatnonzero(wanted[phantom.parent[sub.piece]])
    facets = np.sort(facets_of(sub.points[rows]), axis=1)
    piece = np.repeat(sub.piece[rows], corners)
    one, other = equal_rows(np.column_stack([phantom.parent[piece], facets]))
    apart = piece[one] != piece[other]
    first, second = piece[one][apart], piece[other][apart]
    at = sub.zero_points.positions[facets[one][apart]]
    edges = at[:, 1:] - at[:, :1]
    area = np.sqrt(np.maximum(np.linalg.det(edges @ edges.transpose(0, 2, 1)), 0.0))
    return np.concatenate([first, second]), np.concatenate([second, first]), np.tile(area, 2)
