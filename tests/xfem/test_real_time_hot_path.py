"""The real-time step allocates nothing, and is the same whichever solver it is solved by."""

import tracemalloc

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_cube, material

from verify.accelerated import FAST
from verify.accelerated.cholesky import Cholesky
from verify.accelerated.conjugate_gradient_kernels import invert_blocks
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.accelerated.symmetric_sweep_kernels import (
    add_lower_product,
    solve_lower,
    solve_upper,
    take_upper,
    upper_pattern,
)
from verify.xfem.block_pattern import block_pattern, symmetric_product
from verify.xfem.body import DynamicBody, MovingSupports, StepFailedError
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.moving_body import treat_moving_body
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
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
    body = treat_moving_body(
        cut_cube(3), material(3), DENSITY, "penalise", factor=0.01, kernels=FAST
    )
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


@pytest.mark.parametrize("size", [1, 2, 3])
def test_sweeps_over_the_upper_half_are_those_of_dense_triangles(size):
    mesh = box_mesh((2, 2, 2)) if size == 3 else rectangle_mesh((4, 4))
    pattern = block_pattern(mesh.cells, len(mesh.points))
    rng = np.random.default_rng(size)
    blocks = rng.normal(size=(len(pattern.columns), size, size))
    blocks += blocks[pattern.mirror].transpose(0, 2, 1)
    blocks[pattern.diagonal] += 50.0 * np.eye(size)
    K = pattern.matrix(blocks).toarray()
    rows = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
    unread = pattern.columns < rows
    blocks[unread] = np.nan
    inverse = np.zeros((pattern.node_count, size, size))
    assert invert_blocks(blocks, pattern.diagonal, inverse) == -1
    parts = np.where(unread[:, None, None], 0.0, blocks)
    upper = pattern.matrix(parts).toarray()  # D + Lᵀ
    parts[pattern.columns != rows] = 0.0
    D = pattern.matrix(parts).toarray()
    matrix = (pattern.starts, pattern.columns, pattern.diagonal, blocks)
    places = upper_pattern(*matrix[:3])
    above = np.empty((len(places[1]), size, size))
    take_upper(pattern.starts, pattern.diagonal, blocks, above)
    half = (*places, above)

    p = rng.normal(size=(pattern.node_count, size))
    t, e, u, s, out = (np.full_like(p, np.nan) for _ in range(5))

    def is_close(given, wanted):
        return np.abs(given.ravel() - wanted).max() < 1e-13 * np.abs(wanted).max()

    solve_upper(*half, inverse, p, t, e, u)
    assert is_close(t, np.linalg.solve(upper, p.ravel()))
    assert is_close(u, D @ t.ravel())
    assert is_close(e, (upper - D) @ t.ravel())
    g = p.copy()
    solve_lower(*half, inverse, g, s)
    assert is_close(s, np.linalg.solve(upper.T, p.ravel()))
    assert is_close(g, D @ s.ravel())
    symmetric_product(*matrix, p, out)
    assert is_close(out, K @ p.ravel())
    out[:] = 0.0
    add_lower_product(*half, p, out)
    assert is_close(out, (upper - D).T @ p.ravel())
