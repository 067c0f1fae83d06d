"""Cuts as realised: profiles, tubes and arcs on the sides of what was asked."""

import numpy as np
import pytest
from cut_meshes import scene, solution
from solid_meshes import solid_scene

from verify.compare.body import body_of
from verify.compare.body_rule import area_rule
from verify.compare.cut_profile import profile_lines
from verify.compare.cut_rule import cut_rule
from verify.compare.errors import displacement_error, displacement_jump
from verify.compare.locate import SolutionField
from verify.compare.realised import SidedField, cut_deviation, field_of

CIRCLE = {"kind": "arc", "centre": [0.5, 0.5], "radius": 0.3}


def faceted_disc(facets):
    """A disc of `facets` facets, moved by 1, in a square with a hole, at rest."""
    angle = 2 * np.pi * np.arange(facets) / facets
    unit = np.column_stack([np.cos(angle), np.sin(angle)])
    ring = 0.5 + 0.3 * unit
    outer = 0.5 + 0.5 * unit / np.abs(unit).max(axis=1)[:, None]
    points = np.vstack([[[0.5, 0.5]], ring, ring, outer])
    i = np.arange(facets)
    j = (i + 1) % facets
    disc = np.column_stack([np.zeros_like(i), 1 + i, 1 + j])
    hole, out = 1 + facets, 1 + 2 * facets
    quads = [
        np.column_stack([hole + i, out + i, out + j]),
        np.column_stack([hole + i, out + j, hole + j]),
    ]
    u = np.zeros_like(points)
    u[: 1 + facets] = [1.0, 0.0]
    return solution(
        points, np.vstack([disc, *quads]), u, cut_facets=np.stack([ring[i], ring[j]], axis=1)
    )


def test_a_faceted_arc_is_read_on_the_sides_of_the_arc_as_asked():
    facets = 16
    body = body_of(scene([CIRCLE]))
    result = faceted_disc(facets)
    # the sagitta of a facet
    assert cut_deviation(result, body) == pytest.approx(0.3 * (1 - np.cos(np.pi / facets)))
    field = field_of(result, body)
    rule = area_rule(body, 0.03)
    inside = np.linalg.norm(rule.points - 0.5, axis=1) < 0.3
    assert np.array_equal(field.displacement(rule.points)[:, 0], inside.astype(float))
    plain = SolutionField(result).displacement(rule.points)[:, 0]
    assert (plain != inside).sum() > 100  # the band matters
    jump = displacement_jump(field, cut_rule(body, 0.03))
    # the arc's positive side is that of its centre
    assert np.array_equal(jump, np.tile([1.0, 0.0], (len(jump), 1)))


def test_one_solution_is_read_on_the_sides_of_each_cut_that_it_is_asked_on():
    result = faceted_disc(16)
    for radius in (0.3, 0.29, 0.3):
        body = body_of(scene([{**CIRCLE, "radius": radius}]))
        points = area_rule(body, 0.03).points
        inside = np.linalg.norm(points - 0.5, axis=1) < radius
        assert np.array_equal(field_of(result, body).displacement(points)[:, 0], inside)


def test_singular_points_that_are_added_belong_to_one_body_alone():
    asked, point = scene([CIRCLE]), np.array([[0.21, 0.87]])
    known = body_of(asked).singular
    assert len(body_of(asked, np.vstack([point, point + 1e-14])).singular) == len(known) + 1
    assert np.array_equal(body_of(asked).singular, known)


def test_no_cut_is_made_where_the_solver_made_none():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    cells = np.array([[0, 1, 2], [0, 2, 3]])
    result = solution(points, cells, points)
    body = body_of(scene([CIRCLE]))
    field = field_of(result, body)
    assert not isinstance(field, SidedField)
    assert not displacement_jump(field, cut_rule(body, 0.1)).any()
    assert displacement_error(field, field, area_rule(body, 0.2)).absolute == 0.0


def test_a_cut_that_runs_beyond_its_tip_is_not_taken_for_one_beside_it():
    body = body_of(scene([{"kind": "polyline", "points": [[-0.1, 0.5], [0.5, 0.5]]}]))
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    facets = np.array([[[0.0, 0.5], [0.6, 0.5]], [[0.6, 0.5], [0.7, 0.5]]])
    cells = np.array([[0, 1, 2], [0, 2, 3]])
    too_long = solution(points, cells, points, cut_facets=facets)
    assert cut_deviation(too_long, body) < 1e-15
    bent = solution(points, cells, points, cut_facets=facets + np.array([0.0, 0.01]))
    assert cut_deviation(bent, body) == pytest.approx(0.01)


TILT = [0.1, -0.2, 0.9]
DISC = {"kind": "disc", "centre": [0.5, 0.48, 0.52], "normal": TILT,
        "radii": [0.1, 0.3], "axis": [1.0, 0.0, 0.0]}  # fmt: skip
CYLINDER = {"kind": "cylinder", "base": [0.5, 0.5, 0.2], "axis": [0.0, 0.1, 1.0], "radius": 0.2,
            "height": 0.4, "towards": [1.0, 0.0, 0.0], "start": 20.0, "sweep": 130.0}  # fmt: skip
SPHERE = {"kind": "sphere", "centre": [0.5, 0.5, 0.5], "radius": 0.3, "opening": 60.0}
SWEPT = {"kind": "swept", "points": [[0.2, 0.3, 0.3], [0.5, 0.45, 0.3], [0.8, 0.3, 0.3]],
         "along": [0.05, 0.1, 0.4]}  # fmt: skip
POLYGON = {"kind": "polygon", "points": [[0.2, 0.4, 0.45], [0.8, 0.4, 0.5], [0.8, 0.6, 0.5],
                                         [0.2, 0.6, 0.45]]}  # fmt: skip


# the end points are half a step from the ends: a share of sin²(π/4/48) of a piece at either end
@pytest.mark.parametrize(
    ("cut", "length"),
    [(DISC, 0.6), (CYLINDER, 0.2 * np.deg2rad(130.0)), (SPHERE, 0.3 * np.deg2rad(120.0)),
     (SWEPT, 2 * np.hypot(0.3, 0.15)), (POLYGON, np.hypot(0.6, 0.05))],
    ids=["disc", "cylinder", "sphere", "swept", "polygon"],
)  # fmt: skip
def test_a_line_lies_on_its_cut_and_is_as_long_as_it_should(cut, length):
    body = body_of(solid_scene([cut]))
    (line,) = profile_lines(body)
    foot, _ = body.nearest_on_cuts(line.rule.points)
    assert np.abs(foot - line.rule.points).max() < 1e-12
    assert line.arc[-1] == pytest.approx(length, rel=2e-3)
    assert (np.diff(line.arc) > 0).all()
    across = line.rule.positive - line.rule.negative
    assert np.allclose(np.sum(across * line.rule.normals, axis=1), np.linalg.norm(across, axis=1))


def test_a_line_ends_where_the_body_does():
    wide = {**POLYGON, "points": [[-0.5, 0.4, 0.45], [1.5, 0.4, 0.45], [1.5, 0.6, 0.45],
                                  [-0.5, 0.6, 0.45]]}  # fmt: skip
    (line,) = profile_lines(body_of(solid_scene([wide])))
    assert line.rule.points[:, 0].min() >= 0.0
    assert line.rule.points[:, 0].max() <= 1.0
    assert line.arc[-1] > 0.9
