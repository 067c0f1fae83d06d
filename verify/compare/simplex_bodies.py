"""Bodies of simplices in space and their cuts as asked: solids, membranes.

The comparison takes them from the scene alone. A cut of a solid is patches that end somewhere, a
cut of a membrane the lines in which its triangles are cut.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.compare.cell_tree import build_cell_tree, holding_cells
from verify.compare.locate import nearest_of_triangles
from verify.compare.sides import distance_to_segments, nearest_segments
from verify.compare.simplices import KUHN, simplices, triangle_frames
from verify.errors import UnsupportedSceneError
from verify.geometry.patches import Patch, PlanePatch
from verify.geometry.simplices import bounds_of, feet, inner_range, measures, rim_edges
from verify.scene import Scene
from verify.scene.cuts import CylinderCut, DiscCut, PolygonCut, SphereCut, SweptCut
from verify.scene.geometry import Box, MeshFile
from verify.scene.loading import read_mesh
from verify.scene.tool_path import Cut

Array = NDArray[np.float64]
Inside = Callable[[Array], NDArray[np.bool_]]


@dataclass(frozen=True, kw_only=True)
class SimplexBody:
    """Tetrahedra, or triangles in space, with cuts.

    Parameters
    ----------
    corners : (m, k + 1, 3) array
        Simplices that make up the body.
    cuts : mapping of str to sequence of Patch
        The cuts as asked, not trimmed.
    front : (f, 2, 3) array
        Where cuts end inside the body, as segments: of a membrane, tips, without length.
    box : (2, 3) array, optional
        Lower and upper corner, if it is a box.
    """

    corners: Array
    cuts: Mapping[str, Sequence[Patch]]
    front: Array
    box: Array | None = None
    dimension = 3

    @property
    def cell_dimension(self) -> int:
        """Dimension k of the simplices: 3 of a solid, 2 of a membrane."""
        return self.corners.shape[1] - 1

    @cached_property
    def measure(self) -> float:
        """Volume, m³, or area, m²."""
        return float(measures(self.corners).sum())

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.corners.reshape(-1, 3), axis=0)))

    @property
    def patches(self) -> list[Patch]:
        """Patches of all cuts."""
        return [patch for patches in self.cuts.values() for patch in patches]

    @property
    def has_cuts(self) -> bool:
        """Whether anything is cut."""
        return bool(self.cuts)

    def tip_distance(self, points: Array, within: float) -> Array:
        """Measure distances (n,) of points (n, 3) to the nearest front: `distance_to_segments`."""
        return distance_to_segments(points, self.front, within)

    def frames_at(self, points: Array) -> Array | None:
        """Return tangents and normal (n, 3, 3) of a surface at points (n, 3); None of a solid."""
        return None


_RIM = 64  # pieces that a rim is divided into per body's size, where it is trimmed to the body
_MARGIN = 1e-9  # of the body's size: closer to its surface is on it


@dataclass(frozen=True, kw_only=True)
class SolidBody(SimplexBody):
    """A box, or the tetrahedra of a mesh file, with cuts.

    Parameters
    ----------
    corners, cuts, front, box
        See `SimplexBody`.
    inside : callable
        Whether points (n, 3) lie inside the body or on its surface.
    """

    inside: Inside

    def nearest_on_cuts(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Find nearest points (n, 3) on cuts as asked, and whether they are ends of these (n,)."""
        found = [patch.nearest(points) for patch in self.patches]
        feet, rims = (np.array(column) for column in zip(*found, strict=True))
        nearest = np.linalg.norm(points - feet, axis=2).argmin(axis=0), np.arange(len(points))
        return feet[nearest], rims[nearest]


def solid_of(scene: Scene) -> SolidBody:
    """Take the body of a scene in space.

    Raises
    ------
    UnsupportedSceneError
        If a cut is no surface of a known kind, or the body is none.
    """
    corners, box, inside = _material(scene)
    size = float(np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0)))
    cuts, fronts = {}, [np.zeros((0, 2, 3))]
    for cut in scene.final_cuts:
        if not isinstance(cut, PolygonCut | DiscCut | CylinderCut | SphereCut | SweptCut):
            raise UnsupportedSceneError(f"a cut of kind '{cut.kind}' cannot be compared on yet")
        cuts[cut.name] = cut.pieces()
        fronts.append(_trimmed(rim_edges(cut.facets(size / _RIM)), inside, size))
    front = np.concatenate(fronts)
    return SolidBody(corners=corners, cuts=cuts, front=front, box=box, inside=inside)


def _material(scene: Scene) -> tuple[Array, Array | None, Inside]:
    geometry = scene.geometry
    if isinstance(geometry, Box):
        box = np.array([geometry.lower, geometry.upper], dtype=float)
        margin = _MARGIN * float(np.linalg.norm(box[1] - box[0]))

        def in_box(points: Array) -> NDArray[np.bool_]:
            within = (points >= box[0] - margin) & (points <= box[1] + margin)
            return np.asarray(within.all(axis=1))

        return box[0] + KUHN * (box[1] - box[0]), box, in_box
    if not isinstance(geometry, MeshFile):
        raise UnsupportedSceneError(
            f"comparison on a body of kind '{geometry.kind}' is not possible yet; boxes and mesh "
            "files of tetrahedra are"
        )
    points, cells = read_mesh(scene)
    return points[cells], None, _in_mesh(points, cells)


def _in_mesh(points: Array, cells: NDArray[np.int64]) -> Inside:
    shape = simplices(points, cells)
    tree = build_cell_tree(*bounds_of(shape.corners))
    searched = tree.over(shape.corners, shape.normals)
    margin = _MARGIN * float(np.linalg.norm(np.ptp(points, axis=0)))

    def inside(x: Array) -> NDArray[np.bool_]:
        return holding_cells(x, searched, margin, nearest=False) >= 0

    return inside


def _trimmed(rim: Array, inside: Inside, size: float) -> Array:
    """Find pieces (f, 2, 3) of segments of a rim that run inside the body, not on its surface."""
    pieces = []
    for a, b in rim:
        n = max(1, int(np.ceil(_RIM * np.linalg.norm(b - a) / size)))
        stops = a + np.linspace(0.0, 1.0, n + 1)[:, None] * (b - a)
        pieces.append(np.stack([stops[:-1], stops[1:]], axis=1))
    if not pieces:
        return np.zeros((0, 2, 3))
    found = np.concatenate(pieces)
    return found[deep_inside(found.mean(axis=1), inside, 1e-6 * size)]


def deep_inside(points: Array, inside: Inside, step: float) -> NDArray[np.bool_]:
    """Tell whether points (n, d) that are moved by a step along any axis, m, stay inside."""
    ways = step * np.eye(points.shape[1])
    return np.all([inside(points + way) for way in (*ways, *-ways)], axis=0)


Cells = NDArray[np.int64]

# of the surface's size: a corner that close to the plane of a cut is on it, and a shorter line is
# no piece of a cut
_ON = 1e-12
SHORT = 1e-10
_EDGES = ((0, 1), (1, 2), (2, 0))


@dataclass(frozen=True)
class SurfaceLines:
    """Straight pieces of a cut, each across a triangle of a surface or along an edge of two.

    Parameters
    ----------
    ends : (s, 2, 3) array
    positive, negative : (s, 3) array
        Unit vectors along the surface, square to the piece, into the sides of the cut.
    """

    ends: Array
    positive: Array
    negative: Array

    @property
    def normals(self) -> Array:
        """Unit vectors (s, 3) into the positive side; along an edge half-way between its sides."""
        both = self.positive - self.negative
        return np.asarray(both / np.linalg.norm(both, axis=1)[:, None])

    @property
    def lengths(self) -> Array:
        """Lengths (s,), m."""
        return np.asarray(np.linalg.norm(self.ends[:, 1] - self.ends[:, 0], axis=1))


def surface_lines(
    points: Array, cells: Cells, patches: Sequence[PlanePatch], name: str
) -> SurfaceLines:
    """Find lines along which the patches of a cut cross a surface.

    Parameters
    ----------
    points : (n, 3) array
    cells : (m, 3) array
        Triangles.
    patches : sequence of PlanePatch
    name : str
        Of the cut, for messages.

    Raises
    ------
    UnsupportedSceneError
        If the cut lies in a triangle or touches a fold of the surface along an edge: then the
        two sides of the surface are not two sides of the cut.
    """
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    rows = []
    for patch in patches:
        level = patch.level(points)
        level[np.abs(level) <= _ON * size] = 0.0
        *along, odd = _along(points, cells, level)
        for ends, ways in (_across(points, cells, level), along):
            ends, which = _clipped(ends, patch, SHORT * size)
            rows.append((ends, *ways[which].swapaxes(0, 1)))
        if len(_clipped(odd, patch, SHORT * size)[0]):
            raise UnsupportedSceneError(
                f"cut '{name}' lies along a fold of the membrane or in one of its triangles: it "
                "does not part what is on its sides, and cannot be compared on"
            )
    return SurfaceLines(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _across(points: Array, cells: Cells, level: Array) -> tuple[Array, Array]:
    """Find segments (s, 2, 3) across triangles, and ways (s, 2, 3) into both their sides."""
    value = level[cells]
    crossed = np.flatnonzero((value.max(axis=1) > 0.0) & (value.min(axis=1) < 0.0))
    corners, value = points[cells[crossed]], value[crossed]
    ends = np.zeros((len(crossed), 2, 3))
    met = np.zeros(len(crossed), dtype=np.int64)
    rows = np.arange(len(crossed))
    for i, j in _EDGES:  # at a corner that is on the plane, or inside an edge
        a, b = value[:, i], value[:, j]
        share = a / np.where(a == b, 1.0, a - b)
        place = corners[:, i] + share[:, None] * (corners[:, j] - corners[:, i])
        here = (a == 0.0) | (a * b < 0.0)
        ends[rows[here], met[here]] = place[here]
        met[here] += 1
    top = corners[rows, value.argmax(axis=1)]
    into = _square(top - ends[:, 0], ends)
    return ends, np.stack([into, -into], axis=1)


def _along(points: Array, cells: Cells, level: Array) -> tuple[Array, Array, Array]:
    """Find edges of triangles that lie on the plane.

    Returns edges (s, 2, 3) with a triangle on either side of it, and the ways (s, 2, 3) into both.
    The last are edges (o, 2, 3) inside the surface whose triangles are not on either side.
    """
    pairs = np.sort(np.concatenate([cells[:, list(edge)] for edge in _EDGES]), axis=1)
    third = np.concatenate([cells[:, 3 - sum(edge)] for edge in _EDGES])
    on = (level[pairs] == 0.0).all(axis=1)
    pairs, third, side = pairs[on], third[on], np.sign(level[third[on]])
    edges, which, times = np.unique(pairs, axis=0, return_inverse=True, return_counts=True)
    beside = np.full((2, len(edges)), -1)
    beside[0, which[side > 0.0]], beside[1, which[side < 0.0]] = (
        third[side > 0.0],
        third[side < 0.0],
    )
    both = (beside >= 0).all(axis=0)
    ends = points[edges[both]]
    ways = [_square(points[own] - ends[:, 0], ends) for own in beside[:, both]]
    odd = pairs[(times > 1)[which] & (np.bincount(which, side) != 0.0)[which] | (side == 0.0)]
    return ends, np.stack(ways, axis=1), points[odd]


def _square(way: Array, ends: Array) -> Array:
    """Make `way` (s, 3) square to segments (s, 2, 3), and of length one."""
    along = ends[:, 1] - ends[:, 0]
    along = along / np.linalg.norm(along, axis=1)[:, None]
    way = way - np.sum(way * along, axis=1)[:, None] * along
    return np.asarray(way / np.linalg.norm(way, axis=1)[:, None])


def _clipped(ends: Array, patch: PlanePatch, tolerance: float) -> tuple[Array, NDArray[np.int64]]:
    """Clip segments on the plane of a patch to it: parts (p, 2, 3), and of which each is (p,)."""
    flat = (ends - patch.origin) @ patch.axes[:2].T
    parts, which = [], []
    for k, (a, b) in enumerate(flat):
        length = float(np.linalg.norm(b - a))
        for low, high in _within(a, b, patch.cells, tolerance / length):
            parts.append(ends[k, 0] + np.array([[low], [high]]) * (ends[k, 1] - ends[k, 0]))
            which.append(k)
    return np.array(parts).reshape(-1, 2, 3), np.array(which, dtype=np.int64)


def _within(a: Array, b: Array, triangles: Array, tolerance: float) -> list[tuple[float, float]]:
    """Compute ranges of the parameter of a segment ab inside a union of triangles (m, 3, 2)."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    turn = np.sign(np.linalg.det(triangles[:, 1:] - triangles[:, :1]))[:, None, None]
    inward = turn * np.stack([-edges[..., 1], edges[..., 0]], axis=2)
    heights = (np.einsum("mkd,mkd->mk", inward, end - triangles) for end in (a, b))
    ranges = zip(*(ends.tolist() for ends in inner_range(*heights)), strict=True)
    found = [(low, high) for low, high in ranges if high - low > tolerance]
    merged: list[tuple[float, float]] = []
    for low, high in sorted(found):
        if merged and low <= merged[-1][1] + tolerance:
            merged[-1] = merged[-1][0], max(high, merged[-1][1])
        else:
            merged.append((low, high))
    return merged


_SAME = 2 * SHORT  # of the body's size: ends of lines that are closer are one point


@dataclass(frozen=True, kw_only=True)
class MembraneBody(SimplexBody):
    """The triangles of a mesh file, with cuts.

    Parameters
    ----------
    corners, cuts, front
        See `SimplexBody`.
    lines : dict of str to SurfaceLines
        The lines along which the cuts cross the surface.
    """

    lines: dict[str, SurfaceLines]

    @property
    def tips(self) -> Array:
        """Ends (t, 3) of the lines inside the surface."""
        return np.asarray(self.front[:, 0])

    def frames_at(self, points: Array) -> Array:
        """Return tangents and normal (n, 3, 3) of the triangles that hold points (n, 3)."""
        found, _ = nearest_of_triangles(points, self.corners, 1e-10 * self.size)
        return triangle_frames(self.corners[found])

    def nearest_on_cuts(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Find nearest points (n, 3) on the lines of the cuts, and whether they are tips (n,)."""
        ends = np.concatenate([lines.ends for lines in self.lines.values()])
        _, foot, _ = nearest_segments(points, ends)
        return foot, self.tip_distance(foot, tight := _SAME * self.size) <= tight


def membrane_of(scene: Scene) -> MembraneBody:
    """Take the body of a scene whose geometry is a surface; see `cut_membrane`."""
    return cut_membrane(*read_mesh(scene), scene.final_cuts)


def cut_membrane(points: Array, cells: NDArray[np.int64], asked: Sequence[Cut]) -> MembraneBody:
    """Make the body of triangles (m, 3) in space and cuts.

    Raises
    ------
    UnsupportedSceneError
        If a cut is not plane in parts, crosses no triangle, or runs along a fold.
    """
    cuts, lines = {}, {}
    for cut in asked:
        if not cut.faceted:
            raise UnsupportedSceneError(
                f"a cut of kind '{cut.kind}' through a membrane cannot be compared on yet; "
                "polygons and swept polylines can"
            )
        patches = [patch for patch in cut.pieces() if isinstance(patch, PlanePatch)]
        found = surface_lines(points, cells, patches, cut.name)
        if not len(found.ends):
            raise UnsupportedSceneError(f"cut '{cut.name}' does not cross the membrane")
        cuts[cut.name], lines[cut.name] = patches, found
    tips = _tips([line.ends for line in lines.values()], rim_edges((points, cells)))
    front = np.stack([tips, tips], axis=1)
    return MembraneBody(corners=points[cells], cuts=cuts, front=front, lines=lines)


def _tips(lines: Sequence[Array], rim: Array) -> Array:
    """Find the ends (t, 3) of lines (s, 2, 3) that are neither on the rim nor met by another."""
    everything = np.concatenate([rim, *lines])
    size = float(np.linalg.norm(np.ptp(everything.reshape(-1, 3), axis=0)))
    tips = []
    for end in everything[len(rim) :].reshape(-1, 3):
        away = np.linalg.norm(feet(end, everything[:, 0], everything[:, 1]) - end, axis=1)
        if np.sum(away <= _SAME * size) == 1:  # its own piece, and no other
            tips.append(end)
    return np.array(tips).reshape(-1, 3)
