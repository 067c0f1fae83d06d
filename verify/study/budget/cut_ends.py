"""Realised ends of a cut, and by how many elements an answer is that of another cut.

Linear elements without tip functions are too stiff at the end of a cut. Away from it their error
is, to first order, what the displacement changes by when the end is moved (the derivative by its
place, the only field that can come from there), so that an answer is that of a cut with other ends.
How far these are off is a number of elements that depends on where the end falls among the nodes
alone. Measured on a Griffith crack (docs/guide/studies.md), for an end that is realised on an edge
of which the hindmost node lies `behind` it: two thirds of `behind`, and a third of an element more.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import Body
from verify.compare.realised_geometry import polylines_of
from verify.geometry.nearest import feet

Array = NDArray[np.float64]

_BEHIND, _STIFF, _SPREAD = 2 / 3, 0.355, 0.22  # of elements; holds for 95 % of 264 ends
_REACH = 2.0  # elements: an end farther off than that is not the same end
_ON = 1e-9  # elements


@dataclass(frozen=True)
class CutEnd:
    """An end of a cut inside the body; lengths in elements, positive beyond the end as asked.

    Attributes
    ----------
    place : (float, float)
        As asked, m.
    moved : float
        How far out the end is realised.
    nodes : float
        Place of the hindmost node, along the cut, of the element edge on which it is realised.
        The nodes of that edge are not enriched, so that the cut does not open there.
    acts : float
        Expected place of the end of the cut whose answer this is, half-width `uncertainty`.
    uncertainty : float
    """

    place: tuple[float, float]
    moved: float
    nodes: float
    acts: float
    uncertainty: float


def cut_ends(
    body: Body, facets: Array, points: Array, cells: NDArray[np.int64], size: float
) -> list[CutEnd]:
    """Find the ends of cuts inside a plane body, as realised.

    Parameters
    ----------
    body : Body
        With the cuts as asked.
    facets : (f, 2, 2) array
        ``Solution.cut_facets``, m.
    points, cells : (n, 2) and (m, 3) arrays
        Background mesh that was cut, m.
    size : float
        Its element size, m.

    Returns
    -------
    list of CutEnd
        Those with a realised end within two elements: a cut shorter than an element has none.
    """
    lines = [line for line in polylines_of(facets) if not np.array_equal(line[0], line[-1])]
    free = np.array([line[k] for line in lines for k in (0, -1)]).reshape(-1, 2)
    apart = np.linalg.norm(free[:, None] - free[None], axis=2)
    free = free[(apart <= _ON * size).sum(axis=1) == 1]  # where cuts meet none of them ends
    edges = np.unique(
        np.sort(np.concatenate([np.roll(cells, k, axis=1)[:, :2] for k in range(3)])), axis=0
    )
    found = []
    for tip in body.tips:
        off = np.linalg.norm(free - tip, axis=1)
        if not len(off) or off.min() > _REACH * size:
            continue
        end, outwards = free[off.argmin()], _outwards(body, tip)
        moved = float((end - tip) @ outwards) / size
        nodes = float((_closed(points, edges, end, size) - tip).dot(outwards).min()) / size
        acts = moved - _BEHIND * (moved - min(nodes, moved)) - _STIFF
        found.append(CutEnd((float(tip[0]), float(tip[1])), moved, nodes, acts, _SPREAD))
    return found


def _outwards(body: Body, tip: Array) -> Array:
    """Direction (2,) in which the cut would go on past `tip`."""
    ways = [
        (np.linalg.norm(part.piece.point(np.array([t]))[0] - tip), part, t, sign)
        for part in body.parts
        for t, sign in ((part.start, -1.0), (part.end, 1.0))
    ]
    _, part, t, sign = min(ways, key=lambda way: way[0])
    return np.asarray(sign * part.piece.tangent(np.array([t]))[0])


def _closed(points: Array, edges: NDArray[np.int64], end: Array, size: float) -> Array:
    """Nodes (1 or 2, 2) at which a cut with this end does not open."""
    foot = feet(end, points[edges[:, 0]], points[edges[:, 1]])
    both: Array = points[edges[np.linalg.norm(foot - end, axis=1).argmin()]]
    at = np.linalg.norm(both - end, axis=1) <= _ON * size
    return both[at] if at.any() else both
