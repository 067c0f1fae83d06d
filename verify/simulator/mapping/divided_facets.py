"""Triangles of a surface divided by one cut, wherever the body beneath is split.

What `verify.xfem.pieces` does for any number of cuts, for the one that is under way: at a step a
blade meets a hundred facets, and with so few only the number of calls costs.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints, Sides


class DividedFacets(NamedTuple):
    """Parts of triangles.

    Attributes
    ----------
    ends, positions : (z, 2) int and (z, 3) float arrays
        Of the new points: the edge on which each lies, that above the cut first, and where it is.
    ids, at : (q, 3) int and (q, 3, 3) float arrays
        Corners of the parts, in the direction of their facet, and their coordinates in it. New
        points count from the number of those given on.
    source, side : (q,) arrays
        Facet of each part, ascending, and its side of the cut; 0 if the facet is not divided.
    """

    ends: Ints
    positions: Floats
    ids: Ints
    at: Floats
    source: Ints
    side: Sides


def divide_facets(
    facets: Ints, values: Floats, points: Floats, is_cut: Callable[[Floats], Bools]
) -> DividedFacets:
    """Divide triangles by a cut where both places in which it crosses their edges are split.

    Parameters
    ----------
    facets : (f, 3) int array
        Places of their corners in `points`.
    values : (n,) float array
        Level set at the points, exactly zero within round-off.
    points : (n, 3) float array
    is_cut : callable
        Whether the body is split at places (z, 3).
    """
    above = values[facets] >= 0.0
    crossed = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    # the corner alone on its side comes first, then the others in the direction of the facet
    sides = above[crossed]
    alone = np.argmax(sides == (sides.sum(axis=1) == 1)[:, None], axis=1)
    turn = (alone[:, None] + np.arange(3)) % 3
    corners = facets[crossed[:, None], turn]
    positive = sides[np.arange(len(alone)), alone]
    # the points on the edges from that corner to both others, each edge once
    other, first = corners[:, 1:].ravel(), np.repeat(corners[:, 0], 2)
    up = np.repeat(positive, 2)
    edge = np.where(up, first, other) << 32 | np.where(up, other, first)
    edges, point = np.unique(edge, return_inverse=True)
    ends = np.stack([edges >> 32, edges & 0xFFFFFFFF], axis=1)
    high, low = values[ends].T
    share = np.stack([-low / (high - low), high / (high - low)], axis=1)
    places = np.einsum("ze,zei->zi", share, points[ends])
    # where the level set is zero at an end, the point is that end
    new = share[:, 1] > 0.0
    number = np.where(new, len(points) + np.cumsum(new) - 1, ends[:, 0])
    point = point.reshape(-1, 2)
    through = is_cut(places)[point].all(axis=1)
    crossed, turn, corners, point = (
        crossed[through],
        turn[through],
        corners[through],
        point[through],
    )
    mine = np.where(positive[through], 1, -1).astype(np.int8)

    # corners a, b, c and the points u on ab, v on ac
    ids = np.concatenate([corners, number[point]], axis=1)
    at = np.zeros((len(ids), 5, 3))
    rows = np.arange(len(ids))[:, None]
    at[rows, np.arange(3), turn] = 1.0
    own = np.where(mine[:, None] > 0, share[point, 0], share[point, 1])
    at[:, 3:] = own[:, :, None] * at[:, :1] + (1.0 - own)[:, :, None] * at[:, 1:3]
    # as in `verify.xfem.clip`: the diagonal begins at the corner with the lower number
    lower = corners[:, 1] < corners[:, 2]
    parts = np.empty((len(ids), 3, 3), dtype=np.int64)
    parts[:] = [[0, 3, 4], [3, 1, 2], [3, 2, 4]]
    parts[lower, 1, 2], parts[lower, 2, 0] = 4, 1
    triangles = ids[rows[:, :, None], parts]
    is_one = (triangles != triangles[:, :, [2, 0, 1]]).all(axis=2)
    is_whole = np.ones(len(facets), dtype=bool)
    is_whole[crossed] = False
    whole = np.flatnonzero(is_whole)
    source = np.concatenate([whole, np.repeat(crossed, 3)[is_one.ravel()]])
    order = np.argsort(source, kind="stable")
    side = np.stack([mine, -mine, -mine], axis=1)[is_one]
    unit = np.broadcast_to(np.eye(3), (len(whole), 3, 3))
    return DividedFacets(
        ends[new], places[new],
        np.concatenate([facets[whole], triangles[is_one]])[order],
        np.concatenate([unit, at[rows[:, :, None], parts][is_one]])[order],
        source[order], np.concatenate([np.zeros(len(whole), dtype=np.int8), side])[order],
    )  # fmt: skip
