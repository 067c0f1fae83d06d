"""Force and stiffness of corotational tetrahedra in one sweep: what a real-time step needs.

The arrays are in the order and form in which `tetrahedron_lanes` reads them once: pieces sorted by
their nodes, eight to a batch; blocks above the diagonal are added up in slots that are used again
when a row is finished, so that sums wait in the cache until they are complete.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.polar_kernels import LANES, new_lanes
from verify.xfem.sweep_order_kernels import assign_slots, fill_lanes, order_pieces
from verify.xfem.tetrahedron_lanes import ENTRIES, linearise, unpack_rotations
from verify.xfem.virtual import VirtualMesh

__all__ = ["Linearisation"]

_Floats = NDArray[np.float64]

_LINE = 8  # numbers in a line of the cache


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
        pieces, corner, nodes = order_pieces(virtual.cells, virtual.node_count)
        slots, slot_of, ends, count = assign_slots(
            pieces, corner, nodes, pattern.targets, pattern.starts, pattern.diagonal, LANES
        )
        batches = -(-len(pieces) // LANES)
        self.pattern, self.turning = pattern, turning
        self._pieces, self._ends, self._slot_of = pieces, ends, 9 * slot_of
        self._corners = np.zeros((batches * LANES, 4), dtype=np.uint32)
        self._corners[: len(pieces)] = 3 * nodes
        self._slots = np.zeros((batches * LANES, 6), dtype=np.uint32)
        self._slots[: len(pieces)] = 9 * slots
        self._constants = _aligned_zeros(batches, 11 * LANES)
        fill_lanes(
            pieces, corner, virtual.parent, virtual.mesh.gradients, virtual.volumes, lam, mu,
            LANES, self._constants,
        )  # fmt: skip
        self._quaternions = _aligned_zeros(batches, 4 * LANES)
        self._quaternions.reshape(-1, LANES)[::4] = 1.0
        self._lanes = _aligned_zeros(ENTRIES, LANES).reshape(-1)
        rest = new_lanes()
        self._lanes[: len(rest)] = rest
        self._waiting = np.zeros(9 * count)
        self._beside = np.zeros((pattern.node_count, 6))

    def __call__(
        self,
        displacement: _Floats,
        moved: _Floats,
        scale: float,
        force: _Floats,
        blocks: _Floats,
        whole: bool = True,
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
        whole : bool
            Without it blocks below the diagonal are not written, which are symmetric.
        """
        pattern = self.pattern
        force[:] = 0.0
        linearise(
            self._lanes, self._corners, self._slots, self._constants, self._quaternions, self._ends,
            pattern.starts, pattern.columns, pattern.diagonal, pattern.mirror, self._slot_of,
            displacement, moved, self.turning, whole, scale, self._waiting, self._beside,
            force, blocks,
        )  # fmt: skip

    def write_rotations(self, rotations: _Floats) -> None:
        """Write the rotations (p, 3, 3) of the last sweep."""
        unpack_rotations(self._pieces, self._quaternions, rotations)

    @property
    def least_traffic(self) -> int:
        """Bytes that a sweep must read or write at least once, whatever the size of the caches."""
        kept = (self._corners, self._slots, self._constants)
        read = sum(array.nbytes for array in kept) + self._quaternions.nbytes
        vectors = 3 * self.pattern.node_count * 3 * 8
        return read + self._quaternions.nbytes + vectors + len(self.pattern.columns) * 9 * 8


def _aligned_zeros(rows: int, columns: int) -> _Floats:
    """Zeros (rows, columns) that begin with a line of the cache, so that no vector spans two."""
    store = np.zeros(rows * columns + _LINE)
    skipped = -store.ctypes.data % (8 * _LINE) // 8
    return store[skipped : skipped + rows * columns].reshape(rows, columns)
