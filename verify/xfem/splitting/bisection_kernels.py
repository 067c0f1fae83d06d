"""Bisection at points in a given order; each asks only the simplices around an end of its edge."""

import numpy as np
from numba import njit

__all__ = ["bisect_along"]


@njit(cache=True)
def _list_new(simplex, points, first, entries, used):
    """Enter a simplex into the lists of its vertices; the count of entries."""
    for k in range(points.shape[1]):
        vertex, again = points[simplex, k], False
        for j in range(k):
            again = again or points[simplex, j] == vertex  # a simplex without volume
        if again:
            continue
        entries[used, 0], entries[used, 1] = simplex, first[vertex]
        first[vertex] = used
        used += 1
    return used


@njit(cache=True)
def bisect_along(count, numbers, ends, r, s, points, barycentric, fraction, source, first):
    """Bisect simplices at points z = s plus + r minus wherever they have that edge.

    Parameters
    ----------
    count : int
        Number of simplices; the arrays have room for more.
    numbers, ends, r, s : (k,), (k, 2), (k,), (k,) arrays
        The points one after the other: number, ends (plus, minus), and shares.
    points, barycentric, fraction, source : arrays
        Simplices (`verify.xfem.splitting.bisection.Simplices`), overwritten.
    first : int array
        -1 for every numbered point.

    Returns
    -------
    int
        Count of simplices, -1 if there is not enough room.
    """
    room, corners = points.shape
    # a half that replaces its simplex comes into one more list, the other half into all
    entries = np.empty((corners * count + (corners + 1) * (room - count), 2), dtype=np.int64)
    used = 0
    for q in range(count):
        used = _list_new(q, points, first, entries, used)
    for z in range(len(numbers)):
        entry = first[ends[z, 0]]
        while entry >= 0:
            q, entry = entries[entry, 0], entries[entry, 1]
            plus, minus = -1, -1
            for k in range(corners):
                if plus < 0 and points[q, k] == ends[z, 0]:
                    plus = k
                if minus < 0 and points[q, k] == ends[z, 1]:
                    minus = k
            if plus < 0 or minus < 0:
                continue
            if count == room:
                return -1
            for k in range(corners):
                points[count, k] = points[q, k]
                for j in range(corners):
                    barycentric[count, k, j] = barycentric[q, k, j]
            for j in range(corners):
                middle = s[z] * barycentric[q, plus, j] + r[z] * barycentric[q, minus, j]
                barycentric[q, plus, j] = barycentric[count, minus, j] = middle
            # the half beyond the plus end stays in its place, and in lists that do not hold it
            points[q, plus] = points[count, minus] = numbers[z]
            fraction[count], fraction[q] = fraction[q] * r[z], fraction[q] * s[z]
            source[count] = source[q]
            used = _list_new(count, points, first, entries, used)
            entries[used, 0], entries[used, 1] = q, first[numbers[z]]
            first[numbers[z]] = used
            used += 1
            count += 1
    return count
