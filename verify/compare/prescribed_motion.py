"""Motion that the supports of a scene prescribe to the nodes of a solution."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from verify.compare.load_work import boundary_nodes_of_facets
from verify.errors import InputError
from verify.scene import Scene
from verify.scene.parts import held_nodes
from verify.scene.physics import PrescribedMotion, factor_at, jumps
from verify.solution import Solution

Array = NDArray[np.float64]

# Of the largest displacement that supports prescribe: nodes that are nearer follow it; of others,
# where the field of a cut facet is a line and the formula is none, so far may be the worst.
_FOLLOWS, _MOST = 1e-6, 0.1


@dataclass(frozen=True)
class PrescribedNodes:
    """Components of nodes that supports hold, and how these move.

    Parameters
    ----------
    held : (n, d) bool array
    follows : (n, d) bool array
        Which of them are where the supports say at all output times.
    supports : list of (nodes, components, PrescribedMotion)
        A later one wins.
    """

    held: NDArray[np.bool_]
    follows: NDArray[np.bool_]
    supports: list[tuple[NDArray[np.int64], list[int], PrescribedMotion]]

    @property
    def knots(self) -> list[float]:
        """Times at which a history has a kink, s."""
        histories = [one.support.history for _, _, one in self.supports]
        return [time for history in histories for time, _ in history or ()]

    def values(self, time: float) -> Array:
        """Displacements (n, d), m; zero where nothing is held."""
        found = np.zeros(self.held.shape)
        for nodes, components, one in self.supports:
            factor = factor_at(one.support.history, time)
            found[np.ix_(nodes, components)] = one.values(factor, time)
        return found

    def velocities(self, time: float) -> Array:
        """Velocities (n, d), m/s, after a kink; zero where nothing is held."""
        found = np.zeros(self.held.shape)
        for nodes, components, one in self.supports:
            found[np.ix_(nodes, components)] = one.velocities(time)
        return found


def prescribed_nodes(scene: Scene, solution: Solution) -> PrescribedNodes:
    """Find what the supports of a scene hold of a solution, by the rule that all solvers follow.

    Raises
    ------
    InputError
        If a support follows an exact field or jumps, holds no node, or if nodes that it holds are
        elsewhere.
    """
    facets = boundary_nodes_of_facets(solution)
    own = np.unique(facets)
    corners = solution.points[facets[:, : solution.cell_dimension]]
    rows = np.searchsorted(own, facets), corners
    held = np.zeros(solution.points.shape, dtype=bool)
    supports = []
    for i, support in enumerate(scene.supports):
        if support.displacement == "exact":
            raise InputError("a support follows an exact field")
        if [t for t in jumps(support.history) if solution.times[0] < t <= solution.times[-1]]:
            raise InputError("a support jumps")
        at, _ = held_nodes(scene, support.where, solution.points[own], rows, f"supports[{i}].where")
        nodes, components = own[at], list(support.held(scene.dimension))
        held[np.ix_(nodes, components)] = True
        motion = PrescribedMotion(support, solution.points[nodes], None, None)
        supports.append((nodes, components, motion))
    found = PrescribedNodes(held, held, supports)
    said = np.array([found.values(time) for time in solution.times])
    largest = float(np.abs(said).max(initial=0.0))
    off = np.abs(solution.displacement - said).max(axis=0)
    if off[held].max(initial=0.0) > _MOST * largest:
        raise InputError(f"nodes that supports hold are off by {off[held].max():.2g} m")
    return replace(found, follows=held & (off <= _FOLLOWS * largest))
