"""Regions near tips and far from them, in which errors are measured separately."""

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, Body
from verify.compare.membrane_body import MembraneBody
from verify.compare.surface_rule import surface_rule

# Radius of what is near over the length of the cuts, in space the root of their area.
NEAR = 0.1


def near_radius(body: AnyBody) -> float:
    """Distance from a tip or front that is called near, m; 0 if there is none.

    A tenth of the length of the shortest cut inside the body that has a tip; in a solid of the
    root of the area of the cuts inside the body.
    """
    if isinstance(body, Body):
        if not len(body.tips):
            return 0.0
        lengths = dict.fromkeys(body.cuts, 0.0)
        tipped = set()
        for part in body.parts:
            lengths[part.cut] += (part.end - part.start) * part.piece.length
            ends = part.piece.point(np.array([part.start, part.end]))
            if (body.tip_distance(ends) <= 1e-10 * body.size).any():
                tipped.add(part.cut)
        return NEAR * min(lengths[cut] for cut in tipped)
    if isinstance(body, MembraneBody):
        return NEAR * min(_lengths_with_tip(body), default=0.0)
    if not len(body.front):
        return 0.0
    area = float(surface_rule(body, body.size / 20, depth=1.0).weights.sum())
    return NEAR * area**0.5


def near_tip(body: AnyBody, points: NDArray[np.float64], radius: float) -> NDArray[np.bool_]:
    """Whether points (n, d) are nearer to a tip or front than `radius` m."""
    return np.asarray(body.tip_distance(points) < radius)


def _lengths_with_tip(body: MembraneBody) -> list[float]:
    """Lengths of the cuts of a membrane that end inside it, m."""
    return [
        float(lines.lengths.sum())
        for lines in body.lines.values()
        if (body.tip_distance(lines.ends.reshape(-1, 3)) <= 1e-9 * body.size).any()
    ]
