"""The body and its cuts as asked, as the comparison sees them in the plane."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.compare.sides import distance_to_cut, distance_to_segments
from verify.compare.simplex_bodies import MembraneBody, SolidBody, membrane_of, solid_of
from verify.compare.simplices import kept_with
from verify.errors import UnsupportedSceneError
from verify.geometry.curves import Piece, closed_pieces, meeting_parameters
from verify.geometry.planar import inside_polygon, polygon_area
from verify.geometry.simplices import boundary_loops, distance_to_outline, places_of
from verify.scene import ArcCut, MeshFile, Polygon, PolylineCut, Rectangle, Scene, read_mesh

Array = NDArray[np.float64]

# A turn of less than 15° makes a singularity too weak to matter: r^-0.08 in the strain. Else each
# vertex of a curve given as a polyline would cost its own grading.
_KINK = np.deg2rad(15.0)


@dataclass(frozen=True)
class CutPart:
    """A part of a cut between two meeting points, inside the body.

    Parameters
    ----------
    cut : str
        Name of the cut.
    piece : Segment or Arc
    start, end : float
        Parameters on `piece`.
    """

    cut: str
    piece: Piece
    start: float
    end: float


@dataclass(frozen=True)
class Body:
    """A polygonal body with cuts.

    Parameters
    ----------
    loops : tuple of (n, 2) arrays
        Corners of the closed curves that bound it; places that an odd number of them holds are
        inside.
    cuts : dict of str to list of Segment or Arc
        The cuts as asked, not trimmed, in their direction.
    parts : list of CutPart
        The cuts inside the body, split where they meet each other.
    singular : (k, 2) array
        Points where derivatives may be unbounded: tips, kinks, junctions; and, unless an exact
        solution is prescribed, corners of the outline (the ends of supports, mostly). A mouth
        is not one: two traction-free wedges of less than half a turn are regular.
    tips : (t, 2) array
        Ends of cuts inside the body.
    """

    loops: tuple[Array, ...]
    cuts: dict[str, list[Piece]]
    parts: list[CutPart]
    singular: Array
    tips: Array
    dimension = 2

    @property
    def measure(self) -> float:
        """Area, m²."""
        return abs(sum(map(polygon_area, self.loops)))  # holes go round the other way

    @property
    def edges(self) -> list[Piece]:
        """Edges of all loops."""
        return [piece for loop in self.loops for piece in closed_pieces(loop)]

    @property
    def corners(self) -> Array:
        """Corners (n, 2) of all loops."""
        return np.concatenate(self.loops)

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.corners, axis=0)))

    @property
    def has_cuts(self) -> bool:
        """Whether anything is cut."""
        return bool(self.parts)

    def inside(self, points: Array) -> NDArray[np.bool_]:
        """Tell whether points (n, 2) lie inside the body."""
        return _inside(points, self.loops)

    def tip_distance(self, points: Array, within: float) -> Array:
        """Measure distances (n,) of points (n, 2) to the nearest tip, as `distance_to_segments`."""
        return distance_to_segments(points, self.tips[:, None].repeat(2, axis=1), within)

    def nearest_on_cuts(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Find nearest points (n, 2) on the cuts as asked, and whether they are tips (n,)."""
        pieces = [piece for cut in self.cuts.values() for piece in cut]
        foot = distance_to_cut(pieces, points)[1]
        return foot, self.tip_distance(foot, tight := 1e-10 * self.size) <= tight


AnyBody = Body | SolidBody | MembraneBody


def body_of(scene: Scene, singular: Array | None = None) -> AnyBody:
    """Take the body of a scene, with further `singular` points (k, d).

    In space these play no part: cells are graded to the fronts of the cuts.

    Raises
    ------
    UnsupportedSceneError
        If the scene is neither a rectangle, a polygon, a box nor a mesh of triangles or of
        tetrahedra, or a cut is no curve or surface of a known kind.
    """
    body = _body_of(scene)
    if singular is None or not isinstance(body, Body):
        return body
    found = np.vstack([body.singular, np.asarray(singular, float).reshape(-1, 2)])
    return replace(body, singular=_distinct(found, body.size))


@kept_with
def _body_of(scene: Scene) -> AnyBody:
    if scene.cell_dimension < scene.dimension:
        return membrane_of(scene)
    if scene.dimension == 3:
        return solid_of(scene)
    loops = _loops(scene)
    cuts = {}
    for cut in scene.final_cuts:
        if not isinstance(cut, PolylineCut | ArcCut):
            raise UnsupportedSceneError(f"a cut of kind '{cut.kind}' cannot be compared on yet")
        cuts[cut.name] = cut.pieces()
    parts = [part for name in cuts for part in _inner_parts(name, cuts, loops)]
    size = float(np.linalg.norm(np.ptp(np.concatenate(loops), axis=0)))
    tips, special = _ends(parts, size)
    tips, special = tips[~_on(tips, loops, size)], special[~_on(special, loops, size)]
    # an exact field is smooth up to the outline
    corners = [] if scene.judged_by_exact else [_kinks(loop) for loop in loops]
    return Body(loops, cuts, parts, _distinct(np.vstack([special, *corners]), size), tips)


def _distinct(points: Array, size: float) -> Array:
    """Leave out points (k, 2) that are others but for round-off of a body of this size, m."""
    return points[np.unique(places_of(points, 1e-12 * size), return_index=True)[1]]


def _loops(scene: Scene) -> tuple[Array, ...]:
    if isinstance(scene.geometry, Rectangle | Polygon):
        return (scene.geometry.outline(),)
    if not isinstance(scene.geometry, MeshFile):
        raise UnsupportedSceneError(
            f"comparison on a body of kind '{scene.geometry.kind}' is not possible; rectangles, "
            "polygons and mesh files of triangles are"
        )
    points, cells = read_mesh(scene)
    return tuple(points[loop] for loop in boundary_loops(cells))


def _kinks(loop: Array) -> Array:
    """Find corners (k, 2) at which a closed curve turns by more than 15°."""
    along = np.roll(loop, -1, axis=0) - loop
    along /= np.linalg.norm(along, axis=1)[:, None]
    return loop[np.sum(along * np.roll(along, 1, axis=0), axis=1) < np.cos(_KINK)]


def _inner_parts(
    name: str, cuts: dict[str, list[Piece]], loops: tuple[Array, ...]
) -> list[CutPart]:
    size = float(np.linalg.norm(np.ptp(np.concatenate(loops), axis=0)))
    edges = [piece for loop in loops for piece in closed_pieces(loop)]
    others = [p for other, pieces in cuts.items() if other != name for p in pieces]
    parts = []
    for piece in cuts[name]:
        met = [meeting_parameters(piece, p) for p in [*edges, *others]]
        stops = np.unique(np.concatenate([*met, [0.0, 1.0]]))
        stops = stops[np.concatenate([[True], np.diff(stops) * piece.length > 1e-14 * size])]
        middle = piece.point(0.5 * (stops[1:] + stops[:-1]))
        inside = _inside(middle, loops) & ~_on(middle, loops, size)
        parts += [
            CutPart(name, piece, float(stops[i]), float(stops[i + 1]))
            for i in np.flatnonzero(inside)
        ]
    return parts


def _ends(parts: list[CutPart], size: float) -> tuple[Array, Array]:
    """Find the free ends (k, 2) of the parts, and all their ends that are not smooth points."""
    places = [(p.piece, t, s) for p in parts for t, s in ((p.start, 1.0), (p.end, -1.0))]
    ends = np.array([piece.point(np.array([t]))[0] for piece, t, _ in places]).reshape(-1, 2)
    away = np.array([s * piece.tangent(np.array([t]))[0] for piece, t, s in places]).reshape(-1, 2)
    apart = np.abs(ends[:, None] - ends[None]).max(axis=2)
    meeting = apart <= 1e-12 * size
    count = meeting.sum(axis=1)
    # of two ends that meet, the tangents point in opposite directions unless there is a kink
    straight = (meeting & (away @ away.T < -np.cos(_KINK))).any(axis=1)
    return ends[count == 1], ends[~((count == 2) & straight)]


def _inside(points: Array, loops: tuple[Array, ...]) -> NDArray[np.bool_]:
    return np.logical_xor.reduce([inside_polygon(points, loop) for loop in loops])


def _on(points: Array, loops: tuple[Array, ...], size: float) -> NDArray[np.bool_]:
    return np.any([distance_to_outline(points, loop) <= 1e-12 * size for loop in loops], axis=0)
