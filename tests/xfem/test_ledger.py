"""Energy and momentum accounts of cut bodies in motion."""

from dataclasses import replace

import numpy as np
import pytest
from cut_bodies import DENSITY, GRAVITY, cut_body, cut_cube, cut_square, material, rotation
from time_schemes import SCHEMES

from verify.accelerated import FAST
from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.body import DynamicBody, MovingSupports, RayleighDamping
from verify.xfem.energy_balance import run
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import CentralDifferences, ForwardEuler, SymplecticEuler, critical_step
from verify.xfem.implicit import ImplicitEuler
from verify.xfem.internal_force import InternalForce, inverted_cells
from verify.xfem.linear_solvers import PLAIN
from verify.xfem.mass import side_wise_mass
from verify.xfem.real_time import RealTimeEuler


def _free(v, kinematics="corotational", kernels=FAST):
    force = InternalForce(v, material(v.mesh.dim), kinematics, kernels)
    return DynamicBody(force, side_wise_mass(v, DENSITY))


def _critical(body):
    v = body.force.phantom
    stiffness = InternalForce(v, material(v.mesh.dim), "linear").stiffness(body.pattern)
    return critical_step(body.pattern.matrix(stiffness), body.mass)


def _moving(body, strain, spin=0.0):
    """Stretched along x, with a spin in 1/s about the centre and a drift."""
    state, X = body.rest(), body.force.phantom.node_points
    dim = X.shape[1]
    state.displacement[:, 0] = strain * (X[:, 0] - 0.5)
    W = spin * (rotation(dim, 0.5 * np.pi) - rotation(dim, -0.5 * np.pi)) / 2.0
    state.velocity[:] = (X - 0.5) @ W.T + 0.1 * np.arange(1, dim + 1)
    return state


@pytest.mark.parametrize(
    ("scheme", "dim"), [*((s, 3) for s in SCHEMES), (CentralDifferences, 2), (EnergyMomentum, 2)]
)
def test_the_account_closes_for_every_scheme_with_loads_supports_and_damping(scheme, dim):
    v = cut_body(dim)
    X, along = v.node_points, np.eye(dim)[0]
    fixed = np.repeat(X[:, -1:] == 0.0, dim, axis=1)

    def motion(t):
        return tuple(
            np.tile(x * along, (len(X), 1)) for x in (0.02 * np.sin(9 * t), 0.18 * np.cos(9 * t))
        )

    mass, push = side_wise_mass(v, DENSITY), np.random.default_rng(1).normal(size=X.shape)
    body = DynamicBody(
        InternalForce(v, material(dim)),
        mass,
        weight=mass.weight(-GRAVITY * np.eye(dim)[-1]),
        load=lambda t: np.sin(20.0 * t) * push,
        supports=MovingSupports(fixed, motion),
        damping=RayleighDamping(0.5, 1e-3),
    )
    state = body.rest()
    account = run(scheme(body, 0.005), body, state, 20)
    size = np.ptp(account.gravity) + account.kinetic.max()
    for column in ("load_work", "support_work", "damping"):
        assert np.abs(getattr(account, column)).max() > 1e-6 * size
    assert (np.abs(account.algorithmic).max() < 1e-12 * size) == (scheme is EnergyMomentum)
    assert np.ptp(account.balance) <= 1e-9 * size
    assert np.ptp(account.balance - account.unbalanced) <= 1e-12 * size
    explicit = scheme in (CentralDifferences, SymplecticEuler, ForwardEuler)
    assert explicit or np.diff(account.damping).min() > -1e-12 * size
    assert np.abs(state.displacement - motion(state.time)[0])[fixed].max() < 1e-15
    if scheme is not GeneralisedAlpha:  # its momentum is later by a share of a step
        gained = account.momentum - account.momentum[0]
        assert np.abs(gained - account.impulse).max() < 1e-9 * np.abs(account.momentum).max()


@pytest.mark.parametrize("dim", [2, 3])
def test_a_free_body_keeps_its_momentum_and_turns_on_by_those_schemes_that_should(dim):
    drifts = {}
    for scheme in SCHEMES:
        body = _free(cut_body(dim), kernels=PLAIN)
        state = _moving(body, 0.05, 2.0)
        account = run(scheme(body, 0.5 * _critical(body)), body, state, 40)
        drift = np.abs(account.momentum - account.momentum[0]).max()
        # round-off of the largest momenta that cancel, over 40 steps
        largest = np.sqrt(2.0 * account.kinetic.max() * DENSITY)
        assert drift < 40 * 64 * np.finfo(float).eps * largest
        turning = account.angular_momentum
        drifts[scheme] = np.abs(turning - turning[0]).max() / np.abs(turning).max()
    for scheme in (CentralDifferences, SymplecticEuler, EnergyMomentum):
        assert drifts[scheme] < 1e-11
    for scheme in (RealTimeEuler, ImplicitEuler, ForwardEuler):
        assert drifts[scheme] > 1e-4


@pytest.mark.parametrize(
    ("body", "share", "steps", "most"),
    [
        # what a step leaves unsolved adds up: a tenth of what 2000 steps may drift
        (lambda: cut_square(2), 4.0, 60, 1e-9),
        *(
            pytest.param(make, share, 10_000, 1e-8, marks=pytest.mark.heavy)
            for make, share in (
                (lambda: cut_square(4), 4.0),
                (lambda: cut_cube(1, (0.5, 0.53, 0.47)), 0.9),
            )
        ),
    ],
)
def test_the_energy_momentum_scheme_conserves_at_large_amplitude_over_many_steps(
    body, share, steps, most
):
    body = _free(body())
    state = _moving(body, 0.3, 2.0)
    account = run(EnergyMomentum(body, share * _critical(body)), body, state, steps)
    assert account.drift <= most
    turning = account.angular_momentum
    assert np.abs(turning - turning[0]).max() <= most * np.abs(turning).max()
    assert np.ptp(account.strain) > 0.1 * account.mechanical[0]


@pytest.mark.parametrize(
    ("make", "law"),
    [
        (lambda: cut_square(3), "neo_hookean"),
        (lambda: cut_cube(1, (0.5, 0.53, 0.47)), "neo_hookean"),
        (lambda: cut_cube(1, (0.5, 0.53, 0.47)), "stable_neo_hookean"),
    ],
)
def test_neo_hookean_parts_keep_energy_and_momenta_step_by_step(make, law):
    """Two parts that fly apart, swing by 0.4 of their length and turn by 0.1 in a step."""
    v = make()
    force = InternalForce(v, replace(material(v.mesh.dim), law=law), kernels=FAST)
    body = DynamicBody(force, side_wise_mass(v, DENSITY))
    state = _moving(body, 0.4, 3.0)
    state.velocity[v.node_points[:, -1] > 0.5, -1] += 0.3
    account = run(EnergyMomentum(body, 0.03), body, state, 25)
    for kept in (account.mechanical, account.momentum, account.angular_momentum):
        assert np.abs(np.diff(kept, axis=0)).max() < 1e-10 * np.abs(kept).max()
    assert np.ptp(account.strain) > 0.1 * account.mechanical[0]


def test_energy_is_kept_while_pieces_turn_inside_out():
    body = _free(cut_cube(2, (0.5, 0.53, 0.47)))
    state = _moving(body, 0.5, 3.0)
    scheme = EnergyMomentum(body, 0.9 * _critical(body))
    inverted, first = 0, None
    for _ in range(4):
        account = run(scheme, body, state, 25)
        first = account.mechanical[0] if first is None else first
        inverted = max(inverted, len(inverted_cells(body.force, state.displacement)))
        assert account.mechanical[-1] == pytest.approx(first, rel=1e-9)
    assert inverted > 0


def _slowest_mode():
    """A linear body, angular frequency and shape of the slowest mode that is not rigid."""
    body = _free(cut_square(4), "linear")
    K = body.pattern.matrix(body.force.stiffness(body.pattern))
    root = np.repeat(np.sqrt(body.mass.diagonal), 2)
    values, vectors = np.linalg.eigh(K.toarray() / np.outer(root, root))
    mode = int(np.argmax(values > 1e-6 * values[-1]))
    return body, np.sqrt(values[mode]), (vectors[:, mode] / root).reshape(body.shape)


@pytest.mark.parametrize("scheme", [ImplicitEuler, RealTimeEuler])
def test_implicit_euler_halves_the_energy_of_a_mode_in_ln_2_over_omega_squared_h(scheme):
    body, omega, shape = _slowest_mode()
    h, state = 0.05 / omega, body.rest()
    state.displacement[:] = 1e-3 * shape
    steps = round(np.log(2.0) / (omega * h) ** 2)
    account = run(scheme(body, h), body, state, steps)
    # each step divides by 1 + (ωh)²: exact; the formula differs by (ωh)²/2
    left = account.mechanical[-1] / account.mechanical[0]
    assert left == pytest.approx((1.0 + (omega * h) ** 2) ** -steps, rel=1e-8)
    assert left == pytest.approx(0.5, rel=3e-3)
    lost = account.mechanical[0] - account.mechanical[-1]
    assert account.algorithmic[-1] == pytest.approx(lost, rel=1e-9)


@pytest.mark.parametrize("scheme", [s for s in SCHEMES if s is not RealTimeEuler])
def test_a_damped_mode_decays_as_rayleigh_says(scheme):
    body, omega, shape = _slowest_mode()
    body = DynamicBody(body.force, body.mass, damping=RayleighDamping(0.1 * omega, 0.1 / omega))
    state = body.rest()
    state.displacement[:] = 1e-3 * shape
    h = 2e-3 / omega
    integrator = scheme(body, h)
    for _ in range(500):
        integrator.step(state)
    ratio, t = 0.1, 500 * h  # ζ = α/2ω + βω/2
    damped = omega * np.sqrt(1.0 - ratio**2)
    exact = np.exp(-ratio * omega * t) * (
        np.cos(damped * t) + ratio * omega / damped * np.sin(damped * t)
    )
    amplitude = np.sum(body.mass.apply(shape) * state.displacement) / 1e-3
    # first-order schemes: ωh t ω/2 = 1e-3
    assert amplitude == pytest.approx(exact, abs=2e-3)
