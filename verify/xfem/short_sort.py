"""Sorting of the short integer lists that sparsity patterns consist of."""

from numba import njit

__all__ = ["sort_short"]


@njit(cache=True)
def sort_short(values):
    """Sort a short array in place, by insertion where that is faster."""
    if len(values) > 48:
        values.sort()
        return
    for i in range(1, len(values)):
        value = values[i]
        k = i - 1
        while k >= 0 and values[k] > value:
            values[k + 1] = values[k]
            k -= 1
        values[k + 1] = value
