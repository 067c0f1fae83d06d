"""Claims about the error maps: a scale that shows every solver, and the surroundings of a tip."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import cut_square

from verify.report.bodies import deformed_body
from verify.report.error_maps import scale_top
from verify.report.tips import plane_tips

SQUARE = {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0]}


def body_with(values):
    body = deformed_body(cut_square(8), 0.0)
    return replace(body, values=np.resize(values, len(body.points)))


def test_a_solver_that_errs_a_hundred_times_more_does_not_wash_the_others_out():
    others = [body_with(np.linspace(0.0, most, 50)) for most in (1.0, 1.2, 1.5)]
    assert scale_top(others) == 1.5
    assert scale_top([*others, body_with([100.0])]) == pytest.approx(2 * 1.2, rel=0.05)


@pytest.mark.parametrize(
    ("cuts", "tips"),
    [
        ([[(-0.1, 0.2), (0.6, 0.5)]], [(0.6, 0.5)]),  # from outside
        ([[(0.0, 0.2), (0.6, 0.5)]], [(0.6, 0.5)]),  # from the boundary
        ([[(-0.1, 0.2), (1.1, 0.5)]], []),  # through
        ([[(0.2, 0.2), (0.5, 0.5), (0.8, 0.5)]], [(0.2, 0.2), (0.8, 0.5)]),
        ([[(-0.1, 0.5), (0.7, 0.5)], [(0.4, 0.5), (0.4, 0.9)]], [(0.7, 0.5), (0.4, 0.9)]),  # branch
    ],
)
def test_tips_are_ends_of_cuts_inside_the_body_and_on_no_other_cut(cuts, tips):
    scene = {"geometry": SQUARE, "cuts": [{"kind": "polyline", "points": own} for own in cuts]}
    assert [tuple(place) for place, _ in plane_tips(scene)] == tips


def test_a_circle_has_no_tip_and_an_arc_has_two():
    arc = {"kind": "arc", "centre": [0.5, 0.5], "radius": 0.2, "start": 0.0}
    assert plane_tips({"geometry": SQUARE, "cuts": [arc | {"sweep": 360.0}]}) == []
    found = plane_tips({"geometry": SQUARE, "cuts": [arc | {"sweep": 90.0}]})
    np.testing.assert_allclose([place for place, _ in found], [(0.7, 0.5), (0.5, 0.7)])
    assert found[0][1] == pytest.approx(0.1 * np.pi, rel=1e-3)
