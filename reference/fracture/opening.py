"""Opening of a crack behind its tip, from the nodes of its two faces."""

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.solution import Solution

__all__ = ["crack_opening"]

Array = NDArray[np.float64]


def crack_opening(
    solution: Solution, tip: Array, direction: Array, length: float, step: int = -1
) -> tuple[Array, Array]:
    """Jumps of the displacement along a straight crack behind its tip.

    Parameters
    ----------
    solution : Solution
    tip : (2,) array
        m.
    direction : (2,) array
        Unit vector in which the crack points.
    length : float
        How far behind the tip, m.
    step : int
        Which output time; default the last.

    Returns
    -------
    distance : (n,) array
        Behind the tip, ascending, m.
    jump : (n, 2) array
        Sliding along `direction` and opening across it: left face minus right face, m.

    Raises
    ------
    InputError
        If no two nodes lie on each other there: the field does not open along this line.
    """
    normal = np.array([-direction[1], direction[0]])
    behind = -(solution.points - tip) @ direction
    across = (solution.points - tip) @ normal
    tolerance = 1e-9 * float(np.ptp(solution.points, axis=0).max())
    nodes = np.flatnonzero(
        (np.abs(across) <= tolerance) & (behind > tolerance) & (behind <= length)
    )
    side = _sides(solution, tip, normal)
    left, right = nodes[side[nodes] > 0], nodes[side[nodes] < 0]
    left, right = (n[np.argsort(behind[n], kind="stable")] for n in (left, right))
    at = np.searchsorted(behind[right], behind[left] - tolerance)
    paired = at < len(right)
    paired[paired] = np.abs(behind[right[at[paired]]] - behind[left[paired]]) <= tolerance
    if not paired.any():
        raise InputError(
            f"the field has no doubled nodes behind ({tip[0]:.4g}, {tip[1]:.4g}): nothing opens"
        )
    upper, lower = left[paired], right[at[paired]]
    u = solution.displacement[step]
    return behind[upper], (u[upper] - u[lower]) @ np.column_stack([direction, normal])


def _sides(solution: Solution, tip: Array, normal: Array) -> NDArray[np.int64]:
    """+1 for nodes whose cells all lie left of the line, −1 right, 0 else."""
    height = (solution.points[solution.cells[:, :3]].mean(axis=1) - tip) @ normal
    sign = np.sign(height).astype(np.int64)
    most = np.full(len(solution.points), -1, dtype=np.int64)
    least = np.full(len(solution.points), 1, dtype=np.int64)
    for k in range(solution.cells.shape[1]):
        np.maximum.at(most, solution.cells[:, k], sign)
        np.minimum.at(least, solution.cells[:, k], sign)
    return np.where(most == least, most, 0)
