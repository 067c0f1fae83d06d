"""Generalised-α: its order, and what it does to high frequencies."""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_square, material

from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.body import DynamicBody, RayleighDamping
from verify.xfem.energy_balance import run
from verify.xfem.implicit import Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass

RADII = [0.0, 0.8, 1.0]


def _body(v):
    return DynamicBody(InternalForce(v, material(v.mesh.dim), "linear"), side_wise_mass(v, DENSITY))


def _modes(body):
    K = body.pattern.matrix(body.force.stiffness(body.pattern))
    root = np.repeat(np.sqrt(body.mass.diagonal), body.shape[1])
    values, vectors = np.linalg.eigh(K.toarray() / np.outer(root, root))
    first = int(np.argmax(values > 1e-6 * values[-1]))
    return np.sqrt(values[first:]), vectors[:, first:] / root[:, None]


@pytest.mark.parametrize("rho", RADII)
def test_errors_of_a_damped_mode_fall_with_the_square_of_the_step(rho):
    body = _body(cut_square(4))
    omegas, shapes = _modes(body)
    omega, shape = omegas[0], shapes[:, 0].reshape(body.shape)
    body.damping = RayleighDamping(0.1 * omega, 0.1 / omega)
    ratio, end = 0.1, 6.0 / omega
    turned = np.sqrt(1.0 - ratio**2) * omega * end
    exact = np.exp(-ratio * omega * end) * np.array(
        [
            np.cos(turned) + ratio / np.sqrt(1.0 - ratio**2) * np.sin(turned),
            -omega / np.sqrt(1.0 - ratio**2) * np.sin(turned),
        ]
    )
    errors = []
    for steps in (60, 120, 240):
        state = body.rest()
        state.displacement[:] = 1e-3 * shape
        run(GeneralisedAlpha(body, end / steps, spectral_radius=rho), body, state, steps)
        of_mode = [np.sum(body.mass.apply(shape) * x) for x in (state.displacement, state.velocity)]
        errors.append(np.linalg.norm((np.array(of_mode) / 1e-3 - exact) / [1.0, omega]))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 3e-3  # (ωΔt)²/12 of a phase of 6, times 5 at ρ = 0


@pytest.mark.parametrize("rho", RADII)
def test_what_a_step_does_not_resolve_is_multiplied_by_the_radius(rho):
    """All three roots are −ρ at infinite frequency, so that (E + ρ)³ u = 0 with the shift E."""
    body = _body(cut_square(2))
    omegas, shapes = _modes(body)
    state, shape = body.rest(), shapes[:, -1].reshape(body.shape)
    state.displacement[:] = 1e-3 * shape
    scheme = GeneralisedAlpha(body, 1e4 / omegas[-1], spectral_radius=rho)
    history = []
    for _ in range(8):
        history.append(float(np.sum(body.mass.apply(shape) * state.displacement)) / 1e-3)
        scheme.step(state)
    for a, b, c, d in zip(history, history[1:], history[2:], history[3:], strict=False):
        # (ωΔt)⁻² = 1e-8 is what is missing to infinity
        assert abs(d + 3.0 * rho * c + 3.0 * rho**2 * b + rho**3 * a) < 1e-6
    assert (abs(history[3]) < 1e-6) == (rho == 0.0)


@pytest.mark.parametrize("scheme", [Trapezoidal, GeneralisedAlpha])
def test_a_load_that_jumps_between_two_steps_costs_no_order(scheme):
    """The step before took half of it already, and the acceleration of before was gone on with."""
    body = _body(cut_square(4))
    omegas, shapes = _modes(body)
    omega, shape = omegas[0], shapes[:, 0].reshape(body.shape)
    push = body.mass.apply(shape) * omega**2
    end = 4.0 / omega
    body.load = lambda t: push * (0.0 if t < 0.25 * end else 1.0)
    errors = []
    for steps in (32, 64, 128):
        state = body.rest()
        run(scheme(body, end / steps), body, state, steps)
        errors.append(abs(np.sum(body.mass.apply(shape) * state.displacement) - 1.0 + np.cos(3.0)))
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(2.0, abs=0.15)
