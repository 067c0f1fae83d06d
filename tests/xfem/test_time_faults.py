"""Steps that cannot be taken are refused, and leave the state as it was."""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_body, material

from verify.xfem.body import (
    DynamicBody,
    MotionState,
    MovingSupports,
    RayleighDamping,
    StepFailedError,
)
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.errors import XfemError
from verify.xfem.explicit import CentralDifferences
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.mass_shifted import shifted_mass
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.supports import Supports

SCHEMES = [CentralDifferences, RealTimeEuler, ImplicitEuler, Trapezoidal, EnergyMomentum]


def _body(**options):
    v = cut_body(2)
    return DynamicBody(InternalForce(v, material(2)), side_wise_mass(v, DENSITY), **options)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_load_that_is_not_finite_fails_the_step_and_not_the_state(scheme):
    body = _body(load=lambda t: np.full((_nodes(), 2), np.nan if t > 0.011 else 1.0))
    state, integrator = body.rest(), scheme(body, 0.01)
    integrator.step(state)
    good = state.copy()
    with pytest.raises(StepFailedError, match=scheme.__name__):
        integrator.step(state)
    assert state.time == good.time
    assert (state.displacement == good.displacement).all()
    assert (state.velocity == good.velocity).all()


def _nodes():
    return cut_body(2).node_count


@pytest.mark.parametrize("scheme", SCHEMES)
def test_steps_and_states_that_do_not_fit_are_refused(scheme):
    body = _body()
    for step in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(XfemError, match="time step"):
            scheme(body, step)
    with pytest.raises(XfemError, match="displacement of shape"):
        scheme(body, 0.1).step(MotionState(np.zeros((3, 2)), np.zeros((3, 2))))


def test_bodies_that_do_not_fit_are_refused():
    v = cut_body(2)
    with pytest.raises(XfemError, match="weight of shape"):
        _body(weight=np.zeros(2))
    with pytest.raises(XfemError, match="supports"):
        _body(supports=Supports(np.zeros((3, 2), dtype=bool), np.zeros((3, 2))))
    with pytest.raises(XfemError, match="load of shape"):
        _body(load=lambda t: np.zeros(2)).external(0.0)
    with pytest.raises(XfemError, match="Rayleigh damping β"):
        RayleighDamping(0.0, -1.0)
    with pytest.raises(XfemError, match="the body has"):
        DynamicBody(InternalForce(v, material(2)), side_wise_mass(cut_body(3), 1.0))
    moving = MovingSupports(
        v.node_points[:, 1:] * np.ones(2) == 0.0, lambda t: (np.zeros(2), np.zeros(2))
    )
    with pytest.raises(XfemError, match="prescribed displacement"):
        _body(supports=moving).rest()
    mass = shifted_mass(v, DENSITY, "enrichment")
    rows, columns, _ = mass.entries
    driven = np.zeros(v.node_points.shape, dtype=bool)
    driven[rows[rows != columns][0]] = True  # one of two unknowns that the mass couples
    moving = MovingSupports(driven, lambda t: (np.zeros(driven.shape), np.zeros(driven.shape)))
    with pytest.raises(XfemError, match="couples"):
        CentralDifferences(DynamicBody(InternalForce(v, material(2)), mass, supports=moving), 0.1)
