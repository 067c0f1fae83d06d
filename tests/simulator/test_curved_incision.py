"""The curved incision of the hand, step by step: along the way of the blade, and nowhere else."""

import numpy as np
from thesis_stages import stage

from verify.simulator import Session


def beside(path, places):
    """Distance of places (q, 2) to a polyline (k, 2), and the length along it of the foot."""
    start, edge = path[:-1], np.diff(path, axis=0)
    length = np.linalg.norm(edge, axis=1)
    away = places[:, None] - start
    share = np.clip(np.einsum("qki,ki->qk", away, edge) / length**2, 0.0, 1.0)
    distance = np.linalg.norm(away - share[..., None] * edge, axis=2)
    nearest = distance.argmin(axis=1)
    each = np.arange(len(places))
    before = np.concatenate([[0.0], np.cumsum(length)])
    along = before[nearest] + share[each, nearest] * length[nearest]
    return distance[each, nearest], along


def test_the_cut_lies_on_the_arc_and_opens_two_elements_ahead_of_the_blade() -> None:
    """Element by element the cut is flat: it leaves the arc by at most h²/8R.

    What opens has a node of an element in which the blade is, and is held until it has passed.
    """
    session, seen = Session(stage("hand_curved", hooks=[]), account=False), 0
    path = session.stage.strokes[0]
    tips = path.blades[:, 0, :2]
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tips, axis=0), axis=1))])
    longest = np.linalg.norm(session.stage.mesh.edge_vectors, axis=2).max()
    away, (x, y) = tips - tips[0], tips[-1] - tips[0]
    chord = np.hypot(x, y)
    sag = np.abs(away[:, 0] * y - away[:, 1] * x).max() / chord
    radius = (chord**2 / 4.0 + sag**2) / (2.0 * sag)
    while session.time < path.times[-1]:
        record = session.step()
        surface = session.surfaces.material.surface
        inner = surface.facets.rows[surface.used[surface.inner.rows[surface.used]]]
        if len(inner):
            off, along = beside(tips, surface.material.rows[np.unique(inner)][:, :2])
            blade = np.interp(record.time, path.times, travelled)
            assert off.max() < longest**2 / (8.0 * radius)
            assert blade - longest < along.max() <= blade + 2.0 * longest
            seen += 1
    assert seen > 20
