"""Grips on a simulated body: supports of the scene, hooks at the edges of a cut."""

from collections.abc import Sequence

import numpy as np

from verify.simulator.stage import Hold, Hook
from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.body import MovingSupports
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh


def gripped(phantom: PhantomMesh, hook: Hook) -> Ints:
    """Dof nodes that a hook grips: those on its side within its radius, at least the nearest.

    The unknowns at nodes across the cut are among them: they carry the material up to the cut.
    """
    on_side = np.flatnonzero(phantom.node_side[:, hook.stroke] == hook.side)
    if len(on_side) == 0:
        return on_side
    away = np.linalg.norm(phantom.node_points[on_side] - hook.at, axis=1)
    return on_side[away <= max(hook.radius, float(away.min()))]


def held_unknowns(phantom: PhantomMesh, nodes: Bools, facets: Bools) -> Bools:
    """Dof nodes (N,) to be held where some nodes (n,) of the uncut mesh are.

    The unknown of the material at a node is held. Another one there, of material beyond a cut, is
    held only if that material reaches a held facet: else a part that is cut free would hang on a
    node that is no part of it. `facets` is what `held_facets` gives.
    """
    held = np.zeros(phantom.node_count, dtype=bool)
    held[: len(nodes)] = nodes
    sub = phantom.sub_cells
    # of sub-simplices on held facets all corners but one lie on these
    away = sub.barycentric != 0.0
    part, facet = np.nonzero((away.sum(axis=1) == 1) & facets[phantom.parent[sub.piece]])
    on_facet = np.arange(facets.shape[1]) != facet[:, None]
    held[phantom.cells[sub.piece[part]][on_facet]] = True
    return held


def held_facets(mesh: SimplexMesh, nodes: Bools) -> Bools:
    """(m, d + 1) whether the facet opposite to a corner is on the boundary, its nodes all held."""
    cell, local = mesh.boundary_facets.T
    facet = nodes[mesh.cells[cell]]
    facet[np.arange(len(cell)), local] = True
    on_held = np.zeros(mesh.cells.shape, dtype=bool)
    on_held[cell, local] = facet.all(axis=1)
    return on_held


class Grips:
    """Supports and loads of a body as it is now, from the time at which it was last cut.

    Parameters
    ----------
    phantom : PhantomMesh
    holds : sequence of Hold
    hooks : sequence of Hook
    weights : (N,) float array
        Lumped masses: a force is shared in proportion, so that slivers get next to nothing.
    start : dict
        Displacement (N, s) at which each hook (by its number) has gripped.
    facets : sequence of (m, d + 1) bool arrays
        `held_facets` of each hold; they do not change as the body is cut.
    """

    def __init__(
        self,
        phantom: PhantomMesh,
        holds: Sequence[Hold],
        hooks: Sequence[Hook],
        weights: Floats,
        start: dict[int, Floats],
        facets: Sequence[Bools],
    ) -> None:
        shape = (phantom.node_count, phantom.mesh.space)
        self._fixed, self._values = np.zeros(shape, dtype=bool), np.zeros(shape)
        for k, hold in enumerate(holds):
            at = held_unknowns(phantom, hold.nodes, facets[k])
            for axis, value in zip(hold.components, hold.values, strict=True):
                self._fixed[at, axis], self._values[at, axis] = True, value
        self._moved: list[tuple[Hook, Ints, Floats]] = []
        self._pulled: list[tuple[Hook, Ints, Floats]] = []
        for number, begun in start.items():
            hook, nodes = hooks[number], gripped(phantom, hooks[number])
            if len(nodes) == 0:
                continue
            if hook.is_force:
                share = weights[nodes] / weights[nodes].sum()
                self._pulled.append((hook, nodes, share[:, None] * hook.vector))
            else:
                self._fixed[nodes] = True
                self._moved.append((hook, nodes, begun[nodes]))

    @property
    def supports(self) -> MovingSupports:
        """Holds, and hooks that move."""
        return MovingSupports(self._fixed, self._at)

    def force(self, time: float) -> Floats:
        """Nodal forces (N, s) of the hooks that pull, N."""
        force = np.zeros(self._values.shape)
        for hook, nodes, full in self._pulled:
            force[nodes] += hook.share(time) * full
        return force

    def _at(self, time: float) -> tuple[Floats, Floats]:
        displacement, velocity = self._values.copy(), np.zeros(self._values.shape)
        for hook, nodes, begun in self._moved:
            displacement[nodes] = begun + hook.share(time) * hook.vector
            velocity[nodes] = hook.rate(time) * hook.vector
        return displacement, velocity
