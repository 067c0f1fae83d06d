"""Steps that cannot be taken are refused, and leave the state as it was."""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_body, material

from verify.xfem.body import (
    DynamicBody,
    StepFailedError,
)
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import CentralDifferences
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.real_time import RealTimeEuler

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
