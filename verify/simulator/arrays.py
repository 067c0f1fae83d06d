"""Arrays that grow, numbers for rows of integers, distinct integers, lists one after the other."""

from collections import defaultdict
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.xfem.arrays import Ints


class GrowingArray:
    """Rows of equal shape.

    Parameters
    ----------
    rows : array
        The first rows; copied.

    Attributes
    ----------
    rows : array
        All rows so far, a view. It stays valid, but not complete, when more are appended.
    """

    def __init__(self, rows: NDArray[Any]) -> None:
        first = np.array(rows)
        self._store = np.empty((max(16, 2 * len(first)), *first.shape[1:]), dtype=first.dtype)
        self._store[: len(first)] = first
        self.rows = self._store[: len(first)]

    def __len__(self) -> int:
        return len(self.rows)

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows (k, ...)."""
        begin = self.extend(len(rows))
        self.rows[begin:] = rows

    def extend(self, count: int) -> int:
        """Append rows without values; the number of the first."""
        begin, end = len(self.rows), len(self.rows) + count
        if end > len(self._store):
            store = np.empty((2 * end, *self._store.shape[1:]), dtype=self._store.dtype)
            store[:begin] = self.rows
            self._store = store
        self.rows = self._store[:end]
        return begin


class RowNumbers:
    """Rows of one length and their numbers."""

    def __init__(self) -> None:
        self._number: defaultdict[bytes, int] = defaultdict(count().__next__)

    def number(self, rows: Ints) -> tuple[Ints, Ints]:
        """Numbers (k,) of rows (k, width), and where each new one comes first.

        New rows get the next numbers, in their order.
        """
        # equal rows often follow each other
        other = np.append(True, (rows[1:] != rows[:-1]).any(axis=1))[: len(rows)]
        keys = rows[other].view(f"V{8 * rows.shape[1]}").ravel().tolist()
        last = len(self._number) - 1
        found = np.fromiter(map(self._number.__getitem__, keys), np.int64, len(keys))
        found = found[np.cumsum(other) - 1]
        before = np.maximum.accumulate(np.concatenate([[last], found[:-1]]))
        return found, np.flatnonzero(found > before)


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
