"""Facets and nodes of a boundary that a support on a part of it holds; how far it reaches beyond.

A support cannot end inside a facet of linear elements. All solvers follow one rule: it holds every
facet that its part meets with positive measure. As facets are divided what is held shrinks to the
part, so that the energy under a load rises from level to level.
"""

from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.nearest import nearest_parts
from verify.records import Regularisation
from verify.scene.geometry import Geometry
from verify.scene.parts import on_part, pieces_on_part, size_of
from verify.scene.tables import SceneTables

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

#: of an end that is not where the part ends: twice, in m and in element sizes h
END_OF_SUPPORT = "support holds more than its part, to the edge of a facet"
_DEPTH = 1e-5  # of the body: a part that reaches less far into a facet does not hold it
_COVERED = 1e-9  # of a facet: what may be left of one on which no part ends


@dataclass(frozen=True)
class HeldFacets:
    """Facets that a support holds.

    Attributes
    ----------
    held : (q,) bool array
    ended : (e,) int array
        Those of them in which the part ends.
    shift : float
        How far the farthest point that is held is from the part, m.
    """

    held: NDArray[np.bool_]
    ended: Ints
    shift: float


def held_facets(
    geometry: Geometry,
    where: str,
    corners: Array,
    boundary: Array | None = None,
    facet: Ints | None = None,
    depth: Array | None = None,
) -> HeldFacets:
    """Find the facets that a support on the part `where` holds.

    Parameters
    ----------
    geometry, where, corners, boundary
        As of `verify.scene.parts.pieces_on_part`.
    facet : (q,) int array, optional
        Where a cut divides facets, and `corners` are simplices in them: number of the facet, and
        of its side of the cut. What lies on each side is held for itself.
    depth : (q,) array, optional
        How far a part must at least reach into what lies on a side, m.
    """
    boundary = corners if boundary is None else boundary
    facet = np.arange(len(corners)) if facet is None else facet
    pieces = pieces_on_part(geometry, where, corners, boundary)
    k, size = corners.shape[1], size_of(boundary)
    edges = corners[:, 1:] - corners[:, :1]
    gram = np.linalg.det(edges @ np.swapaxes(edges, 1, 2))
    measure = np.sqrt(np.maximum(gram, 0.0)) / factorial(k - 1)
    lengths = [np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i, j in _pairs(k)]
    of_facet = np.bincount(facet, measure)
    covered = np.bincount(facet, measure * pieces.covered(len(corners)))
    reach, least = np.zeros(len(of_facet)), np.full(len(of_facet), _DEPTH * size)
    np.maximum.at(reach, facet, np.max(lengths, axis=0))
    if depth is not None:
        np.maximum.at(least, facet, depth)
    least = np.minimum(least * reach ** (k - 2), 0.5 * of_facet)
    held = (covered > 0.0) & (covered >= least)
    ended = np.flatnonzero(held & (of_facet - covered > np.maximum(least, _COVERED * of_facet)))
    beyond = [
        _reach(corners[facet == one], pieces.places(corners)[facet[pieces.facet] == one])
        for one in ended
    ]
    return HeldFacets(held[facet], ended, max(beyond, default=0.0))


def shifted_ends(found: list[HeldFacets], size: float) -> list[Regularisation]:
    """Report by how much supports hold more than their parts; `size` is that of the elements, m."""
    count, shift = (
        sum(len(one.ended) for one in found),
        max((one.shift for one in found), default=0.0),
    )
    if not count:
        return []
    return [
        Regularisation(END_OF_SUPPORT, count, shift, "m"),
        Regularisation(END_OF_SUPPORT, count, shift / size, "h"),
    ]


def held_nodes(
    scene: SceneTables, where: str, places: Array, facets: tuple[Ints, Array], key: str
) -> tuple[Ints, HeldFacets]:
    """Find the nodes of the boundary that a support on the part `where` holds.

    Those of the facets that it holds, each on its own side of the cuts; and those on the part at
    whose place no facet is held: a part may be a corner or an edge of the body.

    Parameters
    ----------
    scene : SceneTables
    where : str
        Name of a part, ``boundary``, or an inequality.
    places : (n, d) array
        Places of the nodes of the boundary, m; equal to the last bit for the copies of one.
    facets : (q, j) int array and (q, k, d) array
        Nodes of each facet, numbers in `places`, and its corners, m.
    key : str
        Key of the scene that names the part, for the message.

    Returns
    -------
    nodes : (h,) int array
        Ascending.
    found : HeldFacets

    Raises
    ------
    InputError
        If there is none.
    """
    found = held_facets(scene.geometry, where, facets[1])
    mark = np.zeros(len(places), dtype=bool)
    mark[facets[0][found.held]] = True
    mark |= points_apart(scene, where, places, mark)
    if not mark.any():
        raise no_node(scene, where, key)
    return np.flatnonzero(mark), found


def no_node(scene: SceneTables, where: str, key: str) -> InputError:
    """Error of a support on a part that holds nothing."""
    return InputError(f"{key}: no node of the boundary lies in '{where}'", str(scene.file or ""))


def points_apart(
    scene: SceneTables, where: str, places: Array, held: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell which nodes (n,) of the boundary lie on a part where it holds none (n,) by a facet."""
    _, place = np.unique(places, axis=0, return_inverse=True)
    taken = np.zeros(len(places), dtype=bool)
    taken[place.ravel()[held]] = True
    size = float(np.ptp(places, axis=0).max(initial=0.0))
    return np.asarray(on_part(scene.geometry, where, places, size) & ~taken[place.ravel()])


def _reach(corners: Array, pieces: Array) -> float:
    """How far the farthest corner of simplices (s, k, d) is from pieces (p, k, d) of them, m."""
    points, apart = corners.reshape(-1, corners.shape[2]), []
    for i, j in _pairs(corners.shape[1]):
        apart.append(nearest_parts(points, pieces[:, [i, j]])[0])
    return float(np.min(apart, axis=0).max())


def _pairs(corners: int) -> list[tuple[int, int]]:
    return list(combinations(range(corners), 2))
