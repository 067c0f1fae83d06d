"""The same beam in the same scheme moves as in SOFA, an independent program."""

from pathlib import Path

import numpy as np
import pytest

import verify.xfem as xfem
from verify.xfem.real_time import RealTimeEuler


def test_the_tip_of_a_clamped_beam_is_where_sofa_has_it():
    with np.load(Path(__file__).parent / "sofa" / "beam200.npz") as stored:
        mesh = xfem.SimplexMesh(stored["nodes"], stored["tets"])
        clamped, tip = stored["fixed"], stored["tip"]
    v = xfem.cut_mesh(mesh, [])
    mass = xfem.side_wise_mass(v, 1000.0)
    body = xfem.DynamicBody(
        xfem.InternalForce(v, xfem.isotropic(1e4, 0.3, "solid")),
        mass,
        weight=mass.weight([0.0, -9.8, 0.0]),
        supports=xfem.Supports.none(v).prescribe(v, clamped),
    )
    scheme, state = RealTimeEuler(body, 0.01), body.rest()
    # after 1 s and 2.2 s; two direct solvers apart by round-off; 13 digits are given
    for steps, sofa in ((100, -0.0619945794431326), (120, -0.0519375134486)):
        for _ in range(steps):
            scheme.advance(state)
        assert state.displacement[tip, 1].mean() == pytest.approx(sofa, abs=1e-12)
