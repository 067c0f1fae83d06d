"""Force and stiffness of corotational tetrahedra in one sweep: what a real-time step needs.

The arrays are in the order and form in which `tetrahedron_lanes` reads them once: pieces sorted by
their nodes, eight to a batch; blocks above the diagonal in the order in which these pieces meet
them, so that a sum waits in the cache until it is complete.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.polar_kernels import LANES
from verify.xfem.sweep_order_kernels import fill_lanes, number_upper_blocks, order_pieces
from verify.xfem.tetrahedron_lanes import complete, linearise, unpack_rotations
from verify.xfem.virtual import VirtualMesh

__all__ = ["Linearisation"]

_Floats = NDArray[np.float64]


class Linearisation:
    """One sweep over the tetrahedra of a cut body, for one sparsity.

    Parameters
    ----------
    virtual : VirtualMesh
        Of tetrahedra.
    lam, mu : (m,) float array
        Lamé parameters of the uncut cells, in Pa.
    pattern : BlockPattern
        Its first cells must be those of the body.
    turning : bool
        Whether pieces have rotations of their own.
    """

    def __init__(
        self,
        virtual: VirtualMesh,
        lam: _Floats,
        mu: _Floats,
        pattern: BlockPattern,
        turning: bool = True,
    ) -> None:
        pieces, corner, self._cells = order_pieces(virtual.cells, virtual.node_count)
        batches = -(-len(pieces) // LANES)
        self._pieces = pieces
        self._gradients = np.zeros((batches, 9 * LANES))
        self._moduli = np.zeros((batches, 2 * LANES))
        fill_lanes(
            pieces, corner, virtual.parent, virtual.mesh.gradients, virtual.volumes, lam, mu,
            LANES, self._gradients, self._moduli,
        )  # fmt: skip
        self._quaternions = np.zeros((batches, 4 * LANES))
        self._quaternions.reshape(-1, LANES)[::4] = 1.0
        self._targets, self._source, met = number_upper_blocks(
            pieces, corner, pattern.targets, pattern.mirror
        )
        self._half = np.zeros((met + 1, 3, 3))
        self.pattern, self.turning = pattern, turning

    def __call__(
        self,
        displacement: _Floats,
        moved: _Floats,
        scale: float,
        force: _Floats,
        blocks: _Floats,
    ) -> None:
        """Overwrite force (N, 3) and blocks (B, 3, 3): `scale` times the stiffness.

        Parameters
        ----------
        displacement : (N, 3) float array
            From which the rotations are taken.
        moved : (N, 3) float array
            From which, with these rotations, the force is taken; with displacement + h velocity
            it is that of the displacement plus h K velocity.
        scale : float
        """
        force[:] = 0.0
        linearise(
            self._cells, self._targets, self._gradients, self._moduli, self._quaternions,
            displacement, moved, self.turning, scale, force, self._half,
        )  # fmt: skip
        complete(
            self.pattern.starts, self.pattern.columns, self._source, self._half, blocks,
        )  # fmt: skip

    def write_rotations(self, rotations: _Floats) -> None:
        """Write the rotations (p, 3, 3) of the last sweep."""
        unpack_rotations(self._pieces, self._quaternions, rotations)

    @property
    def least_traffic(self) -> int:
        """Bytes that a sweep must read or write at least once, whatever the size of the caches."""
        kept = (self._cells, self._targets, self._gradients, self._moduli)
        read = sum(array.nbytes for array in kept) + self._quaternions.nbytes
        vectors = 3 * self.pattern.node_count * 3 * 8
        return read + self._quaternions.nbytes + vectors + len(self.pattern.columns) * 9 * 8
