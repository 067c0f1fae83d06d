"""The body and its cuts as asked, as the comparison sees them (2D)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.curves import Piece, closed_pieces, cut_pieces, meeting_parameters
from verify.errors import UnsupportedSceneError
from verify.scene import Polygon, PolygonCut, Rectangle, Scene
from verify.scene.planar import distance_to_outline, inside_polygon

__all__ = ["Body", "CutPart", "body_of"]

Array = NDArray[np.float64]


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

    @property
    def area(self) -> float:
        """Area, m²."""
        x, y = (self.outline - self.outline[0]).T
        return abs(float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))

    @property
    def size(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.outline, axis=0)))


def body_of(scene: Scene, singular: Array | None = None) -> Body:
    """Take the body of a scene, with further `singular` points (k, 2).

    Raises
    ------
    UnsupportedSceneError
        If the scene is not a plane rectangle or polygon.
    """
    if not isinstance(scene.geometry, Rectangle | Polygon):
        raise UnsupportedSceneError(
            f"comparison on a body of kind '{scene.geometry.kind}' is not possible yet; "
            "rectangles and polygons are"
        )
    outline = scene.geometry.outline()
    cuts = {cut.name: cut_pieces(cut) for cut in scene.cuts if not isinstance(cut, PolygonCut)}
    parts = [part for name in cuts for part in _inner_parts(name, cuts, outline)]
    extra = np.zeros((0, 2)) if singular is None else np.asarray(singular, float).reshape(-1, 2)
    size = float(np.linalg.norm(np.ptp(outline, axis=0)))
    ends = [p.piece.point(np.array([t]))[0] for p in parts for t in (p.start, p.end)]
    tips = [e for e in ends if _count(e, ends, size) == 1 and not _on(e, outline, size)[0]]
    special = [e for e in _special(ends, parts, size) if not _on(e, outline, size)[0]]
    if not scene.judged_by_exact:  # an exact field is smooth up to the outline
        special += list(outline)
    found = _distinct(np.array([*special, *extra]).reshape(-1, 2), size)
    return Body(outline, cuts, parts, found, np.array(tips).reshape(-1, 2))


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


def _special(ends: list[Array], parts: list[CutPart], size: float) -> list[Array]:
    """Find the ends of parts that are not smooth points within one cut."""
    tangents = [
        sign * part.piece.tangent(np.array([t]))[0]
        for part in parts
        for t, sign in ((part.start, 1.0), (part.end, -1.0))
    ]
    found = []
    for end in ends:
        meeting = [
            tangents[i] for i, e in enumerate(ends) if np.linalg.norm(e - end) < 1e-12 * size
        ]
        smooth = len(meeting) == 2 and float(meeting[0] @ meeting[1]) < -1 + 1e-12
        if not smooth:
            found.append(end)
    return found


def _on(points: Array, outline: Array, size: float) -> NDArray[np.bool_]:
    return distance_to_outline(np.atleast_2d(points), outline) <= 1e-12 * size


def _count(point: Array, points: list[Array], size: float) -> int:
    return sum(bool(np.linalg.norm(p - point) <= 1e-12 * size) for p in points)


def _distinct(points: Array, size: float) -> Array:
    kept: list[Array] = []
    for point in points:
        if all(np.linalg.norm(point - other) > 1e-12 * size for other in kept):
            kept.append(point)
    return np.array(kept).reshape(-1, 2)
