"""Separated parts of a solution, and its kinetic energy with the mass that its solver declares.

The declared mass is checked, and taken instead of the consistent mass of the field: a body that
moves with a lumped mass keeps the energy of that mass, which for short waves is up to
`verify.compare.mass.lumping_range` times as large.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array, issparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from verify.compare.locate import ROUND_OFF
from verify.compare.mass import (
    Kinetic,
    consistent_mass,
    lumping_of,
    lumping_range,
    nodal_weights,
)
from verify.compare.simplices import cells_of
from verify.handed_over import CONSISTENT
from verify.solution import Solution

Ints = NDArray[np.int64]
Array = NDArray[np.float64]


_ALIKE = 0.01  # of the body's size: centres this close in a direction are ordered by the next one


@dataclass(frozen=True)
class Part:
    """A connected piece of material, undeformed (2D: per metre of thickness).

    Parameters
    ----------
    cells : (c,) int array
        Numbers of its cells.
    mass : float
        kg.
    centre : (d,) float array
        Of mass, m.
    inertia : (1,) or (3,) float array
        Moments of inertia about the axes z, in space x, y, z, through its own centre, kg m².
    """

    cells: Ints
    mass: float
    centre: Array
    inertia: Array


def separated_parts(solution: Solution, density: float | Array) -> list[Part]:
    """Parts of a solution, from the top down (in the plane by y, in space by z; then by y, x).

    Cells are one part if a chain of facets leads from one to the other of which neighbours share
    the nodes: nodes are doubled where a cut separates. Parts that touch in a point, or in space
    in a line, are two.

    Parameters
    ----------
    solution : Solution
    density : float or (m,) array
        kg/m³, of a membrane times its thickness; of all cells of the solution or of each.
    """
    corners = solution.cells[:, : solution.cell_dimension + 1]
    facets, cell = _facets(corners)
    _, number = np.unique(facets, axis=0, return_inverse=True)
    link = coo_array((np.ones(len(cell), dtype=np.int8), (cell, number.ravel())))
    link = link.tocsr()
    _, label = connected_components(link @ link.T, directed=False)
    shape = cells_of(solution)
    order = np.argsort(label, kind="stable")
    starts = np.flatnonzero(np.diff(label[order])) + 1
    mass = density * shape.volume
    parts = [_part(cells, shape.corners, mass) for cells in np.split(order, starts)]
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))

    def place(part: Part) -> tuple[float, ...]:
        return tuple(-np.round(part.centre[::-1] / (_ALIKE * size)))

    return sorted(parts, key=place)


def part_of(solution: Solution, density: float | Array, cells: Ints) -> Part:
    """Mass and inertia of given cells (c,), connected or not."""
    shape = cells_of(solution)
    return _part(cells, shape.corners, density * shape.volume)


def boundary_nodes(solution: Solution) -> NDArray[np.bool_]:
    """Whether nodes (n,) are corners of a facet of the outer boundary, not of faces of cuts."""
    cell, opposite = boundary_facets(solution)
    corners = solution.cells[cell, : solution.cell_dimension + 1]
    found = np.zeros(len(solution.points), dtype=bool)
    found[corners[np.arange(corners.shape[1]) != opposite[:, None]]] = True
    return found


def boundary_facets(solution: Solution) -> tuple[Ints, Ints]:
    """Cell (b,) and opposite corner (b,) of the facets of the outer boundary, not of faces of cuts.

    On the faces of a cut two facets have the same place; on the outer boundary each is alone.
    """
    corners = solution.cells[:, : solution.cell_dimension + 1]
    facets, cell = _facets(corners)
    distinct, first, times = np.unique(facets, axis=0, return_index=True, return_counts=True)
    alone = times == 1
    middle = solution.points[distinct[alone]].mean(axis=1)
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    near = cKDTree(middle).query(middle, k=2, distance_upper_bound=10 * ROUND_OFF * size)[0]
    chosen = first[alone][~np.isfinite(near[:, 1])]
    return cell[chosen], chosen % corners.shape[1]


def _facets(corners: Ints) -> tuple[Ints, Ints]:
    """Sorted nodes (f, k) of all facets of all cells, and their cell (f,)."""
    k = corners.shape[1]
    rest = [[j for j in range(k) if j != i] for i in range(k)]
    facets = np.sort(corners[:, rest].reshape(-1, k - 1), axis=1)
    return facets, np.repeat(np.arange(len(corners)), k)


def _part(cells: Ints, corners: Array, mass: Array) -> Part:
    own, at = mass[cells], corners[cells]
    total = float(own.sum())
    centre = own @ at.mean(axis=1) / total if total > 0.0 else at.mean(axis=(0, 1))
    # ∫ x xᵀ over a simplex of n corners, per volume: (Σ x_v x_vᵀ + Σ x_v Σ x_vᵀ)/(n (n + 1))
    away = at - centre
    count = at.shape[1]
    whole = away.sum(axis=1)
    square = (away**2).sum(axis=1) + whole**2
    second = own @ square / (count * (count + 1))  # ∫ ρ x_i² (d,)
    d = len(second)
    inertia = np.array([second.sum()]) if d == 2 else second.sum() - second
    return Part(cells, total, np.asarray(centre), inertia)


_WRONG = 0.01  # of the body's mass: beyond, a declared mass is that of another body
_NOTHING = 1e-9  # of the largest kinetic energy of a motion


@dataclass(frozen=True)
class Inertia:
    """Kinetic energy over the output times, and at what gravity pulls.

    Parameters
    ----------
    kinetic : (t,) array
        J (2D: per metre, as all that follows).
    width : (t,) array
        Half-width of its interval, J.
    weights : (n,) array
        Mass at the nodes, kg.
    moment : (t, d) array
        Half-width of Σ weights × displacements, kg m.
    matrix : (n, n) sparse array
        Mass of the nodes, kg.
    off : float
        By how much of itself the mass may be off; beside how it is lumped.
    lumped : (n, n) sparse array or None
        Another mass that it may as well be, kg.
    note : str
        Which mass it is.
    """

    kinetic: Array
    width: Array
    weights: Array
    moment: Array
    matrix: csr_array
    note: str
    off: float = 0.0
    lumped: csr_array | None = None


def inertia_of(
    solution: Solution, density: float | Array, whole: Kinetic, parts: Sequence[Part]
) -> Inertia:
    """Take the mass of a solution as declared, or that of its field if none is or it cannot be.

    A declared mass is accepted if its total, its first moments and its share of each separated
    part are those of the body, and the kinetic energy at all output times is within what lumping
    may do to that of the field. Cells that are cut may have less: the mass of a part of one acts
    at the centre of the whole cell. So the lower end gives way by the size of a cell.

    Parameters
    ----------
    solution : Solution
        With velocities.
    density : float or (m,) array
        kg/m³, of each cell.
    whole : Kinetic
        Of the field of the solution.
    parts : sequence of Part
        All separated parts.
    """
    weights = nodal_weights(solution, density)
    known = np.zeros_like(whole.energy), np.zeros((len(whole.energy), solution.dimension))
    consistent = consistent_mass(solution, density)
    if isinstance(solution.mass, str):
        assert solution.mass == CONSISTENT
        note = "the consistent mass, as declared"
        return Inertia(whole.energy, known[0], weights, known[1], consistent, note)
    wrong = "no mass is declared"
    if solution.mass is not None:
        matrix = _matrix(solution.mass)
        own = np.asarray(matrix.sum(axis=1)).ravel()
        energy = np.array([0.5 * float(np.sum(v * (matrix @ v))) for v in _velocities(solution)])
        off = _off(solution, own, weights, parts)
        wrong = _outside(solution, energy, whole)
        if off > _WRONG:
            wrong = f"its total, first moments or parts are off by {off:.2g} of the body's mass"
        if not wrong:
            moved = solution.displacement - solution.displacement[0]
            moment = off * np.abs(np.einsum("n,tna->ta", own, moved))
            width = off * energy + _round_off(solution, matrix)
            return Inertia(energy, width, own, moment, matrix, "the declared mass", off)
        wrong = f"the declared mass is not taken: {wrong}"
    lumping = lumping_of(solution, density)
    note = f"that of the field, give or take its lumping ({wrong})"
    lumped = csr_array(diags_array(weights))
    return Inertia(
        whole.energy, lumping.kinetic, weights, lumping.moment, consistent, note, lumped=lumped
    )


def _velocities(solution: Solution) -> Array:
    assert solution.velocity is not None
    return solution.velocity


def _round_off(solution: Solution, matrix: csr_array) -> Array:
    """Error (t,) of kinetic energies by that of velocities: of thin pieces large terms cancel."""
    sizes = np.abs(_velocities(solution))
    products = np.array([float(np.sum(v * (abs(matrix) @ v))) for v in sizes])
    return 4.0 * np.finfo(float).eps * products


def _matrix(mass: Any) -> csr_array:
    return csr_array(mass if issparse(mass) else diags_array(np.asarray(mass, dtype=float)))


def _off(solution: Solution, own: Array, weights: Array, parts: Sequence[Part]) -> float:
    """Largest difference of nodal masses in total, moments and parts, over that of the body."""
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    more = own - weights
    off = [abs(more.sum()), float(np.abs(more @ solution.points).max()) / size]
    belongs = [np.unique(solution.cells[part.cells]) for part in parts]
    shared = np.bincount(np.concatenate(belongs), minlength=len(own)) > 1  # by a corner alone
    off += [abs(more[nodes].sum()) for nodes in belongs if not shared[nodes].any()]
    return max(off) / float(weights.sum())


def _outside(solution: Solution, energy: Array, whole: Kinetic) -> str:
    """Why kinetic energies are not those of any lumping, if they are not."""
    corners = cells_of(solution).corners
    largest = float(np.linalg.norm(np.ptp(corners, axis=1), axis=1).max())
    size = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
    low, high = lumping_range(solution.cell_dimension, solution.order)
    nothing = _NOTHING * float(np.max([energy, whole.energy]))
    below = energy < low * (1 - largest / size) * whole.energy - nothing
    above = energy > high * whole.energy + nothing
    if not (below | above).any():
        return ""
    at = int(np.flatnonzero(below | above)[0])
    ratio = energy[at] / max(whole.energy[at], 1e-300)
    return (
        f"its kinetic energy at {solution.times[at]:.4g} s is {ratio:.3g} times that of the field, "
        f"and lumping makes {low:.3g} to {high:.3g} of it"
    )
