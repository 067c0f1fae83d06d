"""The same beam in the same scheme moves as in SOFA, an independent program."""

from pathlib import Path

import numpy as np
import pytest

from verify.xfem.body import DynamicBody
from verify.xfem.element import isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler

HERE = Path(__file__).parent / "sofa"


@pytest.mark.parametrize(
    ("beam", "after_1_s", "after_2_2_s"),
    [
        ("beam200", -0.0619945794431326, -0.0519375134486),
        ("beam1000", -0.069127198229302, -0.0588773240087),
    ],
)
def test_the_tip_of_a_clamped_beam_is_where_sofa_has_it(beam, after_1_s, after_2_2_s):
    with np.load(HERE / f"{beam}.npz") as stored:
        mesh = SimplexMesh(stored["nodes"], stored["tets"])
        clamped, tip = stored["fixed"], stored["tip"]
    v = cut_mesh(mesh, [])
    mass = side_wise_mass(v, 1000.0)
    body = DynamicBody(
        InternalForce(v, isotropic(1e4, 0.3, "solid")),
        mass,
        weight=mass.weight([0.0, -9.8, 0.0]),
        supports=Supports.none(v).prescribe(v, clamped),
    )
    scheme, state = RealTimeEuler(body, 0.01), body.rest()
    for _ in range(100):
        scheme.advance(state)
    # two direct solvers apart by round-off; 13 digits are given
    assert state.displacement[tip, 1].mean() == pytest.approx(after_1_s, abs=1e-12)
    for _ in range(120):
        scheme.advance(state)
    assert state.displacement[tip, 1].mean() == pytest.approx(after_2_2_s, abs=1e-12)
