"""Distinct integers, ascending: a sort, which for a few thousand beats numpy's hashing."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["distinct", "ranges"]

_Ints = NDArray[np.int64]


def distinct(values: _Ints) -> _Ints:
    """Distinct values (q,), ascending."""
    ordered = np.sort(values, axis=None)
    first = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


def ranges(bounds: _Ints) -> _Ints:
    """Integers from the first up to the second bound of each row (k, 2), row after row."""
    count = bounds[:, 1] - bounds[:, 0]
    before = np.cumsum(count) - count
    return np.arange(int(count.sum())) + np.repeat(bounds[:, 0] - before, count)
