import numpy as np
import pytest
from cut_meshes import scene, solution

from verify.compare.body import body_of
from verify.compare.cut_line import cut_rule
from verify.compare.displacement_error import displacement_error
from verify.compare.jump_error import displacement_jump
from verify.compare.locate import SolutionField
from verify.compare.realised import SidedField, cut_deviation, field_of
from verify.compare.slabs import area_rule

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
