"""Elements of a cut body, as kernels take them."""

from typing import NamedTuple

from verify.simulator.cutting.growing_body import GrowingBody
from verify.xfem.arrays import Floats, Ints, Sides


class CutElements(NamedTuple):
    """Elements of a mesh and their pieces; see `GrowingBody`."""

    cells: Ints
    neighbours: Ints
    piece_cells: Ints
    first_piece: Ints
    next_piece: Ints


class SubSimplices(NamedTuple):
    """Sub-simplices of split elements, those of each by `sub_range` (m, 2); see `GrowingBody`."""

    sub_range: Ints
    sub_piece: Ints
    sub_points: Ints
    sub_barycentric: Floats
    sub_sign: Sides


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
