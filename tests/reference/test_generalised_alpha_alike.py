"""Generalised-α of the compact solver and of the reference: one motion of the same elements."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, square

pytestmark = needs_fenicsx


@pytest.mark.parametrize("kinematics, rho", [("linear", 0.3), ("corotational", 0.6)])
def test_both_solvers_find_the_same_motion(kinematics, rho):
    from verify.solvers.conforming import ConformingSolver
    from verify.solvers.xfem import XfemSolver

    scene = square(
        supports=[{"where": "left", "displacement": [0, 0]}],
        material={"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0},
        loads=[{"kind": "gravity", "acceleration": [0, -9.8]}],
        analysis={
            "kind": "dynamic", "kinematics": kinematics, "duration": 0.3, "time_step": 0.01,
            "outputs": 4,
        },
    )  # fmt: skip
    given = {"scheme": "generalised_alpha", "spectral_radius": rho}
    ours = XfemSolver().solve(scene, 0, 0, mass="consistent", **given)
    theirs = ConformingSolver().solve(scene, 0, 0, **given)
    pairs = np.linalg.norm(ours.points[:, None] - theirs.points[None], axis=2).argmin(axis=1)
    found, wanted = ours.displacement, theirs.displacement[:, pairs]
    size = np.abs(wanted).max()
    assert size > 0.2
    # the reference ends a step at 1e-11 of its forces, ours at 1e-10 of its accelerations
    assert np.abs(found - wanted).max() < 1e-8 * size
    lost = [one.ledger["algorithmic"][-1] for one in (ours, theirs)]
    assert lost[0] == pytest.approx(lost[1], rel=1e-5)
    assert lost[0] > 0.0
