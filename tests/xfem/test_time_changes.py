"""Changes during a motion: loads, supports, observers, the sign of time; faults of a step."""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_body, cut_membrane, material
from time_schemes import SCHEMES

from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.body import DynamicBody, RayleighDamping, StepFailedError
from verify.xfem.energy_balance import run
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import CentralDifferences
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import consistent_mass, side_wise_mass
from verify.xfem.real_time import RealTimeEuler

CHANGES = {
    "load replaced": lambda body, _: setattr(body, "load", lambda t: np.full(body.shape, 5.0)),
    "weight replaced": lambda body, _: setattr(body, "weight", np.full(body.shape, 2.0)),
    "weight written to": lambda body, _: body.weight.fill(2.0),
    "damped": lambda body, _: setattr(body, "damping", RayleighDamping(2.0, 1e-3)),
    "shorter": lambda _, scheme: setattr(scheme, "step_size", 0.5 * scheme.step_size),
}


@pytest.mark.parametrize("kind", SCHEMES)
def test_a_change_during_the_motion_counts_from_the_next_step_on(kind):
    """Central differences went on with the force of the load that was there before."""
    v = cut_body(2)
    for name, change in CHANGES.items():
        ends = []
        for begins_anew in (False, True):
            body = DynamicBody(InternalForce(v, material(2)), side_wise_mass(v, DENSITY))
            state, scheme = body.rest(), kind(body, 0.003)
            state.velocity[:, 0] = v.node_points[:, 1] ** 2
            for _ in range(2):
                scheme.step(state)
            before = state.displacement.copy()
            change(body, scheme)
            if begins_anew:
                scheme = kind(body, scheme.step_size)
            for _ in range(2):
                scheme.step(state)
            ends.append(state.displacement - before)
        # Newton's methods end within a tolerance of 1e-10 of the forces
        assert np.abs(ends[0] - ends[1]).max() <= 1e-9 * np.abs(ends[1]).max(), name


@pytest.mark.parametrize(
    ("kind", "mass_of"),
    [*((kind, side_wise_mass) for kind in SCHEMES), (GeneralisedAlpha, consistent_mass)],
)
def test_nodes_that_are_held_in_flight_come_to_rest_and_start_from_rest_when_let_go(kind, mass_of):
    """With centred schemes their velocity went on changing its sign, and took them along again."""
    v = cut_body(2)
    free = DynamicBody(InternalForce(v, material(2)), mass_of(v, DENSITY))
    state = free.rest()
    state.velocity[:, 0] = 1.0
    run(kind(free, 1e-3), free, state, 5)
    clamp = v.node_points[:, 1] == 0.0
    fixed = np.repeat(clamp[:, None], 2, axis=1)
    held = free.held_by(Supports(fixed, np.where(fixed, state.displacement, 0.0)))
    caught = state.displacement[clamp].copy()
    account = run(kind(held, 1e-3), held, state, 3)
    assert np.array_equal(state.displacement[clamp], caught)
    assert np.abs(state.velocity[clamp]).max() < 1e-30
    # what stopping them takes is in the account, of energy and of momentum
    size = account.kinetic[0]
    assert np.ptp(account.balance - account.unbalanced) < 1e-12 * size
    assert np.abs(account.unbalanced).max() < 1e-7 * size
    gained = account.momentum - account.momentum[0]
    if kind is GeneralisedAlpha:
        # later than impulses by ½ − α_f = 1/18 of a step; what the mass couples to the stopped
        # nodes is thrown forward by less than these lose, so that twice the sum passes there
        assert np.abs(gained - account.impulse).max() < 2.0 * np.abs(gained).max() / 18
    else:
        assert np.abs(gained - account.impulse).max() < 1e-8 * np.abs(account.momentum).max()
    run(kind(free, 1e-6), free, state, 1)
    # let go they are pulled along by the stress that has built up, in a millionth of a second
    assert np.abs(state.velocity[clamp]).max() < 1e-3


@pytest.mark.parametrize("kind", SCHEMES)
@pytest.mark.parametrize("v", [cut_body(3), cut_membrane()], ids=["3D", "sheet"])
def test_an_observer_who_moves_along_sees_the_same_deformation(kind, v):
    """Galilei: 60 m/s added to the velocity change nothing but the place."""
    dim = v.mesh.space
    body = DynamicBody(InternalForce(v, material(v.mesh.dim)), side_wise_mass(v, DENSITY))
    drift, step, steps = np.array([50.0, -30.0, 20.0])[:dim], 0.002, 8
    ends = []
    for speed in (0.0 * drift, drift):
        state, scheme = body.rest(), kind(body, step)
        state.displacement[:, 0] = 0.05 * np.sin(2.0 * v.node_points[:, 1])
        state.velocity[:] = 0.3 * np.cos(3.0 * v.node_points) + speed
        for _ in range(steps):
            scheme.step(state)
        ends.append(state.displacement - steps * step * speed)
    # Newton's methods end within 1e-10 of the forces; the others were within 1e-14
    assert np.abs(ends[1] - ends[0]).max() < 1e-10


@pytest.mark.parametrize("v", [cut_body(3), cut_membrane()], ids=["3D", "sheet"])
@pytest.mark.parametrize("kind", [CentralDifferences, Trapezoidal, EnergyMomentum])
def test_schemes_that_look_the_same_backwards_return_to_their_start(kind, v):
    """Velocities reversed, a symmetric scheme retraces its steps to round-off."""
    body = DynamicBody(InternalForce(v, material(v.mesh.dim)), side_wise_mass(v, DENSITY))
    state, scheme = body.rest(), kind(body, 0.002)
    state.displacement[:, 0] = 0.05 * np.sin(2.0 * v.node_points[:, 1])
    state.velocity[:] = 0.3 * np.cos(3.0 * v.node_points)
    start = state.copy()
    for _ in range(2):
        for _ in range(15):
            scheme.step(state)
        state.velocity *= -1.0
    assert np.abs(state.displacement - start.displacement).max() < 1e-12
    assert np.abs(state.velocity - start.velocity).max() < 1e-9


@pytest.mark.parametrize(
    "scheme", [CentralDifferences, RealTimeEuler, ImplicitEuler, Trapezoidal, EnergyMomentum]
)
def test_a_load_that_is_not_finite_fails_the_step_and_not_the_state(scheme):
    v = cut_body(2)
    force, mass = InternalForce(v, material(2)), side_wise_mass(v, DENSITY)
    body = DynamicBody(
        force, mass, load=lambda t: np.full(v.node_points.shape, np.nan if t > 0.011 else 1.0)
    )
    state, integrator = body.rest(), scheme(body, 0.01)
    integrator.step(state)
    good = state.copy()
    with pytest.raises(StepFailedError, match=scheme.__name__):
        integrator.step(state)
    assert state.time == good.time
    assert (state.displacement == good.displacement).all()
    assert (state.velocity == good.velocity).all()
