"""Features of a body that come too close to each other to be meshed apart."""

import numpy as np

from reference.meshing.features import Feature, close_pairs, crossing_points
from verify.errors import InputError

__all__ = ["TOUCHING", "check_separation", "check_strips"]

TOUCHING = 1e-9  # of the body's size: closer features touch (the scene judges so too)
_RESOLVED = 1e-6  # of the body's size: OpenCASCADE merges at 1e-7, silently
_MOST_CELLS = 2e6


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
        Saying which two, their distance and what is resolved.
    """
    points = np.concatenate(
        [np.array([p for f in features for p in (f.start, f.end)]), crossing_points(features)]
    )
    for feature in features:
        away = feature.distance(points)
        bad = (away > TOUCHING * size) & (away < _RESOLVED * size)
        if not bad.any():
            continue
        x, y = points[np.argmax(bad)]
        others = {f.name for f in features if f.distance(points[bad][:1])[0] <= TOUCHING * size}
        other = sorted(others - {feature.name} or others or {"another part"})[-1]
        raise InputError(
            f"cuts: {_pair(feature.name, other)} come within {away[bad].min():.3g} m of each "
            f"other at ({x:.6g}, {y:.6g}) without touching; a conforming mesh of this body "
            f"resolves {_RESOLVED * size:.3g} m (below {TOUCHING * size:.3g} m they touch)",
            where,
        )


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
    for i, j in close_pairs(features, TOUCHING * size, size):
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


def _pair(one: str, other: str) -> str:
    return f"two parts of {one}" if one == other else f"{one} and {other}"
