"""Distinct integers, ascending: a sort, which for a few thousand beats numpy's hashing."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["distinct", "distinct_in_lists", "distinct_in_rows", "ranges"]

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


@njit(cache=True)
def _note(item, place, found, count):
    """Write an integer to `found` unless it is there already; how many there are."""
    if place[item] < 0:
        place[item], found[count] = 0, item
        count += 1
    return count


@njit(cache=True)
def _noted(place, found, count):
    """Return what has been found, and leave `place` as it was before."""
    for k in range(count):
        place[found[k]] = -1
    return found[:count]


@njit(cache=True)
def distinct_in_rows(table, rows, place):
    """Distinct integers of some rows of a table; `place` is -1 for each integer, and stays so."""
    found = np.empty(len(rows) * table.shape[1], dtype=np.int64)
    count = 0
    for row in rows:
        for item in table[row]:
            count = _note(item, place, found, count)
    return _noted(place, found, count)


@njit(cache=True)
def distinct_in_lists(starts, items, rows, place):
    """Distinct integers of some lists, of which each begins where the one before ends."""
    room = 0
    for row in rows:
        room += starts[row + 1] - starts[row]
    found = np.empty(room, dtype=np.int64)
    count = 0
    for row in rows:
        for k in range(starts[row], starts[row + 1]):
            count = _note(items[k], place, found, count)
    return _noted(place, found, count)
