"""The body and its cuts as asked, as the comparison sees them in the plane."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.curves import Piece, closed_pieces, cut_pieces, meeting_parameters
from verify.compare.facet_kernels import distance_to_segments
from verify.compare.membrane_body import MembraneBody, membrane_of
from verify.compare.solid import SolidBody, solid_of
from verify.errors import UnsupportedSceneError
from verify.scene import ArcCut, Polygon, PolylineCut, Rectangle, Scene
from verify.scene.planar import distance_to_outline, inside_polygon

__all__ = ["AnyBody", "Body", "CutPart", "body_of"]

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
    outline : (n, 2) array
        Corners.
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

    outline: Array
    cuts: dict[str, list[Piece]]
    parts: list[CutPart]
    singular: Array
    tips: Array
    dimension = 2

    @property
    def measure(self) -> float:
        """Area, m²."""
        x, y = (self.outline - self.outline[0]).T
        return abs(float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.outline, axis=0)))

    @property
    def has_cuts(self) -> bool:
        """Whether anything is cut."""
        return bool(self.parts)

    def tip_distance(self, points: Array) -> Array:
        """Distance (n,) of points (n, 2) to the nearest tip; infinite without one."""
        return np.asarray(distance_to_segments(points, self.tips, self.tips))

    def nearest_on_cuts(self, points: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 2) on the cuts as asked, and whether they are tips (n,)."""
        best = np.full(len(points), np.inf)
        foot = np.array(points, copy=True)
        for pieces in self.cuts.values():
            for piece in pieces:
                candidate = piece.point(piece.nearest(points))
                distance = np.linalg.norm(points - candidate, axis=1)
                closer = distance < best
                foot[closer], best[closer] = candidate[closer], distance[closer]
        return foot, self.tip_distance(foot) <= 1e-10 * self.size


AnyBody = Body | SolidBody | MembraneBody


def body_of(scene: Scene, singular: Array | None = None) -> AnyBody:
    """Take the body of a scene, with further `singular` points (k, d).

    In space these play no part: cells are graded to the fronts of the cuts.

    Raises
    ------
    UnsupportedSceneError
        If the scene is neither a rectangle, a polygon, a box nor a mesh of tetrahedra or of
        triangles in space, or a cut is no curve or surface of a known kind.
    """
    if scene.cell_dimension < scene.dimension:
        return membrane_of(scene)
    if scene.dimension == 3:
        return solid_of(scene)
    if not isinstance(scene.geometry, Rectangle | Polygon):
        raise UnsupportedSceneError(
            f"comparison on a body of kind '{scene.geometry.kind}' is not possible yet; "
            "rectangles and polygons are"
        )
    outline = scene.geometry.outline()
    cuts = {}
    for cut in scene.cuts:
        if not isinstance(cut, PolylineCut | ArcCut):
            raise UnsupportedSceneError(f"a cut of kind '{cut.kind}' cannot be compared on yet")
        cuts[cut.name] = cut_pieces(cut)
    parts = [part for name in cuts for part in _inner_parts(name, cuts, outline)]
    extra = np.zeros((0, 2)) if singular is None else np.asarray(singular, float).reshape(-1, 2)
    size = float(np.linalg.norm(np.ptp(outline, axis=0)))
    tips, special = _ends(parts, size)
    tips, special = tips[~_on(tips, outline, size)], special[~_on(special, outline, size)]
    # an exact field is smooth up to the outline
    corners = outline[:0] if scene.judged_by_exact else outline
    found = _distinct(np.vstack([special, extra, corners]), size)
    return Body(outline, cuts, parts, found, tips)


def _inner_parts(name: str, cuts: dict[str, list[Piece]], outline: Array) -> list[CutPart]:
    size = float(np.linalg.norm(np.ptp(outline, axis=0)))
    others = [p for other, pieces in cuts.items() if other != name for p in pieces]
    parts = []
    for piece in cuts[name]:
        met = [meeting_parameters(piece, p) for p in [*closed_pieces(outline), *others]]
        stops = np.unique(np.concatenate([*met, [0.0, 1.0]]))
        stops = stops[np.concatenate([[True], np.diff(stops) * piece.length > 1e-14 * size])]
        middle = piece.point(0.5 * (stops[1:] + stops[:-1]))
        inside = inside_polygon(middle, outline) & ~_on(middle, outline, size)
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


def _on(points: Array, outline: Array, size: float) -> NDArray[np.bool_]:
    on: NDArray[np.bool_] = distance_to_outline(points, outline) <= 1e-12 * size
    return on


def _distinct(points: Array, size: float) -> Array:
    kept: list[Array] = []
    for point in points:
        if all(np.linalg.norm(point - other) > 1e-12 * size for other in kept):
            kept.append(point)
    return np.array(kept).reshape(-1, 2)
