"""Opening of a plane crack in space behind its front, from the nodes of its two faces."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from reference.fracture.front import Front
from verify.errors import InputError
from verify.solution import Solution

__all__ = ["FaceOpening", "face_opening"]

Array = NDArray[np.float64]


class FaceOpening(NamedTuple):
    """Jumps of the displacement at n places of a crack: upper face minus lower face.

    Attributes
    ----------
    points : (n, 3) array
        m.
    behind : (n,) array
        Distance behind the front, ascending, m.
    along : (n,) array
        Arc length of the nearest point of the front, m.
    jump : (n, 3) array
        Sliding ahead, opening, and sliding along the front's third axis, m.
    """

    points: Array
    behind: Array
    along: Array
    jump: Array


def face_opening(solution: Solution, front: Front, reach: float, step: int = -1) -> FaceOpening:
    """Jumps of the displacement of a plane crack within `reach` behind its front.

    Parameters
    ----------
    solution : Solution
        In space.
    front : Front
    reach : float
        m.
    step : int
        Which output time; default the last.

    Raises
    ------
    InputError
        If no two nodes lie on each other there: nothing opens.
    """
    size = float(np.ptp(solution.points, axis=0).max())
    at = front.coordinates(solution.points)
    near = (np.abs(at.across) <= 1e-9 * size) & (-at.ahead <= reach) & (at.ahead < -1e-9 * size)
    upper, lower = (np.flatnonzero(near & on) for on in _faces(solution, front))
    if not len(upper) or not len(lower):
        raise InputError("the field has no doubled nodes behind the front: nothing opens")
    apart, partner = cKDTree(solution.points[lower]).query(solution.points[upper])
    paired = apart <= 1e-9 * size
    upper, lower = upper[paired], lower[partner[paired]]
    order = np.argsort(-at.ahead[upper], kind="stable")
    upper, lower = upper[order], lower[order]
    u = solution.displacement[step]
    jump = np.einsum("nij,nj->ni", at.axes[upper], u[upper] - u[lower])
    return FaceOpening(solution.points[upper], -at.ahead[upper], at.along[upper], jump)


def _faces(solution: Solution, front: Front) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Nodes all of whose cells lie above the plane of the crack, or below."""
    middles = solution.points[solution.cells[:, :4]].mean(axis=1)
    above = front.coordinates(middles).across > 0.0
    touched = [np.zeros(len(solution.points), dtype=bool) for _ in range(2)]
    touched[0][solution.cells[above]] = True
    touched[1][solution.cells[~above]] = True
    return touched[0] & ~touched[1], touched[1] & ~touched[0]
