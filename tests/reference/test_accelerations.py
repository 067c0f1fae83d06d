"""Accelerations at output times, beside supports that move."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx
from test_motion import MIDDLE, moving, solved

pytestmark = needs_fenicsx


UPRIGHT = {**MIDDLE, "points": [[0.41, -0.1], [0.47, 1.1]]}


@pytest.mark.parametrize("cut", [MIDDLE, {**UPRIGHT, "opens_at": 0.05}], ids=["open", "closed"])
@pytest.mark.parametrize("solver", ["conforming", "reference"])
def test_accelerations_are_the_differences_of_velocities_beside_supports_too(solver, cut):
    """Outputs of every step; the supports' own is 24 t in x, −18 t in y."""
    held = {"where": "top", "displacement": ["4 * t * t * t", "-3 * t * t * t"]}
    scene = moving(
        [cut], duration=0.05, time_step=5e-4, outputs=101, supports=[held],
        reference={"size": 0.4, "degree": 1},
    )  # fmt: skip
    found = solved(scene, solver)
    differences = (found.velocity[2:] - found.velocity[:-2]) / 1e-3
    # differences are good to (ω h)²/6, 4e-4 for the fastest mode of these meshes, 100/s
    off = np.abs(found.acceleration[1:-1] - differences)[50:]
    assert off.max() < 3e-3 * np.abs(differences).max()
    top = found.points[:, 1] > 1 - 1e-9
    known = 24 * found.times[1:-1, None] * np.array([1.0, -0.75])
    at_top = found.acceleration[1:-1, top]
    np.testing.assert_allclose(at_top, np.broadcast_to(known[:, None], at_top.shape), rtol=1e-3)
