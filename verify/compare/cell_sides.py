"""Sides of the cuts on which the cells of a solution lie, from its doubled nodes.

No coordinate is compared across the cut: a cell that has a facet of the realised cut lies on the
side of that facet on which its last corner is, and its nodes are nodes of that side. From there
the side goes on from node to node, never across the cut, because nodes are doubled there. So a
sliver has the right side however thin it is, and a corner of the cut has as well.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.compare.sides import AskedCut, distance_to_cut
from verify.compare.simplices import Simplices, facet_normals
from verify.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bits = NDArray[np.int8]

# A facet within 60° of the cut as asked says which side is which. Steeper ones (of a cut that was
# snapped to mesh lines) get their sides from these.
_ALONG = 0.5
# Sine of the angle to a cut that is as doubtful as to lie off it by the whole deviation.
_STEEP = 0.5
# Facets are asked in the order of how sure it is which cut they realise.
_MARGINS = (1.0, 0.5, 0.2, 0.1, 0.0)
_PLUS, _MINUS, _BOTH = 1, 2, 3


def sides_of_cells(
    solution: Solution, shape: Simplices, cuts: Sequence[AskedCut], reach: float, same: float
) -> NDArray[np.int8]:
    """Side (m, c) of each cut on which cells lie: 1, −1; 0 of both, or far from the cut.

    Parameters
    ----------
    solution : Solution
    shape : Simplices
        Of its cells.
    cuts : sequence of pieces of each cut as asked
    reach : float
        How far from the cuts as asked sides are needed, m.
    same : float
        Places of nodes that are closer than this are the same, m.
    """
    nodes = np.ascontiguousarray(solution.cells[:, : shape.corners.shape[1]])
    facets = solution.cut_facets
    cell, corner, facet = _cells_on_facets(solution.points, nodes, facets, same)
    normal = np.nan_to_num(facet_normals(facets))  # 0 of a point
    beside = _beside_facets(shape, cell, corner, facet, facets, normal)
    cut, along, margin = _orientations(facets, normal, cuts, 0.5 * reach, same)
    centre = shape.corners.mean(axis=1)
    radius = np.linalg.norm(shape.corners - centre[:, None], axis=2).max(axis=1)
    sides = np.zeros((len(nodes), len(cuts)), dtype=np.int8)
    for k, pieces in enumerate(cuts):
        known = (cut[facet] == k) & (np.abs(along[facet]) >= _ALONG)
        plus = beside * along[facet] > 0.0
        level = np.min([np.abs(piece.level(centre)) for piece in pieces], axis=0)
        near = level <= reach + radius
        bits = np.zeros(len(nodes), dtype=np.int8)
        at_node = np.zeros(len(solution.points), dtype=np.int8)
        for least in _MARGINS:  # who doubts, is asked where nobody is surer
            ask = known & (margin[facet] >= least) & (bits[cell] == 0)
            asked = np.zeros_like(bits)
            np.bitwise_or.at(asked, cell[ask], np.where(plus[ask], _PLUS, _MINUS).astype(np.int8))
            fresh = np.flatnonzero((asked == _PLUS) | (asked == _MINUS))
            bits[fresh] = asked[fresh]
            _spread(nodes, near, fresh, bits, at_node)
        sides[:, k] = (bits == _PLUS).astype(np.int8) - (bits == _MINUS)
    return sides


def _cells_on_facets(
    points: Array, nodes: Ints, facets: Array, same: float
) -> tuple[Ints, Ints, Ints]:
    """Cells (k,) with a facet of the cut, the corner (k,) opposite to it, and that facet (k,)."""
    d = facets.shape[1]
    places, of_corner = np.unique(facets.reshape(-1, facets.shape[2]), axis=0, return_inverse=True)
    low, high = places.min(axis=0) - same, places.max(axis=0) + same
    inside = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    _, found = cKDTree(places).query(points[inside], distance_upper_bound=same)
    place = np.full(len(points), -1)
    place[inside] = np.where(found < len(places), found, -1)
    key_of_facet = np.sort(of_corner.reshape(-1, d), axis=1)

    at = place[nodes]
    some = np.flatnonzero((at >= 0).sum(axis=1) >= d)
    rows, corners, keys = [some[:0]], [some[:0]], [key_of_facet[:0]]
    for opposite in range(nodes.shape[1]):
        key = np.sort(np.delete(at[some], opposite, axis=1), axis=1)
        on = key[:, 0] >= 0
        rows.append(some[on])
        corners.append(np.full(on.sum(), opposite))
        keys.append(key[on])
    row, corner, key = (np.concatenate(column) for column in (rows, corners, keys))
    _, number = np.unique(np.vstack([key_of_facet, key]), axis=0, return_inverse=True)
    facet_of = np.full(number.max(initial=-1) + 1, -1)
    facet_of[number[: len(facets)]] = np.arange(len(facets))
    facet = facet_of[number[len(facets) :]]
    kept = facet >= 0
    return row[kept], corner[kept], facet[kept]


def _beside_facets(
    shape: Simplices, cell: Ints, corner: Ints, facet: Ints, facets: Array, normal: Array
) -> Array:
    """Side (k,) of a facet's own normal on which cells lie: of two that share it, the opposite."""
    off = shape.corners[cell, corner] - facets[facet, 0]
    height = np.sum(off * normal[facet], axis=1)
    # the higher of the two is sure of its side; the other may be as thin as round-off
    order = np.lexsort([-np.abs(height), facet])
    first = np.diff(facet[order], prepend=-1) != 0
    start = np.flatnonzero(first)[np.cumsum(first) - 1]
    leader = np.sign(height[order[start]])
    side = np.empty(len(height))
    side[order] = np.where(first, leader, -leader)
    return side


def _orientations(
    facets: Array, normal: Array, cuts: Sequence[AskedCut], deviation: float, step: float
) -> tuple[Ints, Array, Array]:
    """Cut (f,) that each facet realises, the cosine (f,) between their normals, and the margin.

    At a crossing a facet may be shorter than the cut's deviation and near to both cuts: then its
    direction counts as well. The margin is by how much it is less doubtful than another cut.
    """
    probes = np.concatenate([facets, facets.mean(axis=1, keepdims=True)], axis=1)
    count, each, d = probes.shape
    cosine, doubt = np.zeros((2, len(cuts), count))
    shift = 1e4 * step * normal  # the level is a distance: its slope is a cosine
    for k, pieces in enumerate(cuts):
        away, _, nearest = distance_to_cut(pieces, probes.reshape(-1, d))
        for number, piece in enumerate(pieces):
            at = np.flatnonzero(nearest.reshape(count, each)[:, -1] == number)
            centre = probes[at, -1]
            rise = piece.level(centre + shift[at]) - piece.level(centre - shift[at])
            cosine[k, at] = rise / (2e4 * step)
        farthest = away.reshape(count, each).max(axis=1)
        doubt[k] = (farthest / deviation) ** 2 + (1.0 - cosine[k] ** 2) / _STEEP**2
    cut = doubt.argmin(axis=0)
    if len(cuts) == 1:
        return cut, cosine[0], np.full(count, np.inf)
    margin = np.diff(np.partition(doubt, 1, axis=0)[:2], axis=0)[0]
    return cut, cosine[cut, np.arange(count)], margin


def _spread(nodes: Ints, near: NDArray[np.bool_], fresh: Ints, bits: Bits, at_node: Bits) -> None:
    """Hand the `bits` (m,) of `fresh` cells on to those `near` without any, by common nodes."""
    while len(fresh):
        given = np.zeros_like(at_node)
        np.bitwise_or.at(given, nodes[fresh], bits[fresh, None])
        given[at_node != 0] = 0  # a layer at a time: who was first, stays
        at_node |= given
        met = at_node[nodes]
        sides = np.where((met == _PLUS).any(axis=1), _PLUS, 0).astype(np.int8)
        sides |= np.where((met == _MINUS).any(axis=1), _MINUS, 0).astype(np.int8)
        sides[(sides == 0) & (met == _BOTH).any(axis=1)] = _BOTH  # at a tip: neither, from there on
        fresh = np.flatnonzero(near & (bits == 0) & (sides != 0))
        bits[fresh] = sides[fresh]
