"""Force and stiffness of corotational tetrahedra in one sweep: what a real-time step needs.

The arrays are in the order and form in which `tetrahedron_lanes` reads them once: pieces sorted by
their nodes, eight to a batch; blocks above the diagonal in the order in which these pieces meet
them, so that a sum waits in the cache until it is complete.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.polar_kernels import LANES
from verify.xfem.tetrahedron_lanes import complete, linearise, unpack_rotations
from verify.xfem.virtual import VirtualMesh

__all__ = ["Linearisation"]

_Floats = NDArray[np.float64]

_FIRST, _SECOND = (0, 0, 0, 1, 1, 2), (1, 2, 3, 2, 3, 3)  # pairs of corners above the diagonal


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
        corner = np.argsort(virtual.cells, axis=1)
        nodes = np.take_along_axis(virtual.cells, corner, axis=1)
        self._pieces = np.lexsort(nodes.T[::-1])
        corner, parent = corner[self._pieces], virtual.parent[self._pieces]
        self._cells = nodes[self._pieces].astype(np.int32)
        gradients = np.take_along_axis(virtual.mesh.gradients[parent], corner[:, :, None], axis=1)
        self._gradients = _in_lanes(gradients[:, 1:].reshape(-1, 9))
        volumes = virtual.volumes[self._pieces]
        self._moduli = _in_lanes(np.stack([volumes * lam[parent], volumes * mu[parent]], axis=1))
        self._quaternions = _in_lanes(np.tile([1.0, 0.0, 0.0, 0.0], (len(corner), 1)))
        of_piece = pattern.targets[self._pieces]
        targets = of_piece[np.arange(len(corner))[:, None], corner[:, _FIRST], corner[:, _SECOND]]
        met, first, index = np.unique(targets, return_index=True, return_inverse=True)
        rank = np.empty(len(met), dtype=np.int32)
        rank[np.argsort(first)] = np.arange(len(met))
        self._targets = np.ascontiguousarray(rank[index].reshape(targets.shape))
        self._source = np.full(len(pattern.columns), len(met), dtype=np.int32)
        self._source[met] = self._source[pattern.mirror[met]] = rank
        self._half = np.zeros((len(met) + 1, 3, 3))
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


def _in_lanes(values: _Floats) -> _Floats:
    """(p, k) values as (batches, k · LANES), lane by lane; the last with zeros."""
    batches = -(-len(values) // LANES)
    filled = np.zeros((batches * LANES, values.shape[1]))
    filled[: len(values)] = values
    lanes = filled.reshape(batches, LANES, -1).transpose(0, 2, 1)
    return np.ascontiguousarray(lanes).reshape(batches, -1)
