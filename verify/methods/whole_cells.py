"""Cut meshes whose pieces count as whole cells, all or some of them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from verify.xfem.phantom import PhantomMesh, SubCells


def whole_cells(phantom: PhantomMesh, chosen: NDArray[np.bool_] | None = None) -> PhantomMesh:
    """Return the chosen pieces (p,), all by default, each with the whole volume of its cell.

    Unknowns keep their numbers, also those that no chosen piece uses.
    """
    keep = np.ones(len(phantom.cells), dtype=bool) if chosen is None else chosen
    corners = phantom.cells.shape[1]
    return replace(
        phantom,
        cells=phantom.cells[keep],
        parent=phantom.parent[keep],
        fraction=np.ones(int(keep.sum())),
        label=phantom.label[keep],
        sub_cells=SubCells(
            piece=np.zeros(0, dtype=np.int64),
            points=np.zeros((0, corners), dtype=np.int64),
            barycentric=np.zeros((0, corners, corners)),
            fraction=np.zeros(0),
            zero_points=phantom.sub_cells.zero_points,
        ),
    )
