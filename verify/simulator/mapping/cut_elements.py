"""Elements of a cut body, as kernels take them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.simulator.cutting.growing_body import GrowingBody

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class CutElements(NamedTuple):
    """Elements of a mesh and their pieces; see `GrowingBody`."""

    cells: _Ints
    neighbours: _Ints
    piece_cells: _Ints
    first_piece: _Ints
    next_piece: _Ints


class SubSimplices(NamedTuple):
    """Sub-simplices of split elements, those of each by `sub_range` (m, 2); see `GrowingBody`."""

    sub_range: _Ints
    sub_piece: _Ints
    sub_points: _Ints
    sub_barycentric: _Floats
    sub_sign: NDArray[np.int8]


def cut_elements(body: GrowingBody) -> CutElements:
    """Elements of a body as it is now."""
    mesh = body.mesh
    return CutElements(
        mesh.cells, mesh.neighbours, body.piece_cells.rows, body.first_piece, body.next_piece.rows
    )  # fmt: skip


def sub_simplices(body: GrowingBody) -> SubSimplices:
    """Sub-simplices of a body as it is now."""
    return SubSimplices(
        body.sub_range, body.sub_piece.rows, body.sub_points.rows, body.sub_barycentric.rows,
        body.sub_sign.rows,
    )  # fmt: skip
