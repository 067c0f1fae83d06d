"""Overlap of the faces of a cut: exact where two rigid halves are pressed into each other."""

import numpy as np
import pytest
from pressed_halves import common, halves, normal, pressed
from scipy.spatial.transform import Rotation

from verify.compare.overlap import OverlapSearch

STILL = {d: (np.eye(d), np.zeros(d)) for d in (2, 3)}


def turn(d, degrees):
    if d == 2:
        a = np.deg2rad(degrees)
        return np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])
    axis = np.array([0.48, -0.6, 0.64])
    return Rotation.from_rotvec(np.deg2rad(degrees) * axis).as_matrix()


def about(d, degrees, centre, shift):
    """Turn about a point, then shift."""
    t = turn(d, degrees)
    return t, centre - t @ centre + shift


# halves of other meshes, so that no node lies opposite to another; 0.083 is no multiple of h
@pytest.mark.parametrize(
    ("d", "order", "gap"), [(2, 1, 1e-6), (2, 2, 0.083), (3, 1, 0.083), (3, 2, 0.0017)]
)
def test_a_half_that_is_pressed_in_overlaps_by_that_much(d, order, gap):
    moves = [STILL[d], (np.eye(d), -gap * normal(d))]
    _, depth = common(d, moves)
    assert depth == pytest.approx(gap, rel=1e-9)
    found = OverlapSearch(pressed(d, 7 if d == 2 else 4, moves, order)).at()
    assert found.depth == pytest.approx(gap, rel=1e-6)
    assert found.material is not None
    assert abs((found.material - 0.5) @ normal(d)) < 1e-9  # on the cut


# The depth of a turned face is largest at its end, from which the other's outside is left sooner
# than its face of the cut: it is found at most one facet, 0.3 long, away, where sin 20° times
# that is missing. At the place that is named it is the distance from the other's face.
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("whole", [0.0, 125.0])
def test_a_half_that_is_turned_into_the_other_overlaps_by_as_much_wherever_both_are(d, whole):
    moves = [STILL[d], about(d, 20.0, np.full(d, 0.43), -0.05 * normal(d))]
    _, depth = common(d, moves)
    everywhere = turn(d, whole), np.linspace(0.3, -2.0, d)
    moves = [(everywhere[0] @ t, everywhere[0] @ s + everywhere[1]) for t, s in moves]
    found = OverlapSearch(pressed(d, 7 if d == 2 else 5, moves)).at()
    assert depth - 0.3 * np.sin(np.deg2rad(20.0)) <= found.depth <= depth * (1 + 1e-9)
    heights = [abs((found.deformed - s - t @ np.full(d, 0.5)) @ (t @ normal(d))) for t, s in moves]
    assert max(heights) == pytest.approx(found.depth, rel=1e-6)


# the opposite points of the faces are half a body apart: their jump says nothing of the overlap
@pytest.mark.parametrize("d", [2, 3])
def test_a_half_that_slid_along_the_cut_overlaps_only_where_the_other_is(d):
    along = np.linalg.svd(normal(d)[None])[2][1]
    moves = [STILL[d], (np.eye(d), 0.45 * along - 0.03 * normal(d))]
    found = OverlapSearch(pressed(d, 7 if d == 2 else 5, moves)).at()
    assert found.depth == pytest.approx(0.03, rel=1e-6)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    "move",
    [lambda d: (np.eye(d), 0.02 * normal(d)), lambda d: (np.eye(d), 1e-9 * normal(d)),
     lambda d: (np.eye(d), np.zeros(d)), lambda d: (np.eye(d), 1e-13 * -normal(d))],
    ids=["open", "hardly open", "closed", "closed within round-off"],
)  # fmt: skip
def test_what_opens_or_touches_does_not_overlap(d, move):
    moves = [STILL[d], move(d)]
    everywhere = turn(d, 73.0), np.linspace(0.3, -2.0, d)
    moves = [(everywhere[0] @ t, everywhere[0] @ s + everywhere[1]) for t, s in moves]
    found = OverlapSearch(pressed(d, 7 if d == 2 else 4, moves)).at()
    assert found.depth == 0.0


def test_a_part_that_falls_onto_another_cut_face_is_found():
    """The upper half goes round the lower one, and hits its cut face with its own outside."""
    gap, up = 0.02, normal(2)
    t = turn(2, 180.0 + 2 * np.rad2deg(np.arctan2(-up[0], up[1])))
    own = halves(2, 7)[1][0] @ t.T
    lowest = own[np.argmin(own @ up)]
    shift = np.full(2, 0.5) - gap * up - lowest
    moves = [STILL[2], (t, shift)]
    measure, _ = common(2, moves)
    found = OverlapSearch(pressed(2, 7, moves)).at()
    assert measure > 0
    assert found.depth > 0
