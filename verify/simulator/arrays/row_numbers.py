"""Numbers for rows of integers: equal rows, equal numbers, in the order of their first coming."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.simulator.arrays.growing_array import GrowingArray

_Ints = NDArray[np.int64]


class RowNumbers:
    """A hash table with open addressing.

    Parameters
    ----------
    width : int
        Length of the rows.

    Attributes
    ----------
    table : (t,) int array
        Number of the row in each place, -1 where there is none; t is a power of two.
    """

    def __init__(self, width: int) -> None:
        self._known = GrowingArray(np.empty((0, width), dtype=np.int64))
        self.table: _Ints = np.full(64, -1, dtype=np.int64)

    def __len__(self) -> int:
        return len(self._known)

    @property
    def rows(self) -> _Ints:
        """All rows so far (k, width)."""
        return self._known.rows

    def open_for(self, more: int) -> tuple[_Ints, _Ints, int]:
        """Table, room for rows and their count, for a kernel that adds at most `more` rows."""
        count = len(self._known)
        if 2 * (count + more) > len(self.table):
            self.table = np.full(1 << (4 * (count + more)).bit_length(), -1, dtype=np.int64)
            _fill(self.table, self._known.rows)
        self._known.extend(more)
        return self.table, self._known.rows, count

    def close(self, count: int) -> None:
        """Tell how many rows there are after `open_for`."""
        self._known.rows = self._known.rows[:count]


def first_of_new(numbers: _Ints, count: int) -> _Ints:
    """Where each number from `count` on comes first, if they come in their order."""
    before = np.maximum.accumulate(np.concatenate([[count - 1], numbers[:-1]]))
    return np.flatnonzero(numbers > before)


@njit(cache=True)
def _place(row, table, known):
    """Where in the table the row is, or belongs."""
    code = np.uint64(14695981039346656037)  # Fowler, Noll and Vo's numbers
    for k in range(len(row)):
        code = (code ^ np.uint64(row[k])) * np.uint64(1099511628211)
        code = code ^ (code >> np.uint64(29))
    last = len(table) - 1
    at = np.int64(code & np.uint64(last))
    while table[at] >= 0:
        same, number = True, table[at]
        for k in range(len(row)):
            same = same and known[number, k] == row[k]
        if same:
            break
        at = (at + 1) & last  # ends: the table is at most half full
    return at


@njit(cache=True)
def find_row(row, table, known):
    """Give the number of a row, -1 if it has none."""
    return table[_place(row, table, known)]


@njit(cache=True)
def number_of_row(row, table, known, count):
    """Give (number of the row, count of rows): a new row gets the next number."""
    at = _place(row, table, known)
    if table[at] < 0:
        table[at] = count
        for k in range(len(row)):
            known[count, k] = row[k]
        return count, count + 1
    return table[at], count


@njit(cache=True)
def _fill(table, known):
    for number in range(len(known)):
        table[_place(known[number], table, known)] = number
