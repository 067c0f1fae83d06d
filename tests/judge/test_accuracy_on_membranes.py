"""The whole judgement on membranes: interpolants of a known field stand in for solvers."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
import scenes
from cut_meshes import grid
from judged_fields import Quadratic, judged
from membrane_meshes import layers, line, membrane, roof

from verify.compare.body import body_of
from verify.result import Verdict

QUANTITIES = [
    {"kind": "strain_energy"},
    {"kind": "opening", "name": "opening", "point": [0.25, 0.4, 0.2]},
    {"kind": "displacement", "name": "corner", "point": [1.0, 1.0, 0.0], "component": "y"},
    {"kind": "maximum_displacement"},
]
CUT = [[-1.0, -0.1, -1.0], [-1.0, -0.1, 2.0], [2.0, 1.1, 2.0], [2.0, 1.1, -1.0]]


def above(points):
    return points[:, 1] - line(points[:, 0])


TRUTH = Quadratic(above)


def interpolant(n):
    points, cells, layer = layers(roof, n)
    far = np.where(layer[:, None] == 1, [[0.5, 3.0, 0.0]], [[0.5, -3.0, 0.0]])
    u = TRUTH.displacement(points, far)
    edge = points[layer == 1]
    low = edge[np.abs(edge[:, 1] - line(edge[:, 0])) < 1e-9]
    facets = np.stack([low[:-1], low[1:]], axis=1)
    return membrane(points, cells, u, size=1 / n, unknowns=3 * len(points), cut_facets=facets)


@pytest.fixture
def sheet(tmp_path):
    def make(**limits):
        points, cells = grid(4, 4)
        meshio.Mesh(roof(*points.T), [("triangle", cells)]).write(tmp_path / "sheet.vtu")
        surface = {"file": "sheet.vtu", "dimension": 3, "cells": "surface"}
        found = scenes.scene(
            [{"kind": "polygon", "name": "cut", "points": CUT}], 3,
            geometry={"kind": "file", **surface}, mesh={"pattern": "given"},
            material=scenes.soft(3, thickness=0.01), analysis={"kinematics": "corotational"},
            quantities=QUANTITIES, exact={"solution": "quadratic"},
            acceptance=[{"check": "error", "metric": m, "at_most": v} for m, v in limits.items()],
        )  # fmt: skip
        found.came_from(tmp_path / "case.toml", "sheet")
        return found

    return make


def test_interpolants_on_a_membrane_converge_to_the_exact_field(sheet):
    scene = sheet(displacement_l2=0.05, jump_l2=0.05, opening=0.05)
    result = judged(scene, {"xfem": {k: interpolant(4 * 2**k) for k in range(3)}}, TRUTH)
    assert [(v.verdict, v.reason) for v in result.verdicts if v.verdict is not Verdict.PASS] == []
    order = {rate.metric: rate.order for rate in result.rates}
    # linear elements: two in the displacement, also on cuts, and one in the energy norm
    assert order["displacement_l2"] == pytest.approx(2, abs=0.1)
    assert order["jump_l2"] == pytest.approx(2, abs=0.2)
    assert order["energy_norm"] == pytest.approx(1, abs=0.1)
    finest = result.solves[2]
    assert finest.metric("corner").value == pytest.approx(0.03, abs=1e-13)
    largest = finest.metric("maximum_displacement")
    assert abs(largest.reference - largest.value) <= largest.uncertainty
    energy = finest.metric("strain_energy")
    assert energy.unit == "J"
    assert energy.uncertainty < 1e-4 * energy.reference


def test_another_surface_or_a_part_of_one_is_an_error(sheet):
    scene, whole = sheet(jump_l2=0.1), interpolant(4)
    part = replace(whole, cells=whole.cells[:-3])
    lifted = replace(whole, points=whole.points + np.array([0.0, 0.0, 0.05]))
    for solution, reason in ((part, "of the body"), (lifted, "surface")):
        result = judged(scene, {"xfem": {0: solution}}, TRUTH)
        assert result.verdicts[0].verdict is Verdict.ERROR
        assert reason in result.verdicts[0].reason


def test_how_far_a_surface_lies_off_that_of_the_scene_is_said_beyond_round_off_of_its_size(sheet):
    scene, whole = sheet(), interpolant(4)
    size = body_of(scene).size
    assert size > 1.2  # of one, shares and lengths were the same
    for share, said in ((0.9, False), (2.5, True)):
        lift = np.array([0.0, 0.0, share * 1e-10 * size])
        (record,) = judged(scene, {"xfem": {0: replace(whole, points=whole.points + lift)}}, TRUTH
                           ).solves  # fmt: skip
        assert ("surface" in record.notes) is said
