"""Shares of the cut in the supports of nodes that a blade has swept, and when they begin to grow.

A node is let go when its cut begins to be swept. The force that has held it is then multiplied by
1 − s, with s(t) the swept share of ∫ N dA over the cut in its support: nothing is late, as s is a
half when the blade is in the middle. Integrals run over simplices so small that the time of the
blade is linear in each; every one is swept at a constant rate.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

_DIVISIONS = 6  # of each edge of a simplex of the cut
_STILL = 1e-30  # s: a simplex that is swept at once


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
    begin, end : (e,) array
        When it is swept, s.
    weight : (e,) array
        Share of what was not swept yet at the start.
    count : int
        Number of forces.
    """

    row: Numbers
    begin: Array
    end: Array
    weight: Array
    count: int

    def at(self, time: float) -> Array:
        """Return the factors (count,) at a time."""
        left = self.weight * (1.0 - _passed(self.begin, self.end, time))
        return np.bincount(self.row, left, self.count)

    @cached_property
    def last(self) -> float:
        """Time from which on all are zero, s."""
        return float(self.end.max(initial=-np.inf))


class SweptShares:
    """Swept shares of one or several cuts over their pieces (elements or facets).

    Parameters
    ----------
    pieces : int
        Number of pieces.
    divisions : int
        Of each edge of a simplex of the cut; one where nothing is asked but when it is passed.
    by_node : bool
        Whether nodes are let go one by one, or as soon as all pieces at them are open.
    """

    def __init__(self, pieces: int, divisions: int = _DIVISIONS, by_node: bool = False) -> None:
        self._pieces, self._divisions, self._by_node_alone = pieces, divisions, by_node
        self._parts: list[tuple[Numbers, Numbers, Array, Array, Array]] = []

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
        inside, parts = _divided(cut.points.shape[1], self._divisions)
        points = inside @ cut.points
        times = passed_at(points.reshape(-1, points.shape[2])).reshape(points.shape[:2])[:, parts]
        begin, end = times.min(axis=2), times.max(axis=2)
        shape = (inside[parts].mean(axis=1) @ cut.shape) / len(parts)
        weight = shape * measures(cut.points)[:, None, None]
        nodes = np.broadcast_to(cut.node[:, None], weight.shape)
        held = weight > 0.0
        count = int(cut.node.max(initial=-1)) + 1

        starts = np.full(count, np.inf)
        np.minimum.at(starts, nodes[held], np.broadcast_to(begin[..., None], held.shape)[held])
        let_go, passed = np.full((2, self._pieces), np.nan)
        np.fmin.at(let_go, cut.piece, starts[cut.node].min(axis=1))
        np.fmax.at(passed, cut.piece, end.max(axis=1))
        free = starts
        if not self._by_node_alone:
            free = np.full(count, -np.inf)
            np.maximum.at(free, cut.node, np.broadcast_to(let_go[cut.piece, None], cut.node.shape))

        moments = (np.broadcast_to(x[..., None], held.shape)[held] for x in (begin, end))
        node = nodes[held]
        self._parts.append((node, free[node], *moments, weight[held]))  # type: ignore[arg-type]
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
        free, begin, end, weight, first = self._by_node
        known = np.minimum(nodes, len(first) - 2)
        size = np.where(nodes == known, first[known + 1] - first[known], 0)
        row = np.repeat(np.arange(len(nodes)), size)
        entry = first[known][row] + np.arange(len(row)) - np.repeat(np.cumsum(size) - size, size)
        left = (free[entry] <= since + close) & (end[entry] > since)
        entry, row = entry[left], row[left]
        begin, end, weight = begin[entry], end[entry], weight[entry]
        total = np.bincount(row, weight * (1.0 - _passed(begin, end, since)), len(nodes))
        return Fading(row, begin, end, weight / total[row], len(nodes))

    @cached_property
    def _by_node(self) -> tuple[Array, Array, Array, Array, Numbers]:
        """When a node is free, and begin, end and weight of all simplices; the first of a node."""
        node, *columns = (np.concatenate(one) for one in zip(*self._parts, strict=True))
        order = np.argsort(node, kind="stable")
        first = np.searchsorted(node[order], np.arange(int(node.max(initial=-1)) + 2))
        free, begin, end, weight = (column[order] for column in columns)
        return free, begin, end, weight, first


def _passed(begin: Array, end: Array, time: float) -> Array:
    """Return the share (e,) of each simplex that is swept at a time."""
    share = (time - begin) / np.maximum(end - begin, _STILL)
    return np.clip(share, 0.0, 1.0)


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


def measures(points: Array) -> Array:
    """Lengths or areas (q,) of simplices (q, k, d)."""
    edges = points[:, 1:] - points[:, :1]
    gram = np.linalg.det(edges @ edges.swapaxes(1, 2)).clip(0.0)
    return np.asarray(np.sqrt(gram) / (1.0 if edges.shape[1] == 1 else 2.0))
