"""Work of dead loads on a solution, measured on its displacements and velocities.

A load f(x) φ(t) does the work ∫ φ dq with q = ∫ f·u. At the output times q and its rate are known;
between them q is the cubic that they determine.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from verify.compare.kinetic import shape_functions
from verify.compare.separated import boundary_facets
from verify.compare.simplex_rule import simplex_rule
from verify.compare.simplices import facet_nodes
from verify.compare.splitting import measures
from verify.scene import BodyForce, Scene, Traction
from verify.scene.parts import Pieces, pieces_on_part
from verify.scene.physics import factor_at
from verify.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_GAUSS = np.polynomial.legendre.leggauss(2)  # exact for the rate of a cubic times a line


def load_work(
    scene: Scene, load: BodyForce | Traction, solution: Solution
) -> tuple[Array, Array] | None:
    """Work (t,) of a load since the first output time, and the half-width of its interval, J.

    The half-width is what the cubic and a line between output times differ by: zero while the
    factor of the load stands still. None where the work is not known from the fields: the load is
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
    work, width = np.zeros((2, len(times)))
    for k in range(len(times) - 1):
        a, b = times[k], times[k + 1]
        span, gain = b - a, place[k + 1] - place[k]
        knots = np.unique([a, *(t for t, _ in table if a < t < b), b])
        cubic = line = 0.0
        for start, end in pairwise(knots):
            for at, weight in zip(*_GAUSS, strict=True):
                time = 0.5 * (start + end) + 0.5 * (end - start) * at
                s = (time - a) / span
                slope = 6 * s * (1 - s) * gain / span
                slope += (1 - 4 * s + 3 * s**2) * rate[k] + (3 * s**2 - 2 * s) * rate[k + 1]
                share = 0.5 * (end - start) * weight * factor_at(table or None, float(time))
                cubic += share * slope
                line += share * gain / span
        work[k + 1] = work[k] + cubic
        width[k + 1] = width[k] + abs(cubic - line)
    return work, width


def nodal_forces(scene: Scene, load: BodyForce | Traction, solution: Solution) -> Array:
    """Consistent nodal forces (n, d) of a load without its factor, N."""
    if isinstance(load, BodyForce):
        nodes, k = solution.cells, solution.cell_dimension
        pieces = Pieces.whole(np.arange(len(nodes)), k + 1)
    else:
        nodes, k = boundary_nodes_of_facets(solution), solution.cell_dimension - 1
        pieces = pieces_on_part(scene.geometry, load.where, solution.points[nodes[:, : k + 1]])
        nodes = nodes[pieces.facet]
    place, share = simplex_rule(k, 4)
    within = place @ pieces.barycentric
    hats = shape_functions(within.reshape(-1, k + 1), k, solution.order)
    corners = solution.points[nodes[:, : k + 1]]
    points = within @ corners
    force = load.values(points.reshape(-1, solution.dimension)).reshape(points.shape)
    thickness = scene.material.thickness or 1.0
    weight = thickness * (measures(corners) * pieces.share)[:, None] * share
    local = np.einsum("mq,mqn,mqd->mnd", weight, hats.reshape(*weight.shape, -1), force)
    found = np.zeros_like(solution.points)
    np.add.at(found, nodes, local)
    return found


def boundary_nodes_of_facets(solution: Solution) -> Ints:
    """Nodes (b, f) of the facets of the outer boundary, corners first, then those of edges."""
    k = solution.cell_dimension
    cell, opposite = boundary_facets(solution)
    columns = np.array([facet_nodes(k, corner, solution.order) for corner in range(k + 1)])
    nodes: Ints = np.take_along_axis(solution.cells[cell], columns[opposite], axis=1)
    return nodes
