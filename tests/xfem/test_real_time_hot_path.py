"""The real-time step allocates nothing, and is the same whichever solver it is solved by."""

import tracemalloc

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_cube, material, penalised

from verify.accelerated import FAST
from verify.accelerated.cholesky import Cholesky
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.xfem.body import DynamicBody, MovingSupports, StepFailedError
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.supports import Supports

STEP = 2e-3


def hanging(n=3, drive=None):
    """A cut cube under gravity, one face held, or driven up and down."""
    phantom = cut_cube(n)
    face = phantom.node_points[:, 2] == 0.0
    mass = side_wise_mass(phantom, DENSITY)
    supports = Supports.none(phantom).prescribe(phantom, phantom.mesh.points[:, 2] == 0.0)
    if drive is not None:
        fixed = np.repeat(face[:, None], 3, axis=1)
        zero = np.zeros((len(face), 3))

        def motion(time):
            return zero + np.array([0.0, 0.0, drive * np.sin(40.0 * time)]), zero

        supports = MovingSupports(fixed, motion)
    return DynamicBody(
        InternalForce(phantom, material(3), kernels=FAST),
        mass,
        weight=mass.weight([0.0, 0.0, -9.8]),
        supports=supports,
    )


@pytest.mark.parametrize("solver", [Cholesky, ConjugateGradients])
def test_a_step_allocates_a_few_vectors_and_no_matrix(solver):
    body = hanging(8)
    scheme, state = RealTimeEuler(body, STEP, solver=solver(body.pattern, 3)), body.rest()
    for _ in range(3):
        scheme.advance(state)
    tracemalloc.start()
    try:
        for _ in range(5):
            scheme.advance(state)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 4 * state.displacement.nbytes < 0.2 * scheme.blocks.nbytes


@pytest.mark.parametrize("drive", [None, 0.02])
def test_steps_by_conjugate_gradients_are_those_by_factorisation(drive):
    """Though they see the half of the matrix above the diagonal only, driven supports too."""
    one, two = hanging(drive=drive), hanging(drive=drive)
    iterative = ConjugateGradients(one.pattern, 3, tolerance=1e-12)
    schemes = RealTimeEuler(one, STEP, solver=iterative), RealTimeEuler(two, STEP)
    states = one.rest(), two.rest()
    for _ in range(40):
        for scheme, state in zip(schemes, states, strict=True):
            scheme.advance(state)
    moved = np.abs(states[1].displacement).max()
    assert moved > 1e-3
    # 40 steps with errors of 1e-12 of the load, of a system of condition below 1e4
    assert np.abs(states[0].displacement - states[1].displacement).max() < 1e-7 * moved


def test_a_step_that_fails_does_not_spoil_the_next():
    body = hanging()
    states = [body.rest() for _ in range(2)]
    schemes = [
        RealTimeEuler(body, 0.05, solver=ConjugateGradients(body.pattern, 3)) for _ in range(2)
    ]
    for _ in range(4):
        for scheme, state in zip(schemes, states, strict=True):
            scheme.advance(state)
    good = schemes[0].solver
    schemes[0].solver = ConjugateGradients(body.pattern, 3, limit=1)
    with pytest.raises(StepFailedError, match="after 1 iterations"):
        schemes[0].advance(states[0])
    schemes[0].solver = good
    for scheme, state in zip(schemes, states, strict=True):
        scheme.advance(state)
    # rotations begin where the failed step has left them: round-off
    apart = np.abs(states[0].displacement - states[1].displacement).max()
    assert apart < 1e-12 * np.abs(states[1].displacement).max()


def test_a_penalised_solid_is_swept_to_the_force_and_stiffness_of_evaluation_and_assembly():
    body = penalised(cut_cube(3), kernels=FAST)
    force, phantom = body.force, body.force.phantom
    pattern = body.mass.pattern(phantom, force.ghost.couplings)
    rng = np.random.default_rng(2)
    u, v = 0.02 * rng.normal(size=(2, phantom.node_count, 3))
    internal, blocks = np.empty_like(u), np.empty((len(pattern.columns), 3, 3))
    force.linearise(pattern, u, v, 0.1, 0.3, internal, blocks)
    expected, _ = force.evaluate(u)
    force.add_tangent_product(v, 0.1, expected)
    stiffness = np.zeros_like(blocks)
    force.add_stiffness(pattern, stiffness, 0.3)
    assert np.abs(internal - expected).max() < 1e-12 * np.abs(expected).max()
    assert np.abs(blocks - stiffness).max() < 1e-12 * np.abs(stiffness).max()
    assert np.abs(force.ghost.matrix @ u).max() > 1e-3 * np.abs(expected).max()
