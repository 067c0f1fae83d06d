"""A freed part falls as the scheme's own parabola says, wherever the cut is."""

import numpy as np
import pytest
from cut_bodies import DENSITY, GRAVITY, cut_square, material

from verify.methods.mass_variants import shifted_mass
from verify.xfem.body import DynamicBody
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import CentralDifferences, ForwardEuler, SymplecticEuler
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import side_wise_mass
from verify.xfem.real_time import RealTimeEuler

FALLEN = {  # after 50 steps of 0.01 s
    CentralDifferences: -1.225,
    Trapezoidal: -1.225,
    EnergyMomentum: -1.225,
    ImplicitEuler: -1.2495,
    RealTimeEuler: -1.2495,
    SymplecticEuler: -1.2495,
    ForwardEuler: -1.2005,
}


def _gravity(dim):
    return -GRAVITY * np.eye(dim)[-1]


@pytest.mark.parametrize("scheme", [s for s in FALLEN if s is not ForwardEuler])
@pytest.mark.parametrize("offset", [0.5, 0.03, 1e-6, 1e-12, 0.0])
def test_a_freed_half_falls_with_g_whatever_the_position_of_the_cut(scheme, offset):
    v = cut_square(8, (0.5, 0.5 + offset / 8.0), (0.0, 1.0))
    mass = side_wise_mass(v, DENSITY)
    held = Supports.none(v).prescribe(v, v.mesh.points[:, 1] == 1.0)
    body = DynamicBody(
        InternalForce(v, material(2)), mass, weight=mass.weight(_gravity(2)), supports=held
    )
    state, still = body.rest(), body.rest()
    integrator = scheme(body, 0.005)
    lower = v.bodies == v.bodies[np.argmin(v.node_points[:, 1])]
    for _ in range(20):
        integrator.step(state)
    steps = {-1.225: 20**2, -1.2495: 20 * 21}[FALLEN[scheme]]
    parabola = -0.5 * GRAVITY * 0.005**2 * steps
    assert np.abs(state.displacement[lower] - [0.0, parabola]).max() < 1e-12
    # and the half that is held does not notice: it moves as if it had been alone
    alone = DynamicBody(
        InternalForce(v, material(2)),
        mass,
        weight=np.where(lower[:, None], 0.0, mass.weight(_gravity(2))),
        supports=held,
    )
    other = scheme(alone, 0.005)
    for _ in range(20):
        other.step(still)
    assert np.abs(state.displacement[~lower] - still.displacement[~lower]).max() < 1e-12


def test_with_the_thesis_lumping_a_freed_half_falls_too_slowly():
    """(2.80–81) leave out M_ua: at mid-cell, 8 × 8, −8.757 instead of −9.8."""
    v = cut_square(8, (0.5, 0.4375), (0.0, 1.0))
    lower = (v.node_side[:, :1] < 0).astype(float)
    masses = {"exact": side_wise_mass(v, DENSITY), "thesis": shifted_mass(v, DENSITY, "enrichment")}
    found = {}
    for name, mass in masses.items():
        pull = np.sum(lower * mass.weight(_gravity(2))[:, 1:])
        found[name] = pull / np.sum(lower * mass.apply(lower))
    assert found["exact"] == pytest.approx(-9.8, abs=1e-12)
    assert found["thesis"] == pytest.approx(-8.757, abs=5e-4)
