"""Fields known on two sides of a cut; their interpolants stand in for solvers, and are judged."""

import numpy as np

from verify.errors import InputError
from verify.judge.accuracy import assess_accuracy
from verify.judge.verdict import with_verdicts
from verify.result import SolveRecord, Status


def judged(scene, solvers, exact=None):
    """Judge `solvers`: name -> {level: solution}, all of them solved."""
    rows = [
        SolveRecord("a test", name, level, Status.SOLVED, size=s.size)
        for name, own in solvers.items()
        for level, s in own.items()
    ]
    return with_verdicts(scene, assess_accuracy(scene, rows, solvers, exact))


class _TwoSided:
    """Smooth on each side of a cut; `near` decides the side.

    Parameters
    ----------
    height : callable
        Level (n,) of points (n, d) over the cut.
    swapped : bool
        Whether each side has the field of the other.
    """

    def __init__(self, height, swapped=False):
        self._height, self._sign = height, -1 if swapped else 1

    def _above(self, points, near):
        return self._sign * self._height(points if near is None else near) > 0

    def strain_energy(self, scene):
        raise InputError("it is integrated")

    def displacement(self, points, near=None):
        above, below = self.values(*points.T)
        return np.where(self._above(points, near)[:, None], above, below)

    def gradient(self, points, near=None):
        above, below = (np.array(rows).transpose(2, 0, 1) for rows in self.slopes(*points.T))
        return np.where(self._above(points, near)[:, None, None], above, below)


class Cubic(_TwoSided):
    """In the plane."""

    singular_points = np.zeros((0, 2))

    def values(self, x, y):
        return np.column_stack([x * x * y, 0.3 + y**3 - x]), np.column_stack([y * y, x * y * y])

    def slopes(self, x, y):
        one = np.ones_like(x)
        above = [[2 * x * y, x * x], [-one, 3 * y * y]]
        return above, [[0 * x, 2 * y], [y * y, 2 * x * y]]


class Quadratic(_TwoSided):
    """In space, a tenth as large as the body."""

    singular_points = np.zeros((0, 3))

    def values(self, x, y, z):
        above = 0.1 * np.column_stack([x * y, 0.3 + z * z, y * z - x])
        return above, 0.1 * np.column_stack([y * y, x * z, x * x - z])

    def slopes(self, x, y, z):
        o, i = np.zeros_like(x), np.ones_like(x)
        above = 0.1 * np.array([[y, x, o], [o, o, 2 * z], [-i, z, y]])
        return above, 0.1 * np.array([[o, 2 * y, o], [z, o, x], [2 * x, o, -i]])
