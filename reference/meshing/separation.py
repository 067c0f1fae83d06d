"""Features of a body that come too close to each other to be meshed apart."""

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from reference.meshing.features import Feature, close_pairs, crossing_points
from verify.errors import InputError

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
        Saying which two, their distance and what is resolved; or that they lie on each other,
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
    """Whether points lie off the ends of a feature; those at which an arc is halved are none."""
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
    """Refuse two features that stay closer than what is resolved over a length."""
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
    """Points (k, 2) of arcs that come nearest to another line or circle."""
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

    With cells of `share` times the sum of the distances to both features, the integral of
    1/h² across the pair is 2/(share² gap) and a cell covers √3/4 h².

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
