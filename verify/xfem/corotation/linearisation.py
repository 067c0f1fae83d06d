"""Force and stiffness of corotational tetrahedra in one sweep: what an implicit step needs.

The arrays are in the order and form in which `tetrahedron_lanes` reads them once: pieces sorted by
their nodes, eight to a batch, eight batches to a window; blocks above the diagonal are added up in
slots that are used again when a row is finished, so that sums wait in the cache until they are
complete.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.corotation.lane_layout import ENTRIES
from verify.xfem.corotation.polar_kernels import new_lanes
from verify.xfem.corotation.sweep_order_kernels import assign_slots, fill_lanes, order_pieces
from verify.xfem.corotation.symmetric_rows import RECORD
from verify.xfem.corotation.tetrahedron_lanes import linearise, unpack_rotations
from verify.xfem.lanes.vectors import LANES
from verify.xfem.virtual import VirtualMesh

__all__ = ["Linearisation"]

_Floats = NDArray[np.float64]

_LINE = 8  # numbers in a line of the cache
_WINDOW = 8 * LANES  # pieces; rows are finished after each window


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
        spread = _spread(len(pieces))
        pieces, corner, nodes = pieces[spread], corner[spread], nodes[spread]
        slots, slot_of, ends, count = assign_slots(
            pieces, corner, nodes, pattern.targets, pattern.starts, pattern.diagonal, _WINDOW
        )
        batches = -(-len(pieces) // LANES)
        ends = np.minimum(-(-ends // _WINDOW) * _WINDOW, batches * LANES)
        self.pattern, self.turning = pattern, turning
        self._pieces, self._ends, self._slot_of = pieces, ends, slot_of
        self._corners = np.zeros(batches * LANES * 4, dtype=np.uint32)
        self._corners[: nodes.size] = nodes.ravel()
        self._slots = np.zeros(batches * LANES * 6, dtype=np.uint32)
        self._slots[: slots.size] = slots.ravel()
        self._constants = _aligned_zeros(batches, 11 * LANES)
        fill_lanes(
            pieces, corner, virtual.parent, virtual.mesh.gradients, virtual.volumes, lam, mu,
            LANES, self._constants,
        )  # fmt: skip
        self._quaternions = _aligned_zeros(batches, 4 * LANES)
        self._quaternions.reshape(-1, LANES)[::4] = 1.0
        self._first = self._quaternions  # at the start of a step, once one is averaged
        self._at = np.full((2, pattern.node_count, 3), np.nan)  # of which both are the rotations
        self._taken = np.zeros(batches * LANES, dtype=np.bool_)
        self._lanes = _aligned_zeros(ENTRIES, LANES).reshape(-1)
        rest = new_lanes()
        self._lanes[: len(rest)] = rest
        self._motion = _aligned_zeros(pattern.node_count, RECORD)
        self._waiting = _aligned_zeros(count, RECORD).reshape(-1)
        self._ninths = np.zeros(count)
        self._nodes = _aligned_zeros(pattern.node_count, RECORD).reshape(-1)

    def __call__(
        self,
        displacement: _Floats,
        velocity: _Floats,
        implicit: float,
        scale: float,
        force: _Floats,
        blocks: _Floats,
        whole: bool = True,
        spin: float = 0.0,
    ) -> int:
        """Overwrite force (N, 3) and blocks (B, 3, 3): `scale` times the stiffness.

        Parameters
        ----------
        displacement : (N, 3) float array
            From which the rotations are taken.
        velocity : (N, 3) float array
        implicit : float
            In seconds. The force is that of displacement + `implicit` velocity with these
            rotations: f_int(u) + `implicit` K v.
        scale : float
        whole : bool
            Without it blocks below the diagonal are not written, which are symmetric.
        spin : float
            Times what the exact stiffness has beyond that with frozen rotations is added.

        Returns
        -------
        int
            Pieces without the latter, their rotation not being differentiable.
        """
        moved = displacement, velocity, implicit
        return self._sweep(*moved, scale, spin, False, force, blocks, whole)

    def average(
        self,
        start: _Floats,
        end: _Floats,
        scale: float,
        spin: float,
        substituted: NDArray[np.bool_],
        force: _Floats,
        blocks: _Floats,
        whole: bool = True,
    ) -> int:
        """Overwrite the force with that averaged over a step; the stiffness is that at its end.

        Parameters
        ----------
        start, end : (N, 3) float array
            Displacements.
        substituted : (p,) bool array
            Pieces that have taken the substitute; updated.
        scale, spin, force, blocks, whole
            As of a call.
        """
        if not np.array_equal(self._at[1], start):
            if not np.array_equal(self._at[0], start):
                self._sweep(start, start, 0.0, 0.0, 0.0, False, force, blocks, False)
            self._first, self._at[1] = self._quaternions.copy(), start
        count = len(self._pieces)
        self._taken[:count] = substituted[self._pieces]
        found = self._sweep(end, start - end, 1.0, scale, spin, True, force, blocks, whole)
        substituted[self._pieces] = self._taken[:count]
        return found

    def _sweep(
        self,
        displacement: _Floats,
        velocity: _Floats,
        implicit: float,
        scale: float,
        spin: float,
        averaged: bool,
        force: _Floats,
        blocks: _Floats,
        whole: bool,
    ) -> int:
        self._at[0] = displacement
        pattern = self.pattern
        return int(
            linearise(
                self._lanes, self._corners, self._slots, self._constants, self._quaternions,
                self._ends, pattern.starts, pattern.diagonal, pattern.mirror, self._slot_of,
                displacement, velocity, implicit, self.turning, whole, scale, spin, self._first,
                averaged, self._taken, self._motion, self._waiting, self._ninths, self._nodes,
                force, blocks,
            )
        )  # fmt: skip

    def write_rotations(self, rotations: _Floats, first: bool = False) -> None:
        """Write the rotations (p, 3, 3) of the last sweep, or of the start of an averaged step."""
        found = self._first if first else self._quaternions
        unpack_rotations(self._pieces, found, rotations)

    @property
    def least_traffic(self) -> int:
        """Bytes that a sweep must read or write at least once, whatever the size of the caches."""
        kept = (self._corners, self._slots, self._constants)
        read = sum(array.nbytes for array in kept) + self._quaternions.nbytes
        vectors = 3 * self.pattern.node_count * 3 * 8
        return read + self._quaternions.nbytes + vectors + len(self.pattern.columns) * 9 * 8


def _spread(count: int) -> NDArray[np.int64]:
    """Order in which the lanes of a batch take pieces from all of a window.

    Neighbours add to the same nodes: one after the other they would wait for each other's sums.
    """
    order, whole = np.arange(count), count // _WINDOW * _WINDOW
    windows = order[:whole].reshape(-1, LANES, _WINDOW // LANES)
    order[:whole] = windows.transpose(0, 2, 1).ravel()
    return order


def _aligned_zeros(rows: int, columns: int) -> _Floats:
    """Zeros (rows, columns) that begin with a line of the cache, so that no vector spans two."""
    store = np.zeros(rows * columns + _LINE)
    skipped = -store.ctypes.data % (8 * _LINE) // 8
    return store[skipped : skipped + rows * columns].reshape(rows, columns)
