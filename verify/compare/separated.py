"""Separated parts of a solution: connected pieces of material, with mass and inertia."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from verify.compare.locate import ROUND_OFF
from verify.compare.simplices import simplices
from verify.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

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
    shape = simplices(solution.points, solution.cells)
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
    shape = simplices(solution.points, solution.cells)
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
