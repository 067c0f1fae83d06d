"""Distinct integers, ascending: a sort, which for a few thousand beats numpy's hashing."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["distinct", "ranges"]

_Ints = NDArray[np.int64]


def distinct(values: _Ints) -> _Ints:
    """Distinct values (q,), ascending."""
    ordered = np.sort(values, axis=None)
    first = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


@njit(cache=True)
def ranges(bounds):
    """Integers from the first up to the second bound of each row (k, 2), row after row."""
    count = 0
    for k in range(len(bounds)):
        count += bounds[k, 1] - bounds[k, 0]
    found, count = np.empty(count, dtype=np.int64), 0
    for k in range(len(bounds)):
        for number in range(bounds[k, 0], bounds[k, 1]):
            found[count] = number
            count += 1
    return found
