"""Domains of interaction integrals: rings of cells around a tip."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.fracture.cells import CellGradients, cell_gradients
from verify.errors import InputError
from verify.solution import Solution

Array = NDArray[np.float64]


class DomainError(InputError):
    """A domain around a tip is too small for the cells there, or larger than the body."""


@dataclass(frozen=True)
class Ring:
    """The cells that a domain integral runs over.

    Attributes
    ----------
    cells : (m,) int array
    at : CellGradients
        The field there.
    q : (m, p) array
        The weight at the quadrature points: 1 at the tip, 0 outside the ring.
    grad_q : (m, p, 2) array
        1/m.
    near : (m, p, 2) array
        Centroid of the cell of each point, which says the side of the cut.
    """

    cells: NDArray[np.int64]
    at: CellGradients
    q: Array
    grad_q: Array
    near: Array


def ring(
    solution: Solution, tip: Array, radius: float, whole: bool = False, step: int = -1
) -> Ring:
    """Gather the cells where q falls from 1 to 0: those with corners on both sides of a circle.

    Parameters
    ----------
    solution : Solution
    tip : (2,) array
    radius : float
        m.
    whole : bool
        Also gather the cells inside, where q = 1.
    step : int
        Which output time; default the last.

    Raises
    ------
    DomainError
        If the circle is so small that a cell of the tip reaches across it, or leaves no cells.
    InputError
        If the field is not plane, or the radius not positive.
    """
    if solution.dimension != 2 or not radius > 0:
        raise InputError(
            f"a domain of radius {radius} m; expected a plane field, a positive radius"
        )
    corners = solution.cells[:, :3]
    away = np.linalg.norm(solution.points[corners] - tip, axis=2)
    inside = away < radius
    at_tip = away.min(axis=1) <= 1e-9 * float(np.ptp(solution.points, axis=0).max())
    mixed = inside.any(axis=1) & ~inside.all(axis=1)
    if not mixed.any() or (mixed & at_tip).any() or inside.all():
        raise DomainError(
            f"a domain of radius {radius:.4g} m around ({tip[0]:.4g}, {tip[1]:.4g}) does not fit "
            "between the cells at the tip and what is next to it"
        )
    cells = np.flatnonzero(mixed | inside.all(axis=1)) if whole else np.flatnonzero(mixed)
    at = cell_gradients(solution, cells, step)
    hat = inside[cells].astype(float)
    grad_q = np.einsum("mk,mqkj->mqj", hat, at.hats)
    near = np.broadcast_to(
        solution.points[corners[cells]].mean(axis=1)[:, None, :], at.points.shape
    )
    # the value of a linear q, from its gradient and a corner
    first = solution.points[corners[cells, 0]][:, None, :]
    q = hat[:, :1] + np.sum((at.points - first) * grad_q, axis=2)
    return Ring(cells, at, q, grad_q, near)
