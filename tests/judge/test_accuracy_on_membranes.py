"""The whole judgement on membranes: interpolants of a known field stand in for solvers."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from cut_meshes import grid
from judged_fields import Quadratic, judged
from membrane_meshes import layers, line, membrane, roof

from verify.compare.body import body_of
from verify.result import Verdict
from verify.scene import load_scene

CASE = """
title = "a sheet"
requirement = "it shall hold"
[geometry]
kind = "file"
file = "sheet.vtu"
dimension = 3
cells = "surface"
[mesh]
pattern = "given"
[material]
young = 1.0
poisson = 0.3
thickness = 0.01
[analysis]
kinematics = "corotational"
[[supports]]
where = "boundary"
displacement = [0.0, 0.0, 0.0]
[[cuts]]
kind = "polygon"
name = "cut"
points = [[-1.0, -0.1, -1.0], [-1.0, -0.1, 2.0], [2.0, 1.1, 2.0], [2.0, 1.1, -1.0]]
[[quantities]]
kind = "strain_energy"
[[quantities]]
kind = "opening"
name = "opening"
point = [0.25, 0.4, 0.2]
[[quantities]]
kind = "displacement"
name = "corner"
point = [1.0, 1.0, 0.0]
component = "y"
[[quantities]]
kind = "maximum_displacement"
"""


def above(points):
    return points[:, 1] - line(points[:, 0])


TRUTH = Quadratic(above)


def interpolant(n, shape=roof, flip=False):
    points, cells, layer = layers(shape, n, flip=flip)
    far = np.where(layer[:, None] == 1, [[0.5, 3.0, 0.0]], [[0.5, -3.0, 0.0]])
    u = TRUTH.displacement(points, far)
    edge = points[layer == 1]
    low = edge[np.abs(edge[:, 1] - line(edge[:, 0])) < 1e-9]
    facets = np.stack([low[:-1], low[1:]], axis=1)
    return membrane(points, cells, u, size=1 / n, unknowns=3 * len(points), cut_facets=facets)


@pytest.fixture
def sheet(tmp_path):
    def make(checks="", shape=roof, n=4):
        points, cells = grid(n, n)
        meshio.Mesh(shape(*points.T), [("triangle", cells)]).write(tmp_path / "sheet.vtu")
        (tmp_path / "case.toml").write_text(CASE + checks)
        return load_scene(tmp_path / "case.toml")

    return make


def limit(metric, at_most):
    return f'[[acceptance]]\ncheck = "error"\nmetric = "{metric}"\nat_most = {at_most}\n'


EXACT = '[exact]\nsolution = "quadratic"\n'


def test_interpolants_on_a_membrane_converge_to_the_exact_field(sheet):
    checks = "".join(limit(m, 0.05) for m in ("displacement_l2", "jump_l2", "opening"))
    result = judged(
        sheet(EXACT + checks), {"xfem": {k: interpolant(4 * 2**k) for k in range(3)}}, TRUTH
    )
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
    scene, whole = sheet(EXACT + limit("jump_l2", 0.1)), interpolant(4)
    part = replace(whole, cells=whole.cells[:-3])
    lifted = replace(whole, points=whole.points + np.array([0.0, 0.0, 0.05]))
    for solution, reason in ((part, "of the body"), (lifted, "surface")):
        result = judged(scene, {"xfem": {0: solution}}, TRUTH)
        assert result.verdicts[0].verdict is Verdict.ERROR
        assert reason in result.verdicts[0].reason


def test_how_far_a_surface_lies_off_that_of_the_scene_is_said_beyond_round_off_of_its_size(sheet):
    scene, whole = sheet(EXACT), interpolant(4)
    size = body_of(scene).size
    assert size > 1.2  # of one, shares and lengths were the same
    for share, said in ((0.9, False), (2.5, True)):
        lift = np.array([0.0, 0.0, share * 1e-10 * size])
        (record,) = judged(scene, {"xfem": {0: replace(whole, points=whole.points + lift)}}, TRUTH
                           ).solves  # fmt: skip
        assert ("surface" in record.notes) is said
