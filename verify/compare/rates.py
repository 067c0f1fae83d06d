"""Velocities beside the rates of displacements, from output to output."""

import numpy as np
from numpy.typing import NDArray

from verify.solution import Solution

Array = NDArray[np.float64]


def rate_off(solution: Solution, first: int, middle: int, last: int) -> Array:
    """Subtract the mean velocity from the mean rate of displacement between outputs, (n, d), m/s.

    The mean velocity is Simpson's, by the parabola through three outputs.

    Parameters
    ----------
    solution : Solution
        With velocities.
    first, middle, last : int
        Numbers of output times in their order.
    """
    u, v = solution.displacement, solution.velocity
    assert v is not None
    before, after = np.diff(solution.times[[first, middle, last]])
    whole = before + after
    mean = (
        (2 - after / before) * v[first]
        + whole**2 / (before * after) * v[middle]
        + (2 - before / after) * v[last]
    ) / 6
    off: Array = (u[last] - u[first]) / whole - mean
    return off


# A fault is so many times the difference of both rules. Where they resolve a motion, halving the
# intervals leaves a sixteenth of a mismatch, a quarter at worst. A jump of velocity between two
# outputs makes at most twice their difference; motions that no output follows make about as much.
_AGREE = 4.0
_SHARE = 2e-3  # of the largest velocity: a fifth of a fault of 1 % in time
# A vibration of about whole periods from output to output looks slow. Its velocity is then
# far above the rate that displacements show, by more than this. Beside a slow motion it has another
# shape in space than the rate of displacements, which a fault of the clock shares.
_ALIASED, _SHAPE = 0.5, 0.5
_MOVES = 0.1  # of the largest velocity
_EVEN = 2.0  # ratio of two intervals up to which Simpson's rule has no negative weight


def persistent_mismatch(solution: Solution, step: float) -> tuple[float, float] | None:
    """Find how far velocities are from the rates of displacements, for no lack of outputs.

    Means over four intervals between outputs, by Simpson's rule of these and of pairs of them, are
    compared with the displacement that they shall make. A fault of the clock, or of a factor, has
    the shape of the rate in space. It shows in most such means of a body that moves, and in two
    without a common interval: a jump, or agreement by chance, is none. It is beyond half a step in
    time, by which schemes of first order are late. Beside vibrations that outputs do not follow
    none is seen that is not far larger.

    Parameters
    ----------
    solution : Solution
        With velocities.
    step : float
        Of the scheme, s.

    Returns
    -------
    tuple of float, or None
        The largest such difference over the largest velocity, and its time, s.
    """
    times, v = solution.times, solution.velocity
    assert v is not None
    largest = max(float(np.linalg.norm(one)) for one in v)
    found, moving = [], 0
    for k in range(2, len(times) - 2):
        gaps = np.diff(times[k - 2 : k + 3])
        pairs = np.array([gaps[:2].sum(), gaps[2:].sum()])
        if max(gaps.max() / gaps.min(), pairs.max() / pairs.min()) > _EVEN:
            continue
        shares = pairs / pairs.sum()
        coarse = rate_off(solution, k - 2, k, k + 2)
        fine = shares[0] * rate_off(solution, k - 2, k - 1, k)
        fine += shares[1] * rate_off(solution, k, k + 1, k + 2)
        rate = (solution.displacement[k + 2] - solution.displacement[k - 2]) / pairs.sum()
        off, shown, mean = (float(np.linalg.norm(one)) for one in (fine, rate, rate - fine))
        moving += mean > _MOVES * largest
        change = (v[k + 2] - v[k - 2]) / pairs.sum()
        late = 0.5 * step * float(np.linalg.norm(change))
        unknown = _AGREE * float(np.linalg.norm(coarse - fine))
        if off - late <= max(unknown, _SHARE * largest) or shown < _ALIASED * mean:
            continue
        rest = fine - float((fine * rate).sum()) / shown**2 * rate
        if np.linalg.norm(rest) < _SHAPE * off:
            found.append((off / largest, k))
    if not found or len(found) <= 0.5 * moving or found[-1][1] - found[0][1] < 4:
        return None
    share, k = max(found)
    return share, float(times[k])
