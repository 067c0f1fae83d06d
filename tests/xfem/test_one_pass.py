"""One pass over tetrahedra gives what evaluation and assembly give one after the other."""

import numpy as np
import pytest
from cut_bodies import SOFT, cut_body, cut_membrane, cut_square, material

from verify.accelerated import FAST
from verify.xfem.averaged_stress import StepEnds, averaged_stress
from verify.xfem.block_pattern import block_pattern
from verify.xfem.elasticity import isotropic
from verify.xfem.internal_force import InternalForce, inverted_cells
from verify.xfem.mass import consistent_mass


def _moving(virtual, size, seed=4):
    rng = np.random.default_rng(seed)
    shape = virtual.node_points.shape
    edge = virtual.mesh.measures.min() ** (1.0 / virtual.mesh.dim)
    return size * edge * rng.normal(size=shape), rng.normal(size=shape)


def _in_two(force, pattern, u, v, implicit, scale):
    internal, _ = force.evaluate(u)
    force.add_tangent_product(v, implicit, internal)
    blocks = np.zeros((len(pattern.columns), u.shape[1], u.shape[1]))
    force.add_stiffness(pattern, blocks, scale)
    return internal, blocks


def _in_one(force, pattern, u, v, implicit, scale):
    internal = np.full_like(u, np.nan)
    blocks = np.full((len(pattern.columns), u.shape[1], u.shape[1]), np.nan)
    force.linearise(pattern, u, v, implicit, scale, internal, blocks)
    return internal, blocks


def _agree(one, two, digits=1e-13):
    for a, b in zip(one, two, strict=True):
        assert np.abs(a - b).max() < digits * np.abs(b).max()


@pytest.mark.parametrize("kinematics", ["corotational", "linear"])
@pytest.mark.parametrize("size", [0.0, 0.05, 1.5])
def test_force_and_stiffness_are_those_of_evaluation_and_assembly(kinematics, size):
    """Also where pieces are inverted, and again when the sweep has been used before."""
    virtual = cut_body(3)
    assert len(virtual.cells) % 8 != 0  # the last batch is not full
    pattern = block_pattern(virtual.cells, virtual.node_count)
    force = InternalForce(virtual, material(3, SOFT), kinematics, FAST)
    other = InternalForce(virtual, material(3, SOFT), kinematics)
    for turn in range(3):
        u, v = _moving(virtual, size, turn)
        two = _in_two(other, pattern, u, v, 0.02, 0.3)
        # a rotation is as sensitive as 1/(σ₂ + σ₃), and of inverted pieces that may be large
        _agree(_in_one(force, pattern, u, v, 0.02, 0.3), two, 1e-13 if size < 1.0 else 1e-10)
        assert np.abs(force.rotations - other.rotations).max() < (1e-13 if size < 1.0 else 1e-9)
    if size > 1.0:
        assert len(inverted_cells(force, u)) > 0


@pytest.mark.parametrize("size", [0.0, 0.05, 0.4])
def test_the_exact_stiffness_is_that_of_assembly(size):
    """With another share of what frozen rotations give, as damping wants it."""
    virtual = cut_body(3)
    pattern = block_pattern(virtual.cells, virtual.node_count)
    force = InternalForce(virtual, material(3, SOFT), kernels=FAST)
    other = InternalForce(virtual, material(3, SOFT))
    u, _ = _moving(virtual, size)
    found, wanted = np.full((2, len(pattern.columns), 3, 3), np.nan)
    for whole in (True, False):
        force.linearise(pattern, u, u, 0.0, 0.7, np.empty_like(u), found, whole, 0.3)
        wanted[:] = 0.0
        other.evaluate(u)
        other.add_stiffness(pattern, wanted, 0.4)
        other.add_stiffness(pattern, wanted, 0.3, "consistent", u)
        read = np.ones(len(wanted), dtype=bool)
        if not whole:
            row = np.repeat(np.arange(virtual.node_count), np.diff(pattern.starts))
            read = pattern.columns >= row
        assert np.abs(found - wanted)[read].max() < 1e-12 * np.abs(wanted).max()
        found[:] = np.nan


@pytest.mark.parametrize("size", [0.0, 0.05, 1.0])
def test_the_averaged_force_is_that_of_the_loop_over_pieces(size):
    """Also where pieces are inside out and take the substitute, and again from another start."""
    virtual = cut_body(3)
    pattern = block_pattern(virtual.cells, virtual.node_count)
    force = InternalForce(virtual, material(3, SOFT), kernels=FAST)
    other = InternalForce(virtual, material(3, SOFT))
    blocks = np.empty((len(pattern.columns), 3, 3))
    taken_somewhere = False
    for turn in range(3):
        start, change = _moving(virtual, size, turn)
        end = start + size * np.abs(start).max() * change
        taken, wanted_taken = np.zeros((2, len(virtual.cells)), dtype=bool)
        taken[turn] = wanted_taken[turn] = True
        found = np.empty_like(start)
        force.linearise_average(pattern, start, end, taken, 1.0, found, blocks)
        other.evaluate(start)
        F0, first = other.deformation(start).copy(), other.rotations.copy()
        other.evaluate(end)
        ends = StepEnds(F0, other.deformation(end), first, other.rotations)
        P = averaged_stress(other.elements, ends, wanted_taken)
        P *= virtual.volumes[:, None, None]
        gradients = virtual.mesh.gradients[virtual.parent]
        wanted = other.nodal_force(gradients @ P.transpose(0, 2, 1))
        assert np.array_equal(taken, wanted_taken)
        assert taken.sum() < len(taken)
        taken_somewhere |= taken.sum() > 1
        # a rotation is as sensitive as 1/(σ₂ + σ₃), and of inverted pieces that may be large
        assert (
            np.abs(found - wanted).max() <= (1e-12 if size < 1.0 else 1e-9) * np.abs(wanted).max()
        )
    assert taken_somewhere == (size == 1.0)


@pytest.mark.parametrize("body", [cut_square, cut_membrane])
def test_plane_bodies_and_membranes_give_the_same_in_two_steps(body):
    virtual = body()
    pattern = block_pattern(virtual.cells, virtual.node_count)
    force = InternalForce(virtual, isotropic(1.0, 0.3, "plane stress"), kernels=FAST)
    u, v = _moving(virtual, 0.1)
    _agree(_in_one(force, pattern, u, v, 0.1, 2.0), _in_two(force, pattern, u, v, 0.1, 2.0), 1e-15)


def test_the_sweep_follows_a_change_of_sparsity_and_leaves_couplings_of_the_mass_zero():
    virtual = cut_body(3)
    force = InternalForce(virtual, material(3, 1.0), kernels=FAST)
    u, v = _moving(virtual, 0.05)
    plain = block_pattern(virtual.cells, virtual.node_count)
    ends = np.full((1, 4), 0)
    ends[0, 0] = virtual.node_count - 1  # a coupling that no cell has
    wider = block_pattern(np.concatenate([virtual.cells, ends]), virtual.node_count)
    assert len(wider.columns) > len(plain.columns)
    for pattern in (plain, wider, consistent_mass(virtual, 1.0).pattern(virtual), plain):
        one = _in_one(force, pattern, u, v, 0.0, 1.0)
        _agree(one, _in_two(force, pattern, u, v, 0.0, 1.0))
        dense = pattern.matrix(one[1]).toarray()
        assert np.array_equal(dense, dense.T)


def test_a_translation_is_free_of_force_to_the_last_digit_that_sums_have():
    virtual = cut_body(3)
    pattern = block_pattern(virtual.cells, virtual.node_count)
    u, _ = _moving(virtual, 0.05)
    _, blocks = _in_one(
        InternalForce(virtual, material(3, 1.0), kernels=FAST), pattern, u, u, 0.0, 1.0
    )
    K = pattern.matrix(blocks).toarray()
    assert np.abs(K @ np.tile(np.eye(3), (virtual.node_count, 1))).max() < 4e-15 * np.abs(K).max()
    values = np.linalg.eigvalsh(K)
    assert values[0] > -1e-13 * values[-1]


def test_what_is_not_finite_is_seen_in_the_force():
    virtual = cut_body(3)
    pattern = block_pattern(virtual.cells, virtual.node_count)
    u, v = _moving(virtual, 0.05)
    u[3] = np.nan
    force, _ = _in_one(
        InternalForce(virtual, material(3, 1.0), kernels=FAST), pattern, u, v, 0.0, 1.0
    )
    assert np.isnan(force).any()
