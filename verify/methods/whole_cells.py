"""Cut meshes whose pieces count as whole cells, all or some of them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from verify.xfem.virtual import SubCells, VirtualMesh

__all__ = ["whole_cells"]


def whole_cells(virtual: VirtualMesh, chosen: NDArray[np.bool_] | None = None) -> VirtualMesh:
    """Return the chosen pieces (p,), all by default, each with the whole volume of its cell.

    Unknowns keep their numbers, also those that no chosen piece uses.
    """
    keep = np.ones(len(virtual.cells), dtype=bool) if chosen is None else chosen
    corners = virtual.cells.shape[1]
    return replace(
        virtual,
        cells=virtual.cells[keep],
        parent=virtual.parent[keep],
        fraction=np.ones(int(keep.sum())),
        label=virtual.label[keep],
        sub_cells=SubCells(
            piece=np.zeros(0, dtype=np.int64),
            points=np.zeros((0, corners), dtype=np.int64),
            barycentric=np.zeros((0, corners, corners)),
            fraction=np.zeros(0),
            zero_points=virtual.sub_cells.zero_points,
        ),
    )
