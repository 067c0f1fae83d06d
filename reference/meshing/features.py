"""The straight and circular parts of a body's outline and cuts, and how close they come.

The outline is divided where the part that a support or traction acts on ends. Features that come
too close to each other to be meshed apart are refused.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise, permutations

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.geometry.curves import Arc, Piece, Segment
from verify.scene import ArcCut, Polygon, PolylineCut, Rectangle, Scene, Traction
from verify.scene.parts import pieces_on_part

Array = NDArray[np.float64]
_SAME = 1e-5  # of the body's size: an end closer than that to a corner counts as the corner
_SAMPLES = 721  # of an arc, where its distance to another feature is measured


def divided_outline(scene: Scene) -> Array:
    """Find corners (k, 2) of the body, and the points of its edges where such a part ends."""
    outline = _outline(scene)
    size = float(np.ptp(outline, axis=0).max())
    following = np.roll(outline, -1, axis=0)
    edges = np.stack([outline, following], axis=1)
    stops = [stop for text in formulas_of_parts(scene) for stop in _ends(scene, text, edges)]
    found = []
    for i, (a, b) in enumerate(zip(outline, following, strict=True)):
        length = float(np.linalg.norm(b - a))
        kept = [0.0]
        for stop in sorted(share for edge, share in stops if edge == i):
            if (stop - kept[-1]) * length > _SAME * size and (1 - stop) * length > _SAME * size:
                kept.append(stop)
        found.append(a + np.array(kept)[:, None] * (b - a))
    return np.concatenate(found)


def formulas_of_parts(scene: Scene) -> list[str]:
    """List the inequalities that say where a support or traction acts, each once."""
    where = {s.where for s in scene.supports}
    where |= {load.where for load in scene.loads if isinstance(load, Traction)}
    return [one for one in sorted(where - {"boundary"}) if not scene.geometry.is_part(one)]


def supported_edges(scene: Scene, corners: Array) -> NDArray[np.bool_]:
    """Tell whether each edge of the divided outline is held by a support, in any component."""
    held = np.zeros(len(corners), dtype=bool)
    for support in scene.supports:
        held |= _on_edges(scene, support.where, corners)
    return held


def load_jumps(scene: Scene, corners: Array) -> NDArray[np.bool_]:
    """Find corners of the divided outline where the tractions of both edges fit no bounded stress.

    A symmetric stress wants t₁·n₂ = t₂·n₁ at a corner, and t₁ = t₂ on a straight edge. Else the
    strain grows like the logarithm of the distance.
    """
    following = np.roll(corners, -1, axis=0)
    traction, at_end = np.zeros_like(corners), np.zeros_like(corners)  # at either end of each edge
    for load in scene.loads:
        if isinstance(load, Traction) and load.traction != "exact":
            chosen = _on_edges(scene, load.where, corners)
            traction[chosen] += load.values(corners[chosen])
            at_end[chosen] += load.values(following[chosen])
    along = following - corners
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    before, n_before = np.roll(at_end, 1, axis=0), np.roll(normal, 1, axis=0)
    mismatch = np.abs(np.sum(before * normal, axis=1) - np.sum(traction * n_before, axis=1))
    straight = np.abs(np.sum(normal * n_before, axis=1)) > 1 - 1e-12
    mismatch[straight] = np.linalg.norm(before - traction, axis=1)[straight]
    return np.asarray(mismatch > 1e-12 * np.abs(traction).max(initial=0.0))


def _outline(scene: Scene) -> Array:
    assert isinstance(scene.geometry, Rectangle | Polygon)
    return scene.geometry.outline()


def _on_edges(scene: Scene, where: str, corners: Array) -> NDArray[np.bool_]:
    """Tell which edges (k,) of a divided outline lie on a part."""
    edges = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    return pieces_on_part(scene.geometry, where, edges).covered(len(edges)) > 0.5


def _ends(scene: Scene, where: str, edges: Array) -> list[tuple[int, float]]:
    """Find edges (e, 2, 2) in which a part begins or ends, and at which share of each."""
    pieces = pieces_on_part(scene.geometry, where, edges)
    spans = np.sort(pieces.barycentric[:, :, 1], axis=1)
    found = []
    for edge in np.unique(pieces.facet):
        low, high = spans[pieces.facet == edge].T
        order = np.argsort(low)
        # what begins where the one before ends goes on
        found += [(int(edge), float(x)) for x in np.setxor1d(low[order], high[order])]
    return found


@dataclass(frozen=True)
class Feature:
    """A segment, or an arc (counter-clockwise) if it has a radius.

    Attributes
    ----------
    name : str
        In words, for messages.
    start, end : (2,) arrays
        m.
    centre : (2,) array, optional
    radius : float, optional
        m.
    sweep : float
        Angle covered by an arc, radians.
    """

    name: str
    start: Array
    end: Array
    centre: Array | None = None
    radius: float = 0.0
    sweep: float = 0.0

    @cached_property
    def piece(self) -> Piece:
        """The curve; its ends are `start` and `end` to round-off."""
        if self.centre is None:
            return Segment(self.start, self.end)
        first = float(np.arctan2(*(self.start - self.centre)[::-1]))
        return Arc(self.centre, self.radius, first, self.sweep)

    def distance(self, points: Array) -> Array:
        """Compute the distance (n,) of each of `points` (n, 2) to this feature, m."""
        return np.asarray(np.linalg.norm(points - self.piece.foot(points), axis=1))

    def samples(self, count: int = _SAMPLES) -> Array:
        """Find points (n, 2) along the feature, both ends included."""
        return self.piece.point(np.linspace(0.0, 1.0, count))

    @property
    def length(self) -> float:
        """Its length, m."""
        return self.piece.length

    def gap(self, other: "Feature") -> float:
        """Compute the smallest distance to another feature, m; 0 where they cross."""
        if len(crossing_points([self, other])):
            return 0.0
        mine, others = (f.samples(2 if f.centre is None else _SAMPLES) for f in (self, other))
        return float(min(self.distance(others).min(), other.distance(mine).min()))


def plane_features(scene: Scene) -> list[Feature]:
    """Find edges of body, divided where the part a condition acts on ends, and parts of cuts."""
    assert isinstance(scene.geometry, Rectangle | Polygon)
    corners = divided_outline(scene)
    found = [
        Feature("the boundary", a, b) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)
    ]
    for cut in scene.final_cuts:
        name = f"cut '{cut.name}'"
        if isinstance(cut, PolylineCut):
            found += [Feature(name, a, b) for a, b in pairwise(cut.vertices())]
        else:
            assert isinstance(cut, ArcCut)
            stops = np.deg2rad(cut.start + cut.sweep * np.array([0.0, 0.5, 1.0]))
            centre = np.asarray(cut.centre, dtype=float)
            ends = centre + cut.radius * np.column_stack([np.cos(stops), np.sin(stops)])
            if cut.sweep == 360.0:
                ends[2] = ends[0]
            half = float(np.deg2rad(cut.sweep / 2))
            found += [Feature(name, a, b, centre, cut.radius, half) for a, b in pairwise(ends)]
    return found


def crossing_points(features: list[Feature]) -> Array:
    """Find points (k, 2) where two of the features cross or touch, to round-off, m."""
    found = [np.zeros((0, 2))]
    for one, other in combinations(features, 2):
        if one.centre is None and other.centre is None:
            found.append(_segment_crossing(one, other))
        elif one.centre is None or other.centre is None:
            line, arc = (one, other) if one.centre is None else (other, one)
            found.append(_arc_crossings(line, arc))
    return np.concatenate(found)


def close_pairs(features: list[Feature], touching: float, below: float) -> list[tuple[int, int]]:
    """Find pairs of features, one of them a cut, that come closer than `below` but do not touch.

    Two parts of one cut count only where it turns back on itself; else each vertex of a smooth
    curve given as a polyline would make a pair.
    """
    lengths = np.array([feature.length for feature in features])
    found = []
    for i, j in combinations(range(len(features)), 2):
        one, other = features[i], features[j]
        if other.name != "the boundary" and touching < one.gap(other) < below:
            between = float(lengths[i + 1 : j].sum())
            if one.name != other.name or _turns_back(one, other, between):
                found.append((i, j))
    return found


def _turns_back(one: Feature, other: Feature, between: float) -> bool:
    """Tell whether an end of one part of a cut is half as far from a later part as way there."""
    ways = [
        (one.start, other, one.length + between),
        (one.end, other, between),
        (other.start, one, between),
        (other.end, one, other.length + between),
    ]
    return any(part.distance(point[None])[0] < 0.5 * way for point, part, way in ways)


def _segment_crossing(one: Feature, other: Feature) -> Array:
    u, v, w = one.end - one.start, other.end - other.start, other.start - one.start
    det = u[0] * v[1] - u[1] * v[0]
    if abs(det) <= 1e-14 * one.length * other.length:
        return np.zeros((0, 2))
    s = (w[0] * v[1] - w[1] * v[0]) / det
    t = (w[0] * u[1] - w[1] * u[0]) / det
    if not (-1e-12 <= s <= 1 + 1e-12 and -1e-12 <= t <= 1 + 1e-12):
        return np.zeros((0, 2))
    return np.asarray(one.start + s * u)[None]


def _arc_crossings(line: Feature, arc: Feature) -> Array:
    assert arc.centre is not None
    u, w = line.end - line.start, line.start - arc.centre
    a, b, c = u @ u, w @ u, w @ w - arc.radius**2
    if b * b - a * c < 0:
        return np.zeros((0, 2))
    s = (-b + np.array([-1.0, 1.0]) * np.sqrt(b * b - a * c)) / a
    points = line.start + s[(s >= -1e-12) & (s <= 1 + 1e-12), None] * u
    return np.asarray(points[arc.distance(points) <= 1e-9 * arc.radius])


_TOUCHING = 1e-9  # of the body's size: closer features touch (the scene judges so too)
_RESOLVED = 1e-6  # of the body's size: OpenCASCADE merges at 1e-7, silently
APART = 1e-7  # between the two: what neither touches nor was refused is farther apart
_MOST_CELLS = 2e6
_ALONG = 2049  # samples of a feature
_LONGEST_OVERLAP = 2e-3  # of the body's size: longer, and the angle at a contact is below 5e-4


def check_separation(features: list[Feature], size: float, where: str) -> None:
    """Refuse features that neither touch nor are far enough apart to be meshed apart.

    Parameters
    ----------
    features : list of Feature
    size : float
        Size of the body, m.
    where : str
        Case file, for the message.

    Raises
    ------
    InputError
        With the two, their distance and the least that is resolved; or if they lie on each other,
        or at an angle of less than about 5e-4, over a length.
    """
    # first: points at which parts touch tangentially are roots of rounding as crossings, 5e-9 off
    _check_no_cusp(features, size, where)
    ends = np.array([p for f in features for p in (f.start, f.end)])
    points = np.concatenate([ends, crossing_points(features), _bulges(features)])
    for feature in features:
        away = feature.distance(points)
        bad = (away > _TOUCHING * size) & (away < _RESOLVED * size)
        if not bad.any():
            continue
        x, y = points[np.argmax(bad)]
        others = {f.name for f in features if f.distance(points[bad][:1])[0] <= _TOUCHING * size}
        other = sorted(others - {feature.name} or others or {"another part"})[-1]
        raise InputError(
            f"cuts: {_pair(feature.name, other)} come within {away[bad].min():.3g} m of each "
            f"other at ({x:.6g}, {y:.6g}) without touching; a conforming mesh of this body "
            f"resolves {_RESOLVED * size:.3g} m (below {_TOUCHING * size:.3g} m they touch)",
            where,
        )
    _check_no_overlap(features, size, where)


def _check_no_cusp(features: list[Feature], size: float, where: str) -> None:
    """Refuse arcs that touch another part tangentially: no cell fits a wedge that ends in 0°."""
    for arc in features:
        for other in features:
            if arc.centre is None or other is arc:
                continue
            points = _bulges([arc, other])
            on_both = (arc.distance(points) <= _TOUCHING * size) & (
                other.distance(points) <= _TOUCHING * size
            )
            # at ends of both it may be a line that runs on smoothly
            inside = np.zeros(len(points), dtype=bool)
            for one in (arc, other):
                inside |= _off_ends(one, points, features, size)
            for x, y in points[on_both & inside]:
                raise InputError(
                    f"cuts: {_pair(arc.name, other.name)} touch tangentially at ({x:.6g}, {y:.6g});"
                    " a conforming mesh cannot resolve the wedge between them: move them apart, or "
                    "let them cross",
                    where,
                )


def _off_ends(
    feature: Feature, points: NDArray[np.float64], features: list[Feature], size: float
) -> NDArray[np.bool_]:
    """Tell whether points lie off ends of a feature; those at which an arc is halved are none."""
    halves = []
    if feature.centre is not None:
        halves = [f for f in features if f is not feature and f.name == feature.name]
    ends = [
        end
        for end in (feature.start, feature.end)
        if not any(np.array_equal(end, other) for f in halves for other in (f.start, f.end))
    ]
    if not ends:
        return np.ones(len(points), dtype=bool)
    away = np.linalg.norm(points[:, None] - np.stack(ends), axis=2).min(axis=1)
    return np.asarray(away > _RESOLVED * size)


def _check_no_overlap(features: list[Feature], size: float, where: str) -> None:
    """Refuse two features that stay closer than the resolution over a length."""
    for one, other in permutations(features, 2):
        if one.name == other.name == "the boundary" or one.gap(other) > _RESOLVED * size:
            continue
        within = other.distance(one.samples(_ALONG)) < _RESOLVED * size
        shared = (np.count_nonzero(within) - 1) / (_ALONG - 1) * one.length
        if shared > min(_LONGEST_OVERLAP * size, 0.5 * one.length):
            x, y = one.samples(_ALONG)[np.argmax(within)]
            raise InputError(
                f"cuts: {_pair(one.name, other.name)} lie within {_RESOLVED * size:.3g} m of each "
                f"other over {shared:.3g} m from ({x:.6g}, {y:.6g}) on; a conforming mesh of this "
                "body cannot tell them apart",
                where,
            )


def _bulges(features: list[Feature]) -> NDArray[np.float64]:
    """Find points (k, 2) of arcs that come nearest to another line or circle."""
    found = [np.zeros((0, 2))]
    arcs = [feature for feature in features if feature.centre is not None]
    for arc in arcs:
        assert arc.centre is not None
        towards = [_foot(other, arc.centre) - arc.centre for other in features if other is not arc]
        away = np.array([way for way in towards if np.linalg.norm(way) > 0]).reshape(-1, 2)
        spokes = arc.radius * away / np.linalg.norm(away, axis=1)[:, None]
        points = np.concatenate([arc.centre + spokes, arc.centre - spokes])
        found.append(points[arc.distance(points) <= 1e-12 * arc.radius])
    return np.concatenate(found)


def _foot(feature: Feature, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Find the centre of a circle, or the foot of a perpendicular on the line of a segment."""
    if feature.centre is not None:
        return feature.centre
    along = feature.end - feature.start
    return np.asarray(feature.start + (point - feature.start) @ along / (along @ along) * along)


def _strip_cells(features: list[Feature], size: float, share: float) -> float:
    """Estimate how many cells the strips between close features take.

    Cells have `share` times the sum of the distances to both features. The integral of 1/h²
    across the pair is then 2/(share² gap), and a cell covers √3/4 h².

    Parameters
    ----------
    features : list of Feature
    size : float
        Size of the body, m.
    share : float
        Element size over the width of the strip.
    """
    cells = 0.0
    for i, j in close_pairs(features, APART * size, size):
        gap = features[j].distance(features[i].samples(513))
        cells += 4.6 / share**2 * features[i].length * float(np.mean(1 / gap))
    return cells


def check_strips(features: list[Feature], size: float, share: float, where: str) -> None:
    """Refuse strips between close features that would take too many cells.

    Raises
    ------
    InputError
        Saying how many cells they would take.
    """
    cells = _strip_cells(features, size, share)
    if cells > _MOST_CELLS:
        raise InputError(
            f"cuts: the strips between cuts that lie close together take about {cells:.1g} cells; "
            f"a conforming mesh is made with up to {_MOST_CELLS:.1g}: move the cuts apart, merge "
            "them, or ask for fewer or coarser reference levels",
            where,
        )


def _pair(*names: str) -> str:
    one, other = sorted(names)
    return f"two parts of {one}" if one == other else f"{one} and {other}"
