"""Shares of the cut in the supports of nodes that a blade has swept, and when they begin to grow.

A node is released when its cut begins to be swept. Its tie force is then multiplied by 1 − s, with
s(t) the swept share of ∫ N dA over the cut in its support. Nothing is late: s is a half when the
blade is in the middle. Integrals are exact where the time of the blade is linear over a simplex of
the cut: on straight parts of a path at one speed. Other cuts are divided.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.geometry.simplices import measures

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

_DIVISIONS = 6  # of each edge of a simplex of the cut
_STILL = 1e-30  # s: a simplex that is swept at once
_LINEAR = 1e-13  # of the longest time in which a simplex is swept
_ROUND_OFF = 16 * np.finfo(float).eps  # of a time
_KNOWN = 8  # times whose factors are kept: a step and its account take four


class CutSimplices(NamedTuple):
    """Simplices of a cut, each with the nodes whose support it lies in.

    Attributes
    ----------
    points : (q, k, d) array
        Corners (k = 2: segments, 3: triangles), m.
    piece : (q,) int array
        What opens as a whole: the element or facet of each.
    node : (q, n) int array
        Numbers of the nodes.
    shape : (q, k, n) array
        Value of each node's shape function at the corners; between them it is linear.
    """

    points: Array
    piece: Numbers
    node: Numbers
    shape: Array


class Passage(NamedTuple):
    """When a blade sweeps pieces of a cut, s.

    Attributes
    ----------
    let_go : (pieces,) array
        When each piece opens so that each of its nodes can be let go as its cut begins to be
        swept. NaN for other pieces.
    passed : (pieces,) array
        When the blade has passed all of it. NaN for other pieces.
    begins : (q, n) array
        When the cut begins to be swept in the support of each node of each simplex.
    """

    let_go: Array
    passed: Array
    begins: Array


@dataclass(frozen=True)
class Fading:
    """Factors of some forces that fall from 1 to 0 as a blade sweeps what they hold.

    Attributes
    ----------
    row : (e,) int array
        Which of the forces each swept simplex belongs to.
    times : (e, k) array
        When the blade is at its corners, s, ascending.
    values : (e, k) array
        Shape function there, times the measure of the simplex, over ∫ N dA of what was not swept
        yet at the start.
    count : int
        Number of forces.
    """

    row: Numbers
    times: Array
    values: Array
    count: int
    _known: dict[float, Array] = field(default_factory=dict, repr=False, compare=False)

    def at(self, time: float) -> Array:
        """Return the factors (count,) at a time; repeated calls at few times evaluate them once."""
        if time not in self._known:
            if len(self._known) == _KNOWN:
                self._known.clear()
            left = _left(self.times, self.values, time)
            self._known[time] = np.bincount(self.row, left, self.count)
        return self._known[time]

    @cached_property
    def last(self) -> float:
        """Time from which on all are zero, s."""
        return float(self.times.max(initial=-np.inf))


class SweptShares:
    """Swept shares of one or several cuts over their pieces (elements or facets).

    Parameters
    ----------
    pieces : int
        Number of pieces.
    divisions : int
        Of each edge of a simplex of a cut over which the time is not linear; one where nothing is
        asked but when it is passed.
    by_node : bool
        Whether nodes are let go one by one, or as soon as all pieces at them are open.
    """

    def __init__(self, pieces: int, divisions: int = _DIVISIONS, by_node: bool = False) -> None:
        self._pieces, self._divisions, self._by_node_alone = pieces, divisions, by_node
        self._parts: list[tuple[Numbers, Array, Array, Array]] = []

    @property
    def used(self) -> bool:
        """Whether a blade sweeps anything."""
        return any(len(node) for node, *_ in self._parts)

    def add(self, cut: CutSimplices, passed_at: Callable[[Array], Array]) -> Passage:
        """Add the simplices of one cut that a blade sweeps.

        Parameters
        ----------
        cut : CutSimplices
        passed_at : callable
            When the blade is at points (n, d) of the cut, s.

        """
        corners = cut.points.shape[1]
        inside, parts = _divided(corners, self._divisions)
        points = inside @ cut.points
        times = passed_at(points.reshape(-1, points.shape[2])).reshape(points.shape[:2])
        if self._divisions > 1:
            whole = _divided(corners, 1)
            at_corners = passed_at(cut.points.reshape(-1, points.shape[2])).reshape(-1, corners)
            off = np.abs(times - at_corners @ inside.T).max(initial=0.0)
            longest = np.ptp(times, axis=1).max(initial=0.0)
            if off <= _LINEAR * longest + _ROUND_OFF * np.abs(times).max(initial=0.0):
                (inside, parts), times = whole, at_corners @ whole[0].T
        times = times[:, parts]
        begin, end = times.min(axis=2), times.max(axis=2)
        values = np.einsum("skc,qcn->qsnk", inside[parts], cut.shape)
        values *= (measures(cut.points) / len(parts))[:, None, None, None]
        nodes = np.broadcast_to(cut.node[:, None], values.shape[:3])
        held = values.max(axis=3) > 0.0
        count = int(cut.node.max(initial=-1)) + 1

        starts = np.full(count, np.inf)
        np.minimum.at(starts, nodes[held], np.broadcast_to(begin[..., None], held.shape)[held])
        let_go, passed = np.full((2, self._pieces), np.nan)
        # of a piece along whose edge or face the cut runs the nodes off the cut have no share: on
        # which side of the cut it lies does not matter
        on_cut = cut.shape.max(axis=1) > 0.0
        np.fmin.at(let_go, cut.piece, np.where(on_cut, starts[cut.node], np.inf).min(axis=1))
        np.fmax.at(passed, cut.piece, end.max(axis=1))
        free = starts
        if not self._by_node_alone:
            free = np.full(count, -np.inf)
            opens = np.broadcast_to(let_go[cut.piece, None], cut.node.shape)
            np.maximum.at(free, cut.node[on_cut], opens[on_cut])

        node, order = nodes[held], np.argsort(times, axis=2)[:, :, None]
        sorted_times = np.take_along_axis(times[:, :, None], order, axis=3)
        values = np.take_along_axis(values, order, axis=3)[held]
        moments = np.broadcast_to(sorted_times, (*held.shape, corners))[held]
        self._parts.append((node, free[node], moments, values))
        return Passage(let_go, passed, starts[cut.node])

    def fading(self, nodes: Numbers, since: float, close: float = 0.0) -> Fading:
        """Give the factors of the forces at nodes (k,) that are let go at a time.

        Only cuts count that are open around a node then. Where all is swept already the factor is
        zero at once: a step longer than an element opens late.

        Parameters
        ----------
        nodes : (k,) int array
            A node may come several times.
        since : float
            In s.
        close : float
            Times that differ by no more are one, s.
        """
        free, times, values, first = self._by_node
        known = np.minimum(nodes, len(first) - 2)
        size = np.where(nodes == known, first[known + 1] - first[known], 0)
        row = np.repeat(np.arange(len(nodes)), size)
        entry = first[known][row] + np.arange(len(row)) - np.repeat(np.cumsum(size) - size, size)
        left = (free[entry] <= since + close) & (times[entry, -1] > since)
        entry, row = entry[left], row[left]
        times, values = times[entry], values[entry]
        total = np.bincount(row, _left(times, values, since), len(nodes))
        return Fading(row, times, values / total[row, None], len(nodes))

    @cached_property
    def _by_node(self) -> tuple[Array, Array, Array, Numbers]:
        """When a node is free, times and values of all simplices; the first of a node."""
        node, *columns = (np.concatenate(one) for one in zip(*self._parts, strict=True))
        order = np.argsort(node, kind="stable")
        first = np.searchsorted(node[order], np.arange(int(node.max(initial=-1)) + 2))
        free, times, values = (column[order] for column in columns)
        return free, times, values, first


def swept_measure(times: Array, sizes: Array, time: float) -> float:
    """Sum the swept parts of simplices of given sizes (e,) at a time, m² (in the plane m).

    Parameters
    ----------
    times : (e, k) array
        When the blade is at their corners, s, ascending.
    sizes : (e,) array
    time : float
    """
    gone = times[:, -1] <= time
    now = ~gone & (times[:, 0] < time)
    left = _left(times[now], np.repeat(sizes[now, None], times.shape[1], axis=1), time)
    return float(sizes[gone].sum() + sizes[now].sum() - left.sum())


def _left(times: Array, values: Array, time: float) -> Array:
    """Integral (e,) of a linear function over the unswept parts of simplices at a time.

    Of a triangle that is, from the middle corner on, the triangle at the last corner, and before
    all but the one at the first.

    Parameters
    ----------
    times, values : (e, k) array
        At the corners, ascending in time; values times the measure of the simplex.
    time : float
    """
    first, last = times[:, :1], times[:, -1:]
    # corner by corner and without `clip`: many times faster along short axes
    still = (last - time) / np.maximum(last - times[:, :-1], _STILL)
    still = np.minimum(np.maximum(still, 0.0), 1.0)
    end = values[:, -1]
    if times.shape[1] == 2:
        share = still[:, 0]
        return share * (end + 0.5 * share * (values[:, 0] - end))
    gone = (time - first) / np.maximum(times[:, 1:] - first, _STILL)
    gone, begin = np.minimum(np.maximum(gone, 0.0), 1.0), values[:, 0]
    behind = gone * (values[:, 1:] - begin[:, None])
    ahead = still * (values[:, :-1] - end[:, None])
    swept = gone[:, 0] * gone[:, 1] * (begin + (behind[:, 0] + behind[:, 1]) / 3.0)
    left = still[:, 0] * still[:, 1] * (end + (ahead[:, 0] + ahead[:, 1]) / 3.0)
    return np.where(time < times[:, 1], (begin + values[:, 1] + end) / 3.0 - swept, left)


def _divided(corners: int, n: int) -> tuple[Array, Numbers]:
    """Points (l, k) in barycentric coordinates of a simplex, its n or n² equal parts (s, k)."""
    if corners == 2:
        at = np.linspace(0.0, 1.0, n + 1)
        return np.stack([1.0 - at, at], axis=1), np.stack([np.arange(n), 1 + np.arange(n)], axis=1)
    number = {(i, j): 0 for i in range(n + 1) for j in range(n + 1 - i)}
    number = {place: k for k, place in enumerate(number)}
    at = np.array(list(number), dtype=float) / n
    ups = [[(i, j), (i + 1, j), (i, j + 1)] for i, j in number if i + j < n]
    downs = [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i, j in number if i + j < n - 1]
    parts = np.array([[number[place] for place in part] for part in ups + downs])
    return np.concatenate([1.0 - at.sum(axis=1, keepdims=True), at], axis=1), parts
