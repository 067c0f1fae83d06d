"""Cuts made of facets: polylines in the plane, triangulated surfaces in space.

Facets are here the segments or triangles of the cut, not the sides of cells. The *rim* is where
the cut ends: the vertices or edges that belong to one facet only.

The side of a point is told by the normal of the nearest face, edge or vertex, angle-weighted at
vertices (Bærentzen & Aanæs 2005). Where the nearest feature is on the rim, the level set is the
distance to the tangent plane there.

For kernels a facet is a (k, s) array of corners: k = 2 for a segment, k = 3 for a triangle, in s =
2 or 3 dimensions. Its nearest point is given by barycentric weights. They are *exactly* zero on
corners that do not take part, so face, edge and vertex are told apart without a tolerance.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from verify.compiled import njit
from verify.xfem.arrays import Bools, Floats, Ints, XfemError, finite_array, index_array
from verify.xfem.mesh import facets_of, neighbours_across

_FLAT = 1e-12  # area over squared edge below which a triangle has none


@njit(cache=True)
def _nearest_on_segment(x, corners, weights):
    """Add to the weights (2,), zero before; see `nearest_on_facet`."""
    p, q = 0.0, 0.0
    for i in range(len(x)):
        along = corners[1, i] - corners[0, i]
        p += (x[i] - corners[0, i]) * along
        q += along * along
    if p <= 0.0:
        weights[0] = 1.0
    elif p >= q:
        weights[1] = 1.0
    else:
        weights[1] = p / q
        weights[0] = 1.0 - weights[1]


@njit(cache=True)
def _nearest_on_triangle(x, corners, weights):
    """Add to the weights (3,), zero before; see `nearest_on_facet`."""
    ab, ac, ab2, ac2, abac = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(x)):
        first, second = corners[1, i] - corners[0, i], corners[2, i] - corners[0, i]
        ab += (x[i] - corners[0, i]) * first
        ac += (x[i] - corners[0, i]) * second
        ab2 += first * first
        ac2 += second * second
        abac += first * second
    if ab <= 0.0 and ac <= 0.0:
        weights[0] = 1.0
        return
    b_ab, b_ac = ab - ab2, ac - abac
    if b_ab >= 0.0 and b_ac <= b_ab:
        weights[1] = 1.0
        return
    c_ab, c_ac = ab - abac, ac - ac2
    if c_ac >= 0.0 and c_ab <= c_ac:
        weights[2] = 1.0
        return
    on_c = ab * b_ac - b_ab * ac
    if on_c <= 0.0 and ab >= 0.0 and b_ab <= 0.0:
        weights[1] = ab / (ab - b_ab)
        weights[0] = 1.0 - weights[1]
        return
    on_b = c_ab * ac - ab * c_ac
    if on_b <= 0.0 and ac >= 0.0 and c_ac <= 0.0:
        weights[2] = ac / (ac - c_ac)
        weights[0] = 1.0 - weights[2]
        return
    on_a = b_ab * c_ac - c_ab * b_ac
    toward_c, toward_b = b_ac - b_ab, c_ab - c_ac
    if on_a <= 0.0 and toward_c >= 0.0 and toward_b >= 0.0:
        weights[2] = toward_c / (toward_c + toward_b)
        weights[1] = 1.0 - weights[2]
        return
    total = on_a + on_b + on_c
    weights[1] = on_b / total
    weights[2] = on_c / total
    weights[0] = 1.0 - weights[1] - weights[2]


@njit(cache=True)
def nearest_on_facet(x, corners, weights):
    """Write the weights (k,) of the point of a facet nearest to x; k = 1 is a point of the rim.

    For a triangle abc the signs of (x − a)·ab, … and of the areas between the foot of x and the
    edges decide. Source: Ericson, Real-Time Collision Detection, 2005, 5.1.5.

    Parameters
    ----------
    x : (s,) float array
    corners : (k, s) float array
    weights : (k,) float array
    """
    for k in range(len(weights)):
        weights[k] = 0.0
    if len(corners) == 1:
        weights[0] = 1.0
    elif len(corners) == 2:
        _nearest_on_segment(x, corners, weights)
    else:
        _nearest_on_triangle(x, corners, weights)


@njit(cache=True)
def _nearest(x, facets, weights, found):
    """Return the squared distance of x (s,) to facets (f, k, s), with weights (k,) in `found`."""
    facet, square = 0, np.inf
    for f in range(len(facets)):
        nearest_on_facet(x, facets[f], weights)
        distance = 0.0
        for i in range(len(x)):
            foot = 0.0
            for k in range(len(weights)):
                foot += weights[k] * facets[f, k, i]
            distance += (x[i] - foot) ** 2
        if distance < square:
            facet, square = f, distance
            found[:] = weights
    return facet, square


@njit(cache=True)
def _probed(points, facets, deep):
    """Return (n, 3): the level set and, if `deep`, the depth and the travel."""
    corners, rim = facets.corners, facets.rim
    size, space = corners.shape[1:]
    out, off = np.zeros((len(points), 3)), np.empty(space)
    weights, found = np.empty(size), np.zeros(size)
    rim_weights, rim_found = np.empty(size - 1), np.empty(size - 1)
    for n in range(len(points)):
        x = points[n]
        facet, square = _nearest(x, corners, weights, found)
        feature = 0
        for k in range(size):
            if found[k] == 0.0:
                feature += 1 << k
        normal, on_rim = facets.feature_normals[facet, feature], facets.feature_rim[facet, feature]
        # x − y with the nearest point y = Σ_k w_k c_k; φ = (x − y)·n beside a face or past the rim
        along = 0.0
        for i in range(space):
            foot = 0.0
            for k in range(size):
                foot += found[k] * corners[facet, k, i]
            off[i] = x[i] - foot
            along += off[i] * normal[i]
        level = along
        if not on_rim and feature != 0:
            level = math.sqrt(square) if along >= 0.0 else -math.sqrt(square)
        out[n, 0] = level
        if not deep:
            continue
        beside = 0.0
        for i in range(space):
            beside += (off[i] - along * normal[i]) ** 2
        if on_rim and beside > 0.0:
            out[n, 1] = -math.sqrt(beside)
        else:  # measured along the facets: without the part across them
            apart = _nearest(x, rim, rim_weights, rim_found)[1]
            out[n, 1] = math.sqrt(max(apart - level**2, 0.0))
        for k in range(size):
            out[n, 2] += found[k] * facets.travel[facet, k]
    return out


class FacetArrays(NamedTuple):
    """Per facet and corner, for kernels; k corners in k dimensions.

    Attributes
    ----------
    corners : (t, k, k) float array
        In metres; the last axis counts coordinates.
    normals : (t, k) float array
        Of length one.
    feature_normals : (t, 2^k, k) float array
        At the features of the facet: number Σ 2^j over the corners j that do not belong to one. 0
        is the facet itself. Of a segment 2 and 1 are corners 0 and 1. Of a triangle 1, 2, 4 are the
        edges opposite to corners 0, 1, 2, and 6, 5, 3 those corners. Of length one; at an edge
        where the cut ends the normal of the facet.
    feature_rim : (t, 2^k) bool array
        Whether the cut ends there.
    rim : (r, k - 1, k) float array
        The facets of the rim: points in 2D, edges in 3D.
    travel : (t, k) float array
        Of a sweep: how far the blade has come at each corner, in metres.
    """

    corners: Floats
    normals: Floats
    feature_normals: Floats
    feature_rim: Bools
    rim: Floats
    travel: Floats


def facet_arrays(points: Floats, facets: Ints, travel: Floats | None = None) -> FacetArrays:
    """Find normals and rim of facets (t, k) with vertices (n, k), and the travel (n,) there."""
    count = facets.shape[1]
    corners = np.ascontiguousarray(points[facets])
    if count == 2:
        along = corners[:, 1] - corners[:, 0]
        normals = np.stack([-along[:, 1], along[:, 0]], axis=1)
        angles = np.ones(facets.shape)
    else:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        angles = _corner_angles(corners)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    across = neighbours_across(facets)
    rim = across < 0
    beside = np.where(rim[..., None], 0.0, normals[np.maximum(across, 0)])
    total = np.zeros_like(points)
    np.add.at(total, facets, angles[:, :, None] * normals[:, None])
    facet, k = np.nonzero(rim)
    rim_facets = facets[facet[:, None], facets_of(np.arange(count)[None])[k]]
    on_rim = np.zeros(len(points), dtype=bool)
    on_rim[rim_facets] = True
    feature_normals = np.repeat(normals[:, None], 2**count, axis=1)
    feature_rim = np.zeros((len(facets), 2**count), dtype=bool)
    edges = 1 << np.arange(count)
    vertices = 2**count - 1 - edges  # in the plane they are the edges
    feature_normals[:, edges] = _of_length_one(normals[:, None] + beside)
    feature_normals[:, vertices] = _of_length_one(total)[facets]
    feature_rim[:, edges] = rim
    feature_rim[:, vertices] = on_rim[facets]
    return FacetArrays(
        corners=corners,
        normals=normals,
        feature_normals=feature_normals,
        feature_rim=feature_rim,
        rim=np.ascontiguousarray(points[rim_facets]),
        travel=np.zeros(facets.shape) if travel is None else travel[facets],
    )


def _of_length_one(vectors: Floats) -> Floats:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1), 1e-300)[..., None]


def _corner_angles(corners: Floats) -> Floats:
    angles = np.empty(corners.shape[:2])
    for k in range(3):
        p, q = (corners[:, (k + i) % 3] - corners[:, k] for i in (1, 2))
        cross = np.linalg.norm(np.cross(p, q), axis=1)
        angles[:, k] = np.arctan2(cross, (p * q).sum(axis=1))
    return angles


class FacetCut:
    """A cut made of facets."""

    _name: ClassVar[str]

    @cached_property
    def arrays(self) -> FacetArrays:
        """Its facets, as kernels take them."""
        raise NotImplementedError

    def level_set(self, points: Floats) -> Floats:
        """Compute the signed distance (n,) to the facets, to their tangent plane past the rim."""
        return _probed(self._checked(points), self.arrays, False)[:, 0]

    def depth(self, points: Floats) -> Floats:
        """Return the distance (n,) to the rim along the tangent, negative past it."""
        return self.probed(points)[:, 1]

    def probed(self, points: Floats) -> Floats:
        """Return (n, 3): level set, depth, and the travel of a sweep there, in metres."""
        found: Floats = _probed(self._checked(points), self.arrays, True)
        return found

    def _checked(self, points: Floats) -> Floats:
        return finite_array(points, f"{self._name}: points", (None, self.arrays.corners.shape[2]))


@dataclass(frozen=True)
class Polyline(FacetCut):
    """A polyline in the plane.

    The positive side is on the left when one walks along it. Past an open end the level set is the
    distance to the line of the last segment.

    Parameters
    ----------
    vertices : (k, 2) array_like
        Vertices in order, in metres.
    closed : bool
        Whether the last vertex is joined to the first.

    Raises
    ------
    XfemError
        If there are too few vertices, a segment without length, a segment that turns back on
        the one before, or segments that intersect.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> cut = xfem.Polyline([[0.0, 0.5], [0.5, 0.5]])
    >>> cut.level_set([[0.25, 0.75]]).tolist(), cut.depth([[0.75, 0.5]]).tolist()
    ([0.25], [-0.25])
    """

    vertices: Floats
    closed: bool
    _name = "polyline"

    def __init__(self, vertices: ArrayLike, closed: bool = False) -> None:
        corners = finite_array(vertices, "polyline with vertices", (None, 2))
        fewest = 3 if closed else 2
        if len(corners) < fewest:
            raise XfemError(f"polyline of {len(corners)} vertices; expected {fewest} or more")
        object.__setattr__(self, "vertices", corners)
        object.__setattr__(self, "closed", bool(closed))
        _check_segments(self.vertices, self.closed)

    @cached_property
    def arrays(self) -> FacetArrays:
        """Its segments, as kernels take them."""
        count = len(self.vertices)
        first = np.arange(count if self.closed else count - 1)
        return facet_arrays(self.vertices, np.stack([first, (first + 1) % count], axis=1))


def _check_segments(vertices: Floats, closed: bool) -> None:
    starts = vertices if closed else vertices[:-1]
    segments = np.diff(vertices, axis=0, append=vertices[:1])[: len(starts)]
    lengths = np.linalg.norm(segments, axis=1)
    if not (lengths > 1e-14 * np.abs(vertices).max()).all():
        raise XfemError(f"segment {int(lengths.argmin())} of the polyline has no length")
    t = segments / lengths[:, None]
    following = np.roll(t, -1, axis=0) if closed else t[1:]
    back = (t[: len(following)] * following).sum(axis=1) < -1.0 + 1e-12
    if back.any():
        raise XfemError(f"the polyline turns back on itself at vertex {int(back.argmax()) + 1}")
    low = np.minimum(starts, starts + segments)
    axis = int(np.ptp(low, axis=0).argmax())
    order = np.argsort(low[:, axis])
    first, second = _first_intersection(starts, starts + segments, axis, order, closed)
    if first < len(starts):
        raise XfemError(f"segments {first} and {second} of the polyline intersect")


@njit(cache=True)
def _first_intersection(starts, ends, axis, order, closed):
    """Find the first two segments, not neighbours, that meet; their number if there are none.

    Segments come in the `order` in which they begin along the axis: each is held against those
    that begin before its end.
    """
    count = len(starts)
    found = count, count
    for a in range(count):
        i = order[a]
        end = max(starts[i, axis], ends[i, axis])
        for b in range(a + 1, count):
            j = order[b]
            if min(starts[j, axis], ends[j, axis]) > end:
                break
            p, q = min(i, j), max(i, j)
            if q - p < 2 or (closed and p == 0 and q == count - 1) or (p, q) >= found:
                continue
            other = 1 - axis
            if max(starts[i, other], ends[i, other]) < min(starts[j, other], ends[j, other]):
                continue
            if max(starts[j, other], ends[j, other]) < min(starts[i, other], ends[i, other]):
                continue
            # the ends of each lie on both sides of the other
            if (
                _side(starts[p], ends[p], starts[q]) * _side(starts[p], ends[p], ends[q]) <= 0.0
                and _side(starts[q], ends[q], starts[p]) * _side(starts[q], ends[q], ends[p]) <= 0.0
            ):
                found = p, q
    return found


@njit(cache=True)
def _side(a, b, x):
    """Compute twice the area of the triangle a b x, positive on the left of a b."""
    return (b[0] - a[0]) * (x[1] - a[1]) - (b[1] - a[1]) * (x[0] - a[0])


def check_triangles(points: Floats, triangles: Ints, what: str) -> None:
    """Refuse triangles (m, 3) that cross each other; where they touch they may.

    Two with a common edge are not held against each other: they meet there alone, or lie folded.

    Raises
    ------
    XfemError
        With the first two, and what they belong to.
    """
    if len(triangles) == 0:
        return
    corners = points[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    axis = int(np.ptp(low, axis=0).argmax())
    first, second = _first_crossing(corners, triangles, low, high, axis, np.argsort(low[:, axis]))
    if first < len(triangles):
        raise XfemError(f"triangles {first} and {second} of the {what} intersect")


@njit(cache=True)
def _first_crossing(corners, triangles, low, high, axis, order):
    """Find two triangles without a common edge that cross; their number if there are none."""
    count = len(corners)
    for a in range(count):
        i = order[a]
        for b in range(a + 1, count):
            j = order[b]
            if low[j, axis] > high[i, axis]:
                break
            apart, common = False, 0
            for k in range(3):
                apart |= low[j, k] > high[i, k] or low[i, k] > high[j, k]
                for one in range(3):
                    common += triangles[i, k] == triangles[j, one]
            if apart or common > 1:
                continue
            for k in range(3):  # an edge at a common vertex lies in the plane of both: no volume
                if _pierces(corners[i, k], corners[i, (k + 1) % 3], corners[j]) or _pierces(
                    corners[j, k], corners[j, (k + 1) % 3], corners[i]
                ):
                    return min(i, j), max(i, j)
    return count, count


_TOUCHING = 1e-9  # of the product of three lengths: a volume up to which four points are in a plane


@njit(cache=True)
def _pierces(p, q, triangle):
    """Tell whether the segment p q goes through the inside of a triangle."""
    a, b, c = triangle[0], triangle[1], triangle[2]
    if _volume(p, a, b, c) * _volume(q, a, b, c) >= 0.0:
        return False
    sides = _volume(p, q, a, b), _volume(p, q, b, c), _volume(p, q, c, a)
    return min(sides) > 0.0 or max(sides) < 0.0


@njit(cache=True)
def _volume(a, b, c, d):
    """Compute six times the volume of a tetrahedron, exactly zero if it is nearly flat."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = d[0] - a[0], d[1] - a[1], d[2] - a[2]
    volume = ux * (vy * wz - vz * wy) + uy * (vz * wx - vx * wz) + uz * (vx * wy - vy * wx)
    u, v, w = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
    size = math.sqrt(u * v * w)
    return volume if abs(volume) > _TOUCHING * size else 0.0


@dataclass(frozen=True)
class TriangulatedSurface(FacetCut):
    """An oriented triangulated surface, open or closed.

    Parameters
    ----------
    points : (n, 3) array_like
        Vertices, in metres.
    triangles : (m, 3) array_like of int
        Consistently oriented; the normal points to the positive side.

    Raises
    ------
    XfemError
        If a triangle has no area, two cross, or an edge is used twice in the same direction:
        orientations differ, or more than two triangles share the edge.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> square = [[0.0, 0.0, 0.5], [1.0, 0.0, 0.5], [1.0, 1.0, 0.5], [0.0, 1.0, 0.5]]
    >>> cut = xfem.TriangulatedSurface(square, [[0, 1, 2], [0, 2, 3]])
    >>> cut.level_set([[0.6, 0.3, 0.75]]).tolist()
    [0.25]
    """

    points: Floats
    triangles: Ints
    _name = "surface"

    def __init__(self, points: ArrayLike, triangles: ArrayLike) -> None:
        vertices = finite_array(points, "surface points", (None, 3))
        faces = index_array(triangles, "surface triangles")
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise XfemError(f"surface triangles of shape {faces.shape}; expected (m, 3), m > 0")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise XfemError(f"a surface triangle has a vertex outside 0..{len(vertices) - 1}")
        object.__setattr__(self, "points", vertices)
        object.__setattr__(self, "triangles", faces)
        sides = vertices[faces] - np.roll(vertices[faces], 1, axis=1)
        areas = np.linalg.norm(np.cross(sides[:, 1], sides[:, 2]), axis=1)
        longest = np.linalg.norm(sides, axis=2)
        flat = ~(areas > _FLAT * longest.max(axis=1) ** 2)
        if flat.any():
            raise XfemError(f"surface triangle {int(flat.argmax())} has no area")
        edges = faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
        if len(np.unique(edges, axis=0)) < len(edges):
            raise XfemError("the triangles of the surface are not consistently oriented")
        check_triangles(vertices, faces, "surface")

    @cached_property
    def arrays(self) -> FacetArrays:
        """Its triangles, as kernels take them."""
        return facet_arrays(self.points, self.triangles)
