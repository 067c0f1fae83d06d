"""Forces that hold what the cut has released, and fade as the blade sweeps it.

When facets open, a group of nodes that were tied falls into several. Each node is held on by the
force r = M a − f that it was held by before (f: loads less internal and viscous forces), multiplied
by what is not swept yet of the cut in its support. The sum over the group is zero, as its forces
were in balance: momentum is kept, and no acceleration jumps.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


class Hold(NamedTuple):
    """Forces (k, d) on nodes (k,), N, and their factors (k,) from 1 to 0 at a time."""

    nodes: Numbers
    forces: Array
    factor: Callable[[float], Array]


class Holds:
    """All such forces of a body.

    Parameters
    ----------
    shape : (n, d) tuple of int
        Of nodal arrays.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self._shape, self._holds = shape, list[Hold]()

    def add(self, hold: Hold, time: float) -> None:
        """Add the forces of a release at a time, and drop those that have faded."""
        self._holds = [one for one in self._holds if one.factor(time).any()]
        self._holds.append(hold)

    def at(self, time: float) -> Array:
        """Sum the forces (n · d,) at a time, N."""
        total = np.zeros(self._shape)
        for nodes, forces, factor in self._holds:
            total[nodes] += factor(time)[:, None] * forces
        return total.ravel()


def parted_nodes(before: Numbers, after: Numbers) -> Numbers:
    """Nodes of the groups that have fallen apart, by the leader (n,) of each node's group."""
    pairs = np.unique(np.column_stack([before, after]), axis=0)
    return np.flatnonzero((np.bincount(pairs[:, 0], minlength=len(before)) > 1)[before])
