"""Parts of the boundary of a body: which points lie on them, and which pieces of facets.

A facet is divided where a comparison of the part's formula changes: where that is affine, exactly;
else by bisection, until its chords are within a tolerance. Loads and supports of every solver rest
on these pieces, so that a part is the same for all of them, whatever the mesh.

A support cannot end inside a facet of linear elements. All solvers follow one rule: it holds every
facet that its part meets with positive measure. As facets are divided the held facets shrink to the
part, so that the energy under a load rises from level to level.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.simplices import (
    feet,
    halves,
    measures,
    nearest_parts,
    split_at_zeros,
    unit_normals,
)
from verify.result import Regularisation
from verify.scene.geometry import Geometry
from verify.scene.regions import Side, comparisons, is_affine, parse_region
from verify.scene.tables import SceneTables

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_TOLERANCE = 1e-9  # of the body's size: a point closer than that to a part is on it
_SAME = 1e-12  # of the body: a node closer than that to the end of a part is on it
# of the body, for segments and triangles: how far a chord of a curved end may be off it, and the
# smallest simplex that is divided for that
_CHORD = {2: 1e-13, 3: 1e-6}
_SMALLEST = {2: 1e-13, 3: 2e-4}
# of the body: the largest simplex on which a comparison that is not affine is tried
_LARGEST = {2: 1 / 256, 3: 1 / 64}
_STRIP = 1e-5  # of the body: a narrower strip beside an edge belongs to its neighbour
_STRAIGHT = 1e-6  # of 1 − cos of an angle: a boundary that turns less has no edge


def on_part(geometry: Geometry, where: str, points: Array, size: float) -> NDArray[np.bool_]:
    """Tell which points (n, d) of the boundary lie on the part `where`, its ends included.

    `size` is the size of the body, m: within 1e-9 of it a point is on a part. So is the node at
    the end of ``x < 0.3``, whichever way it was rounded.
    """
    if where == "boundary":
        return np.ones(len(points), dtype=bool)
    if geometry.is_part(where):
        return geometry.on(where, points, _TOLERANCE * size)
    steps = _TOLERANCE * size * np.eye(geometry.dimension)
    return _in_or_beside(where, points, [*steps, *-steps])


def _in_or_beside(where: str, points: Array, steps: list[Array]) -> NDArray[np.bool_]:
    """Whether points (n, d), or what some steps (d,) or (n, d) lead to, lie in an inequality."""
    region = parse_region(where, points.shape[1])
    found = region(points)
    for step in steps:
        found |= region(points + step)
    return found


@dataclass(frozen=True)
class Pieces:
    """Simplices that make up what some facets have in common with a part of the boundary.

    Attributes
    ----------
    facet : (r,) int array
        Facet of each.
    barycentric : (r, k, k) array
        Barycentric coordinates of its corners (second axis) in the facet.
    """

    facet: Ints
    barycentric: Array

    @property
    def share(self) -> Array:
        """(r,) measure of each over the measure of its facet."""
        return np.abs(np.linalg.det(self.barycentric))

    def covered(self, count: int) -> Array:
        """Share (count,) of each facet that lies on the part."""
        return np.bincount(self.facet, self.share, minlength=count)

    def places(self, corners: Array) -> Array:
        """Corners (r, k, d) of the pieces of facets (q, k, d), m."""
        return np.asarray(self.barycentric @ corners[self.facet])

    def __getitem__(self, rows: NDArray) -> "Pieces":
        """Return some of them."""
        return Pieces(self.facet[rows], self.barycentric[rows])

    def __add__(self, other: "Pieces") -> "Pieces":
        """Return them and others."""
        both = np.concatenate([self.barycentric, other.barycentric])
        return Pieces(np.concatenate([self.facet, other.facet]), both)

    @staticmethod
    def whole(facets: Ints, k: int) -> "Pieces":
        """Facets (q,) with k corners as they are."""
        return Pieces(facets, np.broadcast_to(np.eye(k), (len(facets), k, k)))


def size_of(boundary: Array) -> float:
    """Size of a body by the facets (b, k, d) of its boundary: the longest side of its box, m."""
    return max((float(np.ptp(x)) for x in np.moveaxis(boundary, 2, 0) if x.size), default=0.0)


def pieces_on_part(
    geometry: Geometry, where: str, corners: Array, boundary: Array | None = None
) -> Pieces:
    """Divide facets by a part of the boundary and return what lies on it; it may be nothing.

    Parameters
    ----------
    geometry : Geometry
        Names parts.
    where : str
        Name of a part, ``boundary``, or an inequality.
    corners : (q, k, d) array
        Facets, or simplices in them: segments (k = 2) or triangles (k = 3), m.
    boundary : (b, k, d) array, optional
        All facets of the boundary, if these are not all.

    Notes
    -----
    A strip beside an edge of the body that is narrower than 1e-5 of the body belongs to its
    neighbour: ``x > 0.999999`` means a face, and nothing of the faces beside it. A curved end is
    followed to 1e-6 of the body in space, to round-off in the plane.
    """
    count, k, d = corners.shape
    boundary = corners if boundary is None else boundary
    if where == "boundary":
        return Pieces.whole(np.arange(count), k)
    if geometry.is_part(where):
        # the middle too: three corners on the rim of a group are no facet of it
        asked = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
        on = geometry.on(where, asked.reshape(-1, d), _TOLERANCE * size_of(boundary))
        return Pieces.whole(np.flatnonzero(on.reshape(count, k + 1).all(axis=1)), k)
    return _of_formula(where, k, d, *(x.astype(float).tobytes() for x in (corners, boundary)))


@lru_cache(maxsize=16)
def _of_formula(where: str, k: int, d: int, facets: bytes, every: bytes) -> Pieces:
    """Pieces on the part of an inequality; kept, as loads that change in time ask at each step."""
    corners, boundary = (np.frombuffer(x).reshape(-1, k, d) for x in (facets, every))
    count, size = len(corners), size_of(boundary)
    pieces = Pieces.whole(np.arange(count), k)
    largest = np.inf if is_affine(where) else _LARGEST[k] * size
    for sides in comparisons(where, d):
        pieces, values = _refined(pieces, corners, sides, size, largest)
        pieces = clipped(pieces, values)
    points = _off_ridges(pieces.places(corners), boundary, size)
    # only along its normal is a facet on a part that it does not meet, so that x < 0 is a face
    away = _TOLERANCE * size * _normal_projections(corners)[pieces.facet]
    steps = [sign * step for step in np.moveaxis(away, 1, 0) for sign in (1.0, -1.0)]
    return _joined(pieces, _in_or_beside(where, points, steps), count)


def _refined(
    pieces: Pieces, corners: Array, sides: tuple[Side, Side], size: float, largest: float
) -> tuple[Pieces, Array]:
    """Bisect simplices until a comparison is affine on each, or cannot change there.

    Returns
    -------
    pieces : Pieces
    values : (r, k) array
        Difference of the sides at the corners; 0 where the part ends within round-off.
    """
    k = corners.shape[1]
    i, j = np.array(list(combinations(range(k), 2))).T
    done, found = [], []
    while len(pieces.facet):
        at = pieces.places(corners)
        ends = at[:, i] - at[:, j]
        lengths = np.linalg.norm(ends, axis=2)
        nodes = np.concatenate([at, 0.5 * (at[:, i] + at[:, j])], axis=1)
        one, other = (side(nodes.reshape(-1, nodes.shape[2])) for side in sides)
        given = (one - other).reshape(nodes.shape[:2])
        noise = 1e-14 * np.abs([one, other]).max(axis=0).reshape(given.shape).max(axis=1)
        values = given[:, :k]
        off = np.abs(given[:, k:] - 0.5 * (values[:, i] + values[:, j])).max(axis=1)
        rise = np.abs(values[:, i] - values[:, j])
        slope = (rise / np.where(lengths > 0.0, lengths, np.inf)).max(axis=1)
        flat = off <= np.maximum(4.0 * noise, _CHORD[k] * size * slope)
        far = (np.abs(given).min(axis=1) > 4.0 * off) & (np.ptp(np.sign(given), axis=1) == 0.0)
        far |= np.isnan(given).all(axis=1)
        diameter = lengths.max(axis=1)
        ready = ((flat | far) & (diameter <= largest)) | (diameter <= _SMALLEST[k] * size)
        near = np.maximum(noise, _SAME * size * slope)[:, None]
        done.append(pieces[ready])
        found.append(np.where(np.abs(values) <= near, 0.0, values)[ready])
        pieces, longest = pieces[~ready], lengths[~ready].argmax(axis=1)
        parts = halves(pieces.barycentric, i[longest], j[longest], np.full(len(longest), 0.5))
        pieces = Pieces(np.tile(pieces.facet, 2), parts)
    return sum(done[1:], done[0]), np.concatenate(found)


def clipped(pieces: Pieces, values: Array) -> Pieces:
    """Divide simplices along the zeros of functions that are affine on each (r, k)."""
    parts, _, parent = split_at_zeros(pieces.barycentric, values)
    return Pieces(pieces.facet[parent], parts)


def _normal_projections(corners: Array) -> Array:
    """Projections (q, d, d) onto the normal space of simplices (q, k, d)."""
    along = np.linalg.qr(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))[0]
    return np.eye(corners.shape[2]) - along @ np.swapaxes(along, 1, 2)


def _joined(pieces: Pieces, on: NDArray[np.bool_], count: int) -> Pieces:
    """Take those that are on the part; where that are all of a facet, the facet itself."""
    full = np.bincount(pieces.facet, ~on, minlength=count) == 0
    whole = Pieces.whole(np.flatnonzero(full), pieces.barycentric.shape[1])
    return whole + pieces[on & ~full[pieces.facet]]


def _off_ridges(simplices: Array, boundary: Array, size: float) -> Array:
    """Return the centroids (r, d) of simplices, moved out of the strips beside edges.

    Parameters
    ----------
    simplices : (r, k, d) array
        Segments (k = 2) or triangles (k = 3) in facets of the boundary, m.
    boundary : (b, k, d) array
        All facets of the boundary, m.
    size : float
        Size of the body, m.
    """
    points = simplices.mean(axis=1)
    corners = simplices.shape[1]
    pairs = combinations(range(corners), 2)
    lengths = [np.linalg.norm(simplices[:, i] - simplices[:, j], axis=1) for i, j in pairs]
    width = 2.0 * measures(simplices) / np.max(lengths, axis=0) if corners == 3 else lengths[0]
    narrow = np.flatnonzero(width <= _STRIP * size)
    if not len(narrow):
        return points
    edges = _ridges(boundary)
    for row in narrow:
        own = simplices[row][:, None]
        away = own - feet(own, edges[:, 0], edges[:, -1])
        beside = (np.linalg.norm(away, axis=2) <= _STRIP * size).all(axis=0)
        if not beside.any():
            continue
        ways = away[:, beside].mean(axis=0)
        lengths_of = np.linalg.norm(ways, axis=1)
        ways = ways[lengths_of > 0.0] / lengths_of[lengths_of > 0.0, None]
        distinct = np.unique(np.round(ways, 6), axis=0)
        points[row] += 2.0 * _STRIP * size * distinct.sum(axis=0)
    return points


def _ridges(boundary: Array) -> Array:
    """Where facets (b, k, d) of different directions meet: points (e, 1, d), segments (e, 2, d)."""
    count, k, d = boundary.shape
    directions = boundary[:, 1] - boundary[:, 0]  # of segments, in space too
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    if k == 3:
        directions = unit_normals(boundary)
    ends = boundary[:, list(combinations(range(k), k - 1))].reshape(-1, k - 1, d)
    _, node = np.unique(ends.reshape(-1, d), axis=0, return_inverse=True)
    keys = np.sort(node.reshape(-1, k - 1), axis=1)
    _, first, place = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    facet = np.repeat(np.arange(count), k)
    turn = 1.0 - np.abs(np.sum(directions[facet] * directions[facet[first[place.ravel()]]], axis=1))
    return ends[first[np.unique(place.ravel()[turn > _STRAIGHT])]]


# ----------------------------------------------------------------------------------- supports
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
        Held facets in which the part ends.
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
    count = int(facet.max(initial=-1)) + 1
    reach, least = np.zeros(count), np.full(count, _DEPTH * size)
    met = np.zeros(count, dtype=bool)
    met[facet[pieces.facet]] = True
    some = np.flatnonzero(met[facet])  # all others have nothing on the part
    at, own = corners[some], facet[some]
    measure = measures(at)
    lengths = [np.linalg.norm(at[:, i] - at[:, j], axis=1) for i, j in _pairs(k)]
    of_facet = np.bincount(own, measure, count)
    covered = np.bincount(own, measure * pieces.covered(len(corners))[some], count)
    np.maximum.at(reach, own, np.max(lengths, axis=0))
    if depth is not None:
        np.maximum.at(least, own, depth[some])
    least = np.minimum(least * reach ** (k - 2), 0.5 * of_facet)
    held = (covered > 0.0) & (covered >= least)
    ended = np.flatnonzero(held & (of_facet - covered > np.maximum(least, _COVERED * of_facet)))
    beyond = [
        _reach(corners[facet == one], pieces.places(corners)[facet[pieces.facet] == one])
        for one in ended
    ]
    return HeldFacets(held[facet], ended, max(beyond, default=0.0))


def shifted_ends(found: list[HeldFacets], size: float) -> list[Regularisation]:
    """Report by how much supports hold more than their parts; `size` is the element size, m."""
    count, shift = sum(len(one.ended) for one in found), max((x.shift for x in found), default=0.0)
    sizes = {"m": shift, "h": shift / size} if count else {}
    return [Regularisation(END_OF_SUPPORT, count, one, unit) for unit, one in sizes.items()]


def held_nodes(
    scene: SceneTables, where: str, places: Array, facets: tuple[Ints, Array], key: str
) -> tuple[Ints, HeldFacets]:
    """Find the nodes of the boundary that a support on the part `where` holds.

    These are the nodes of the facets that it holds, each on its own side of the cuts. Nodes on the
    part at whose place no facet is held count too: a part may be a corner or an edge of the body.

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
    size = float(np.ptp(places, axis=0).max(initial=0.0))
    found = np.array(on_part(scene.geometry, where, places, size))
    on = np.flatnonzero(found)
    _, place = np.unique(places[on], axis=0, return_inverse=True)
    taken = np.zeros(len(on), dtype=bool)
    taken[place.ravel()[held[on]]] = True
    found[on] = ~taken[place.ravel()]
    return found


def _reach(corners: Array, pieces: Array) -> float:
    """How far the farthest corner of simplices (s, k, d) is from pieces (p, k, d) of them, m."""
    points, apart = corners.reshape(-1, corners.shape[2]), []
    for i, j in _pairs(corners.shape[1]):
        apart.append(nearest_parts(points, pieces[:, [i, j]])[0])
    return float(np.min(apart, axis=0).max())


def _pairs(corners: int) -> list[tuple[int, int]]:
    return list(combinations(range(corners), 2))
