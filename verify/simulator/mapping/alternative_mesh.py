"""The alternative mesh: a whole element for every piece, where its unknowns are (thesis 3.2.2).

In side-wise unknowns the nodes of the virtual elements *are* the unknowns, so nothing has to be
substituted as in the thesis; unknowns of another basis are changed into these first
(`verify.xfem.bases`).
"""

import numpy as np
from numpy.typing import NDArray

from verify.simulator.cutting.growing_body import GrowingBody
from verify.xfem.errors import XfemError

__all__ = ["virtual_elements"]

_Floats = NDArray[np.float64]


def virtual_elements(body: GrowingBody, displacement: _Floats) -> _Floats:
    """Corners (p, d + 1, s) of the virtual elements in the deformed body, in metres.

    They overlap: each carries only its piece's share of the material.

    Raises
    ------
    XfemError
        If the displacement is not (N, s).
    """
    shape = (body.node_count, body.mesh.space)
    if displacement.shape != shape:
        raise XfemError(f"displacement of shape {displacement.shape}; expected {shape}")
    nodes = body.piece_cells.rows
    return body.mesh.points[body.node_parent.rows[nodes]] + displacement[nodes]
