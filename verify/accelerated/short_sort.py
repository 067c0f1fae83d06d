"""Sorting of the short integer lists that sparsity patterns consist of."""

from numba import njit


@njit(cache=True)
def sort_short(values):
    """Sort in place by Shell's method; numba's own sort takes seconds to compile."""
    gap = 1
    while 3 * gap + 1 < len(values):
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, len(values)):
            value = values[i]
            k = i - gap
            while k >= 0 and values[k] > value:
                values[k + gap] = values[k]
                k -= gap
            values[k + gap] = value
        gap //= 3
