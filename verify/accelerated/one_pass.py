"""Force and tangent of corotational tetrahedra in one pass over them: what an implicit step needs.

The corners of each cell are sorted by node, so that the blocks of its pairs are above the diagonal.
There they are added up. The rest of a symmetric matrix without force in translation follows, row by
row: blocks below the diagonal, and the diagonal as Σ_j K_ij = 0.
"""

import numpy as np
from numba import njit

from verify.accelerated.tetrahedron_batches import (
    BATCH,
    BLOCKS,
    CORNERS,
    ENTRIES,
    FIRST,
    FORCE,
    GRADIENTS,
    IRREGULAR,
    QUATERNION,
    average,
    deform,
    resist,
    resist_rotation,
    rotate,
)
from verify.xfem.arrays import Bools, Floats
from verify.xfem.block_pattern import BlockPattern, order_by_counting
from verify.xfem.element import Elements
from verify.xfem.element import deform as deform_cells
from verify.xfem.energy_momentum import StepEnds, averaged_stress
from verify.xfem.polar import rotation_matrix

_WINDOW = 8 * BATCH  # cells among which the cells of a batch are no neighbours


class OnePassTetrahedra:
    """One pass over the tetrahedra of a cut body, for one sparsity.

    Parameters
    ----------
    elements : Elements
        Tetrahedra.
    pattern : BlockPattern
        Its first cells must be the cells of the body.
    corotational : bool
        Whether cells have rotations of their own.
    """

    def __init__(self, elements: Elements, pattern: BlockPattern, corotational: bool) -> None:
        count = len(elements.cells)
        batches = -(-count // BATCH)
        corner, nodes = np.empty((2, count, 4), dtype=np.int64)
        _sort_corners(elements.cells, corner, nodes)
        cells = order_by_counting(nodes[:, 1].copy(), pattern.node_count)
        cells = cells[order_by_counting(nodes[cells, 0], pattern.node_count)]
        whole = count // _WINDOW * _WINDOW
        windows = cells[:whole].reshape(-1, BATCH, _WINDOW // BATCH)
        cells[:whole] = windows.transpose(0, 2, 1).ravel()
        self.pattern, self._corotational = pattern, corotational
        self._elements, self._cells = elements, cells
        # cells beyond the last one fill a batch: they have no stiffness
        self._nodes = np.zeros((batches * BATCH, 4), dtype=np.uint32)
        self._targets = np.zeros((batches * BATCH, 6), dtype=np.uint32)
        self._constants = np.zeros((batches, 11 * BATCH))
        _gather(
            elements, cells, corner, nodes, pattern.targets, self._nodes, self._targets,
            self._constants,
        )  # fmt: skip
        # cells after which nothing is added to a row any more
        ends = np.cumsum(np.bincount(nodes[:, 0], minlength=pattern.node_count))
        self._ends = np.minimum(-(-ends // _WINDOW) * _WINDOW, batches * BATCH)
        self._quaternions = np.zeros((batches, 4 * BATCH))
        self._quaternions[:, :BATCH] = 1.0
        self._first = self._quaternions  # at the start of a step, once one is averaged
        self._at = np.full((2, pattern.node_count, 3), np.nan)  # of which both are the rotations
        self._irregular = np.zeros(batches * BATCH, dtype=np.bool_)
        self._memory = np.zeros(ENTRIES * BATCH)

    def __call__(
        self,
        displacement: Floats,
        velocity: Floats,
        implicit: float,
        scale: float,
        force: Floats,
        blocks: Floats,
        whole: bool = True,
        rotational: float = 0.0,
    ) -> int:
        """Overwrite force (N, 3) and blocks (B, 3, 3); see `verify.xfem.linear_solvers.OnePass`."""
        moved = displacement, velocity, implicit
        return self._run(moved, scale, rotational, False, force, blocks, whole)

    def average(
        self,
        start: Floats,
        end: Floats,
        scale: float,
        rotational: float,
        substituted: Bools,
        force: Floats,
        blocks: Floats,
        whole: bool = True,
    ) -> int:
        """Overwrite the averaged force and the tangent at the end; see `OnePass`."""
        if not np.array_equal(self._at[1], start):
            if not np.array_equal(self._at[0], start):
                self._run((start, start, 0.0), 0.0, 0.0, False, force, blocks, False)
            self._first, self._at[1] = self._quaternions.copy(), start
        irregular = self._irregular[: len(self._cells)]
        irregular[:] = substituted[self._cells]
        moved = end, start - end, 1.0
        left_out = self._run(moved, scale, rotational, True, force, blocks, whole)
        if irregular.any():
            self._add_substitutes(irregular, start, end, force)
            substituted[self._cells] = irregular
        return left_out

    def _add_substitutes(self, irregular: Bools, start: Floats, end: Floats, force: Floats) -> None:
        """Add the forces of the few cells without a plain form, as `verify.xfem` does."""
        some = self._elements.part(self._cells[irregular])
        count = len(some.cells)
        F0, F1, R0, R1 = np.empty((4, count, 3, 3))
        deform_cells(some, start, 1.0, F0)
        deform_cells(some, end, 1.0, F1)
        rotation_matrices(_by_cell(self._first)[: len(irregular)][irregular], R0)
        rotation_matrices(_by_cell(self._quaternions)[: len(irregular)][irregular], R1)
        P = averaged_stress(some, StepEnds(F0, F1, R0, R1), np.ones(count, dtype=np.bool_))
        P *= some.volumes[:, None, None]
        np.add.at(force, some.cells, some.gradients[some.parent] @ P.transpose(0, 2, 1))

    def _run(
        self,
        moved: tuple[Floats, Floats, float],
        scale: float,
        rotational: float,
        averaged: bool,
        force: Floats,
        blocks: Floats,
        whole: bool,
    ) -> int:
        self._at[0] = moved[0]
        pattern = self.pattern
        return int(
            _linearise(
                self._memory, self._nodes, self._targets, self._constants, self._quaternions,
                self._first, *moved, self._corotational, scale, rotational, averaged,
                self._irregular, self._ends, pattern.starts, pattern.diagonal, pattern.mirror,
                whole, force, blocks,
            )
        )  # fmt: skip


@njit(cache=True)
def _sort_corners(cells, corner, nodes):
    """Sort the corners of each cell (p, 4) by node; write the corners and the nodes."""
    for p in range(len(cells)):
        for k in range(4):
            at = k
            while at > 0 and nodes[p, at - 1] > cells[p, k]:
                corner[p, at], nodes[p, at] = corner[p, at - 1], nodes[p, at - 1]
                at -= 1
            corner[p, at], nodes[p, at] = k, cells[p, k]


@njit(cache=True)
def _gather(elements, order, corner, nodes, places, sorted_nodes, targets, constants):
    """Write nodes, places of pairs and constants of the cells in an order, cells side by side."""
    _, parents, gradients, volumes, _, lam, mu, _, _, _ = elements
    for k in range(len(order)):
        p, batch, l = order[k], k // BATCH, k % BATCH
        parent, pair = parents[p], 0
        for i in range(4):
            sorted_nodes[k, i] = nodes[p, i]
            for j in range(i + 1, 4):
                targets[k, pair] = places[p, corner[p, i], corner[p, j]]
                pair += 1
            if i > 0:
                for m in range(3):
                    entry = (3 * (i - 1) + m) * BATCH + l
                    constants[batch, entry] = gradients[parent, corner[p, i], m]
        constants[batch, 9 * BATCH + l] = volumes[p] * lam[parent]
        constants[batch, 10 * BATCH + l] = volumes[p] * mu[parent]


@njit(cache=True)
def rotation_matrices(quaternions, R):
    """Write the matrices R (p, 3, 3) of unit quaternions (p, 4)."""
    for p in range(len(R)):
        rotation_matrix(quaternions[p], R[p])


@njit(cache=True)
def _linearise(
    v, nodes, targets, constants, quaternions, first, displacement, velocity, implicit,
    corotational, scale, rotational, averaged, irregular, ends, starts, diagonal, mirror, whole,
    force, blocks,
):  # fmt: skip
    """Write force and tangent of a displacement; return the cells without rotational part."""
    left_out = 0
    row = begun = np.int64(0)
    d = np.empty((3, 3))
    force[:] = 0.0
    for batch in range(len(constants)):
        start = batch * BATCH
        for entry in range(11 * BATCH):
            v[GRADIENTS * BATCH + entry] = constants[batch, entry]
        for entry in range(4 * BATCH):
            v[QUATERNION * BATCH + entry] = quaternions[batch, entry]
        for l in range(BATCH):
            for corner in range(4):
                node, at = nodes[start + l, corner], (CORNERS + 6 * corner) * BATCH + l
                for k in range(3):
                    u = displacement[node, k]
                    v[at + k * BATCH] = u
                    v[at + (3 + k) * BATCH] = u + implicit * velocity[node, k]
        deform(v)
        if corotational:
            rotate(v)
            for entry in range(4 * BATCH):
                quaternions[batch, entry] = v[QUATERNION * BATCH + entry]
        resist(v, scale)
        if rotational != 0.0:
            resist_rotation(v, rotational)
            for l in range(BATCH):
                left_out += v[IRREGULAR * BATCH + l] > 0.0
        if averaged:
            for entry in range(4 * BATCH):
                v[FIRST * BATCH + entry] = first[batch, entry]
            average(v)
            for l in range(BATCH):
                if irregular[start + l]:
                    for entry in range(FORCE, FORCE + 12):
                        v[entry * BATCH + l] = 0.0
                irregular[start + l] |= v[IRREGULAR * BATCH + l] > 0.0
        last = row
        for l in range(BATCH):
            last = max(last, np.int64(nodes[start + l, 2]))
        begun = _begin(begun, last, starts, diagonal, blocks)
        for l in range(BATCH):
            for corner in range(4):
                node, at = nodes[start + l, corner], (FORCE + 3 * corner) * BATCH + l
                for k in range(3):
                    force[node, k] += v[at + k * BATCH]
            for pair in range(6):
                target, at = targets[start + l, pair], (BLOCKS + 9 * pair) * BATCH + l
                for k in range(3):
                    for m in range(3):
                        blocks[target, k, m] += v[at + (3 * k + m) * BATCH]
        while row < len(ends) and ends[row] <= start + BATCH:
            begun = _begin(begun, row, starts, diagonal, blocks)
            _complete(row, starts, diagonal, mirror, whole, d, blocks)
            row += 1
    return left_out


@njit(inline="always")
def _begin(row, last, starts, diagonal, blocks):
    """Zero rows up to `last` from the diagonal on; return the row after it."""
    while row <= last:
        for place in range(diagonal[row] + 1, starts[row + 1]):
            for k in range(3):
                for l in range(3):
                    blocks[place, k, l] = 0.0
        row += 1
    return row


@njit(inline="always")
def _complete(row, starts, diagonal, mirror, whole, d, blocks):
    """Write the diagonal of a row and, if wanted, blocks below it, from the blocks above."""
    middle = diagonal[row]
    d[:] = 0.0
    for place in range(starts[row], middle):
        above = mirror[place]
        for k in range(3):
            for l in range(3):
                value = blocks[above, l, k]
                d[k, l] -= value
                if whole:
                    blocks[place, k, l] = value
    for place in range(middle + 1, starts[row + 1]):
        for k in range(3):
            for l in range(3):
                d[k, l] -= blocks[place, k, l]
    # a sum of blocks that are not symmetric is so but for round-off
    for k in range(3):
        for l in range(3):
            blocks[middle, k, l] = 0.5 * (d[k, l] + d[l, k])


def _by_cell(entries: Floats) -> Floats:
    """Find entries (batches, k · BATCH) as (cells, k)."""
    return (
        entries.reshape(len(entries), -1, BATCH)
        .transpose(0, 2, 1)
        .reshape(-1, entries.shape[1] // BATCH)
    )
