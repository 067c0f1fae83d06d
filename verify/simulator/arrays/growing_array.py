"""Arrays that grow at the end, with room kept so that appending costs what is appended."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


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
