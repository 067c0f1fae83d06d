"""Distinct integers, ascending, and integers of lists that lie one after the other."""

import numpy as np

from verify.xfem.arrays import Ints


def distinct(values: Ints) -> Ints:
    """Distinct values (q,), ascending: for a few thousand a sort beats numpy's hashing."""
    ordered = np.sort(values, axis=None)
    first = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


def ranges(bounds: Ints) -> Ints:
    """Integers from the first up to the second bound of each row (k, 2), row after row."""
    counts = bounds[:, 1] - bounds[:, 0]
    ends = np.cumsum(counts)
    shift = np.repeat(bounds[:, 0] - ends + counts, counts)
    return np.arange(len(shift)) + shift


def of_lists(starts: Ints, items: Ints, rows: Ints) -> Ints:
    """Integers of some lists, of which each begins where the one before ends."""
    return items[ranges(np.stack([starts[rows], starts[rows + 1]], axis=1))]
