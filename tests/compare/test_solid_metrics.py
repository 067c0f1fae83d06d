"""Solids whose cut is realised otherwise than it was asked for."""

import numpy as np
import pytest
from solid_meshes import solid_scene

from verify.compare.body import body_of
from verify.compare.body_rule import body_rule
from verify.compare.curves import Arc
from verify.compare.jump_error import jump_error
from verify.compare.locate import SolutionField
from verify.compare.realised import SidedField, cut_deviation, field_of
from verify.compare.surface_rule import surface_rule
from verify.solution import Solution


def solution(points, cells, u, **more):
    return Solution(points=points, cells=cells.astype(np.int64), displacement=u[None], **more)


def tube(facets, radius=0.3):
    """A prism with a regular polygon inscribed in a circle, in a cube: cut along its mantle."""
    angle = 2 * np.pi * np.arange(facets) / facets
    ring = 0.5 + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    scale = 0.5 / np.abs(ring - 0.5).max(axis=1)[:, None]
    hull = 0.5 + (ring - 0.5) * scale  # on the square
    points, cells, inner, mantle = [], [], [], []

    def prism(a, b, c, moved):
        first = 6 * (len(points) // 6)
        points.extend([[*p, z] for z in (0.0, 1.0) for p in (a, b, c)])
        inner.extend([moved] * 6)
        cells.extend(
            (first + np.array(t)).tolist() for t in ([0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5])
        )

    centre = np.array([0.5, 0.5])
    for k in range(facets):
        a, b, c, d = ring[k], ring[(k + 1) % facets], hull[k], hull[(k + 1) % facets]
        prism(centre, a, b, True)
        prism(a, c, d, False)
        prism(a, d, b, False)
        low, high = [[*p, 0.0] for p in (a, b)], [[*p, 1.0] for p in (a, b)]
        mantle += [[low[0], low[1], high[1]], [low[0], high[1], high[0]]]
    return np.array(points), np.array(cells), np.array(inner), np.array(mantle)


def test_the_sides_of_a_tube_are_those_of_the_cylinder_and_not_of_its_facets():
    cut = {"kind": "cylinder", "base": [0.5, 0.5, -0.1], "axis": [0.0, 0.0, 1.0],
           "radius": 0.3, "height": 1.2}  # fmt: skip
    body = body_of(solid_scene([cut]))
    points, cells, inner, mantle = tube(16)
    u = np.where(inner[:, None], [0.0, 0.0, 1.0], 0.0)
    one = solution(points, cells, u, cut_facets=mantle)
    # sagitta of 16 chords; probes are corners and centroids, those lie two thirds along it
    sagitta = 0.3 * (1 - np.cos(np.pi / 16))
    assert 0.8 * sagitta < cut_deviation(one, body) <= sagitta * (1 + 1e-12)
    field = field_of(one, body)
    assert isinstance(field, SidedField)
    rule = body_rule(body, 0.1)
    inside = np.linalg.norm(rule.points[:, :2] - 0.5, axis=1) < 0.3
    lift = field.displacement(rule.points, rule.points)[:, 2]
    assert np.allclose(lift, inside)
    jump = jump_error(field, SolutionField(solution(points, cells, 0 * u)), surface_rule(body, 0.1))
    area = 2 * np.pi * 0.3
    assert jump.absolute == pytest.approx(np.sqrt(area), rel=1e-3)  # that of the trimmed area
    assert isinstance(body.patches[0].arc, Arc)
