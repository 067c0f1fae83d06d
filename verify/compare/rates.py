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
