"""Numbers for rows of integers: equal rows, equal numbers, in the order of their first coming."""

from collections import defaultdict
from itertools import count

import numpy as np

from verify.xfem.arrays import Ints


class RowNumbers:
    """Rows of one length and their numbers."""

    def __init__(self) -> None:
        self._number: defaultdict[bytes, int] = defaultdict(count().__next__)

    def number(self, rows: Ints) -> tuple[Ints, Ints]:
        """Numbers (k,) of rows (k, width), and where each new one comes first.

        New rows get the next numbers, in their order.
        """
        keys = np.ascontiguousarray(rows).view(f"V{8 * rows.shape[1]}").ravel().tolist()
        last = len(self._number) - 1
        found = np.fromiter(map(self._number.__getitem__, keys), np.int64, len(keys))
        before = np.maximum.accumulate(np.concatenate([[last], found[:-1]]))
        return found, np.flatnonzero(found > before)
