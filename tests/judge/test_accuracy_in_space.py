"""The whole judgement in space: interpolants of a known field stand in for solvers."""

import numpy as np
import pytest
from judged_fields import Quadratic, judged
from solid_meshes import height, inclined, solid_scene, stacked

from verify.result import Verdict
from verify.solution import Solution


def above(points):
    return points[:, 2] - height(points)


EXACT = Quadratic(above)


def interpolant(n, flip=False):
    points, cells, layer = stacked(n, [height], flip)
    far = np.where(layer[:, None] == 1, [[0.5, 0.5, 3.0]], [[0.5, 0.5, -3.0]])
    u = EXACT.displacement(points, far)
    return Solution(points, cells.astype(np.int64), u[None], size=1 / n, unknowns=3 * len(points))


LEVELS = {0: interpolant(4), 1: interpolant(6), 2: interpolant(8)}


def assess(checks, solvers, exact=None, **more):
    content = {"exact": {"solution": "quadratic"}} if exact else {}
    asked = solid_scene([inclined()], acceptance=checks, **content, **more)
    return judged(asked, solvers, exact)


CHECKS = [
    {"check": "rate", "metric": "displacement_l2", "at_least": 1.9},
    {"check": "rate", "metric": "energy_norm", "at_least": 0.9},
    {"check": "error", "metric": "jump_l2", "at_most": 1e-2},
    {"check": "error", "metric": "opening_l2", "at_most": 1e-2},
    {"check": "error", "metric": "displacement_max", "at_most": 1e-2},
    {"check": "error", "metric": "opening", "at_most": 1e-2},
]
QUANTITIES = [
    {"kind": "strain_energy"},
    {"kind": "opening", "name": "opening", "point": [0.5, 0.5, 0.5]},
    {"kind": "displacement", "name": "corner", "point": [1.0, 1.0, 1.0], "component": "y"},
    {"kind": "maximum_displacement"},
]


def test_interpolants_in_space_converge_with_orders_two_and_one():
    result = assess(CHECKS, {"xfem": LEVELS}, EXACT, quantities=QUANTITIES)
    assert [(v.verdict, v.reason) for v in result.verdicts if v.verdict is not Verdict.PASS] == []
    finest = result.solves[2]
    assert finest.metric("corner").value == pytest.approx(0.13, abs=1e-13)
    largest = finest.metric("maximum_displacement")
    # at the corner (1, 1, 1): |(1, 1.3, 0)| / 10
    assert largest.value == pytest.approx(0.1 * np.hypot(1, 1.3), rel=1e-13)
    assert abs(largest.reference - largest.value) <= largest.uncertainty
    # quadratic fields: energies are polynomials, which both rules integrate exactly
    assert finest.metric("strain_energy").uncertainty < 1e-12
    assert finest.metric("displacement_l2_near") is None  # a cut through the body has no tip


def test_near_and_far_make_up_the_whole():
    half = {
        "kind": "polygon",
        "points": [[-0.1, -0.1, 0.5], [0.6, -0.1, 0.5], [0.6, 1.1, 0.5], [-0.1, 1.1, 0.5]],
    }
    asked = solid_scene([half], exact={"solution": "quadratic"})
    result = judged(asked, {"xfem": {0: LEVELS[0]}}, EXACT)
    for name in ("displacement_l2", "energy_norm"):
        whole, near, far = (
            result.solves[0].metric(f"{name}{where}").value for where in ("", "_near", "_far")
        )
        assert 0 < near < far
        assert near**2 + far**2 == pytest.approx(whole**2, rel=1e-12)
    # 0.6 of the cube's section is cut
    assert result.reference.near["radius"] == pytest.approx(0.1 * np.sqrt(0.6), rel=1e-12)
