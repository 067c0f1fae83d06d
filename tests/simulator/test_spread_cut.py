"""A cut whose work is spread over steps is the same cut, a few steps later, and sound all along."""

from dataclasses import replace

import numpy as np
import pytest

from verify.simulator import Session, quality_of
from verify.xfem.cuts import ToolPath

ROUND_OFF = 1e-12


def incised(hand, **changes):
    """The hand scene, cut twice as fast: several elements at every step."""
    begin, end = hand.strokes[0].blades[[0, -1]]
    path = ToolPath(np.stack([begin, end]), [0.0, 0.4])
    hooks = [replace(hook, begin=0.2) for hook in hand.hooks]
    return replace(hand, **({"strokes": [path], "hooks": hooks, "duration": 0.6} | changes))


def assert_cut_alike(mine, other) -> None:
    """The same elements are split, into as many pieces and unknowns."""
    np.testing.assert_array_equal(np.sort(mine.phantom.parent), np.sort(other.phantom.parent))
    assert mine.phantom.node_count == other.phantom.node_count
    cells = [np.sort(session.cutter.crossings.cell) for session in (mine, other)]
    np.testing.assert_array_equal(*cells)


@pytest.fixture(scope="module")
def played(hand):
    """The scene with its work spread; what was measured after every step."""
    session = Session(incised(hand), spread=True)
    found = []
    while not session.finished:
        session.step()
        found.append(quality_of(session))
    session.settle()
    return session, found


def test_volume_and_surfaces_are_sound_at_every_step_of_a_spread_cut(played) -> None:
    _, found = played
    for quality in found:
        assert quality.volume_error < ROUND_OFF
        assert quality.enclosed_error < ROUND_OFF
        assert quality.loose_edges == 0
        assert quality.inverted_facets == 0
        assert quality.stray_facets == 0


def test_the_account_of_a_spread_cut_closes_though_a_hook_begins_within(played) -> None:
    session, _ = played
    largest = max(record.work for record in session.records)
    assert largest > 1e-4
    for record in session.records:
        balance = record.mechanical - record.work + record.dissipated
        assert abs(balance) < 1e-9 * largest


def test_spread_or_not_the_same_elements_are_split_into_the_same_pieces(hand, played) -> None:
    at_once = Session(incised(hand), account=False)
    at_once.run()
    spread, _ = played
    assert_cut_alike(spread, at_once)


def test_an_element_is_split_within_ten_steps_of_being_crossed(hand) -> None:
    """Eight pieces, at times a ninth; the cut is made in the second of the next eight."""
    session = Session(incised(hand, hooks=[]), account=False, spread=True)
    session.run()
    crossings, h = session.cutter.crossings, session.stage.time_step
    late = (crossings.seen - crossings.leave) / h
    assert 0.0 <= late.min() <= late.max() <= 10.0 * (1.0 + 1e-9)
    # and a step that splits is followed by six that follow the cut, in which none is split
    split = np.array([record.newly_split > 0 for record in session.records])
    assert split.sum() > 3
    for k in np.flatnonzero(split[:-6]):
        assert not split[k + 1 : k + 7].any()
        assert all(record.busy for record in session.records[k - 1 : k + 7])


def test_the_force_of_a_blade_on_what_is_new_pulls_at_what_it_moves_with(hand) -> None:
    """The force that a blade passes on is all there, whatever unknowns the mechanics know."""
    session = Session(incised(hand, hooks=[], tool_force=0.5, tool_radius=0.002), spread=True)
    checked = 0
    while not session.finished:
        session.step()
        load = session._tool_load
        if session.records[-1].contacts and load is not None:
            assert load.shape == session.state.displacement.shape
            assert np.linalg.norm(load.sum(axis=0)) == pytest.approx(0.5, rel=1e-9)
            checked += len(session.displacement) > len(load)
    assert checked > 5
