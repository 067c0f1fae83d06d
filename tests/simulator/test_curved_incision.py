"""The curved incision of the hand, step by step: along the way of the blade, and nowhere else."""

import numpy as np
import pytest
from thesis_stages import stage

from verify.simulator import Session, quality_of

ROUND_OFF = 1e-12


@pytest.fixture(scope="module")
def curved():
    """The scene played to its end; quality and inner faces after every step of the cut."""
    session = Session(stage("hand_curved"))
    qualities, faces = [], []
    while not session.finished:
        record = session.step()
        if record.newly_split or record.step % 6 == 0:
            qualities.append(quality_of(session))
            surface = session.surfaces.material.surface
            used = surface.used
            inner = surface.facets.rows[used[surface.inner.rows[used]]]
            faces.append((record.time, surface.material.rows[np.unique(inner)]))
    return session, qualities, faces


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


def test_the_cut_lies_on_the_arc_and_opens_two_elements_ahead_of_the_blade(curved) -> None:
    """Element by element the cut is flat: it leaves the arc by at most h²/8R.

    What opens has a node of an element in which the blade is, and is held until it has passed.
    """
    session, _, faces = curved
    path = session.stage.strokes[0]
    tips = path.blades[:, 0, :2]
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tips, axis=0), axis=1))])
    corners = session.stage.mesh.points[session.stage.mesh.cells]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max()
    away, (x, y) = tips - tips[0], tips[-1] - tips[0]
    chord = np.hypot(x, y)
    sag = np.abs(away[:, 0] * y - away[:, 1] * x).max() / chord
    radius = (chord**2 / 4.0 + sag**2) / (2.0 * sag)
    seen = [(time, places) for time, places in faces if len(places)]
    assert len(seen) > 35
    for time, places in seen:
        off, along = beside(tips, places[:, :2])
        blade = np.interp(time, path.times, travelled)
        assert off.max() < longest**2 / (8.0 * radius)
        assert blade - longest < along.max() <= blade + 2.0 * longest


def test_the_arc_opens_by_as_much_as_it_is_pulled_and_gains_nothing(curved) -> None:
    session, _, _ = curved
    for hook in session.stage.hooks:
        node = np.flatnonzero(session.phantom.node_side[:, 0] == hook.side)
        away = np.linalg.norm(session.phantom.node_points[node] - hook.at, axis=1)
        nearest = node[np.argmin(away)]
        begun = session.state.displacement[nearest] - hook.vector
        np.testing.assert_allclose(begun, 0.0, atol=1e-6)  # nothing had moved before
    work = max(record.work for record in session.records)
    for record in session.records:
        assert abs(record.balance) < 1e-9 * work
        assert record.mechanical <= record.work + 1e-9 * work
