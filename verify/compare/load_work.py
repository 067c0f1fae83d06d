"""Motion that supports prescribe, and the work of dead loads on the motion of a solution.

A load f(x) φ(t) does the work ∫ φ dq with q = ∫ f·u. At the output times q and its rate are known;
between them q is the cubic that they determine.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from verify.compare.mass import boundary_facets, shape_functions
from verify.compare.simplices import nodes_of_facets, simplex_rule
from verify.errors import InputError
from verify.geometry.simplices import measures
from verify.scene import BodyForce, Scene, Traction
from verify.scene.parts import Pieces, held_nodes, pieces_on_part
from verify.scene.physics import PrescribedMotion, factor_at, jumps
from verify.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


_GAUSS = np.polynomial.legendre.leggauss(2)  # exact for the rate of a cubic times a line


def load_work(
    scene: Scene, load: BodyForce | Traction, solution: Solution
) -> tuple[Array, Array] | None:
    """Work (t,) of a load since the first output time, and the half-width of its interval, J.

    The half-width is the difference between the cubic and a line between output times: zero while
    the factor of the load is constant. None where fields do not determine the work: the load is
    another field at every time.

    Parameters
    ----------
    scene : Scene
    load : BodyForce or Traction
        Of the scene.
    solution : Solution
        With velocities. Plane: per metre of thickness.
    """
    if load.exact or load.timed:
        return None
    nodal = nodal_forces(scene, load, solution)
    assert solution.velocity is not None
    place = np.einsum("na,tna->t", nodal, solution.displacement)
    rate = np.einsum("na,tna->t", nodal, solution.velocity)
    return _worked(solution.times, load.history, place, rate)


def _worked(times: Array, history: object, place: Array, rate: Array) -> tuple[Array, Array]:
    """Integrate the factor over q, by intervals between outputs and kinks of the history."""
    table: list[tuple[float, float]] = list(history or [])  # type: ignore[call-overload]
    if len(times) < 2:
        return np.zeros(1), np.zeros(1)
    rates = CubicHermiteSpline(times, place, rate).derivative()
    steps, (at, weights) = np.diff(place) / np.diff(times), _GAUSS
    work, width = np.zeros((2, len(times)))
    for k, (a, b) in enumerate(pairwise(times)):
        cubic = line = 0.0
        for start, end in pairwise(np.unique([a, *(t for t, _ in table if a < t < b), b])):
            when = 0.5 * (start + end) + 0.5 * (end - start) * at
            factors = np.array([factor_at(table or None, float(time)) for time in when])
            shares = 0.5 * (end - start) * weights * factors
            cubic += float(shares @ rates(when))
            line += float(shares.sum() * steps[k])
        work[k + 1] = work[k] + cubic
        width[k + 1] = width[k] + abs(cubic - line)
    return work, width


def nodal_forces(
    scene: Scene, load: BodyForce | Traction, solution: Solution, time: float = 0.0,
    clip: Callable[[Pieces, Array], Pieces] | None = None,
) -> Array:  # fmt: skip
    """Compute consistent nodal forces (n, d) of a load at a time, s, without its factor, N.

    Parameters
    ----------
    clip : callable, optional
        Which pieces of simplices (q, k, d) count.
    """
    if isinstance(load, BodyForce):
        nodes, k = solution.cells, solution.cell_dimension
        pieces = Pieces.whole(np.arange(len(nodes)), k + 1)
    else:
        nodes, k = boundary_nodes_of_facets(solution), solution.cell_dimension - 1
        pieces = pieces_on_part(scene.geometry, load.where, solution.points[nodes[:, : k + 1]])
    if clip is not None:
        pieces = clip(pieces, solution.points[nodes[:, : k + 1]])
    thickness = scene.material.thickness or 1.0

    def force(points: Array, *_: object) -> Array:
        values = load.values(points.reshape(-1, solution.dimension), time)
        return thickness * values.reshape(points.shape)

    return spread(solution, nodes, k, pieces, force)


def spread(
    solution: Solution,
    simplices: Ints,
    k: int,
    pieces: Pieces,
    force: Callable[[Array, Array, Ints], Array],
) -> Array:
    """Compute consistent nodal forces (n, d) of a force per measure on pieces of simplices, N.

    Parameters
    ----------
    solution : Solution
    simplices : (q, j) int array
        Their nodes, corners first.
    k : int
        Their dimension.
    pieces : Pieces
    force : callable
        Values (m, p, d) at points (m, p, d) of m pieces, where the hats of nodes are (m, p, j), of
        simplices (m,).
    """
    place, share = simplex_rule(k, 4)
    nodes = simplices[pieces.facet]
    within = place @ pieces.barycentric
    hats = shape_functions(within.reshape(-1, k + 1), k, solution.order)
    corners = solution.points[nodes[:, : k + 1]]
    weight = (measures(corners) * pieces.share)[:, None] * share
    hats = hats.reshape(*weight.shape, -1)
    values = force(within @ corners, hats, pieces.facet)
    found = np.zeros_like(solution.points)
    np.add.at(found, nodes, np.einsum("mq,mqn,mqd->mnd", weight, hats, values))
    return found


def boundary_nodes_of_facets(solution: Solution) -> Ints:
    """Find nodes (b, f) of the facets of the outer boundary: corners first, then edges."""
    cell, opposite = boundary_facets(solution)
    return nodes_of_facets(solution.cells[cell], opposite)


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
        """Compute displacements (n, d), m; zero where nothing is held."""
        found = np.zeros(self.held.shape)
        for nodes, components, one in self.supports:
            factor = factor_at(one.support.history, time)
            found[np.ix_(nodes, components)] = one.values(factor, time)
        return found

    def velocities(self, time: float) -> Array:
        """Compute velocities (n, d), m/s, after a kink; zero where nothing is held."""
        found = np.zeros(self.held.shape)
        for nodes, components, one in self.supports:
            found[np.ix_(nodes, components)] = one.velocities(time)
        return found


def nodes_held(scene: Scene, solution: Solution, where: Sequence[str]) -> list[Ints]:
    """Find nodes (h,) of a solution that supports on parts hold, by the rule of all solvers.

    Raises
    ------
    InputError
        If one holds no node.
    """
    facets = boundary_nodes_of_facets(solution)
    own = np.unique(facets)
    corners = solution.points[facets[:, : solution.cell_dimension]]
    rows = np.searchsorted(own, facets), corners
    every = solution.cells, solution.points[solution.cells[:, : solution.cell_dimension + 1]]
    found = []
    for i, one in enumerate(where):
        key = f"supports[{i}].where"
        if scene.geometry.holds_inside(one):
            found.append(held_nodes(scene, one, solution.points, every, key)[0])
        else:
            found.append(own[held_nodes(scene, one, solution.points[own], rows, key)[0]])
    return found


def prescribed_nodes(scene: Scene, solution: Solution) -> PrescribedNodes:
    """Find what the supports of a scene hold of a solution, by the rule that all solvers follow.

    Raises
    ------
    InputError
        If a support follows an exact field or jumps, holds no node, or if nodes that it holds are
        elsewhere.
    """
    for support in scene.supports:
        if support.displacement == "exact":
            raise InputError("a support follows an exact field")
        if [t for t in jumps(support.history) if solution.times[0] < t <= solution.times[-1]]:
            raise InputError("a support jumps")
    at = nodes_held(scene, solution, [support.where for support in scene.supports])
    held = np.zeros(solution.points.shape, dtype=bool)
    supports = []
    for nodes, support in zip(at, scene.supports, strict=True):
        components = list(support.held(scene.dimension))
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
