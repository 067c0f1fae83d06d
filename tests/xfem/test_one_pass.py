"""One pass over tetrahedra gives what evaluation and assembly give one after the other."""

import numpy as np
import pytest
from cut_bodies import SOFT, cut_body, material

from verify.accelerated import FAST
from verify.xfem.block_pattern import block_pattern
from verify.xfem.internal_force import InternalForce, inverted_cells


def _moving(phantom, size, seed=4):
    rng = np.random.default_rng(seed)
    shape = phantom.node_points.shape
    edge = phantom.mesh.measures.min() ** (1.0 / phantom.mesh.dim)
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
    phantom = cut_body(3)
    assert len(phantom.cells) % 8 != 0  # the last batch is not full
    pattern = block_pattern(phantom.cells, phantom.node_count)
    force = InternalForce(phantom, material(3, SOFT), kinematics, FAST)
    other = InternalForce(phantom, material(3, SOFT), kinematics)
    for turn in range(3):
        u, v = _moving(phantom, size, turn)
        two = _in_two(other, pattern, u, v, 0.02, 0.3)
        # a rotation is as sensitive as 1/(σ₂ + σ₃), and of inverted pieces that may be large
        _agree(_in_one(force, pattern, u, v, 0.02, 0.3), two, 1e-13 if size < 1.0 else 1e-10)
        assert np.abs(force.rotations - other.rotations).max() < (1e-13 if size < 1.0 else 1e-9)
    if size > 1.0:
        assert len(inverted_cells(force, u)) > 0


@pytest.mark.parametrize("size", [0.0, 0.05, 0.4])
def test_the_exact_stiffness_is_that_of_assembly(size):
    """With another share of what frozen rotations give, as damping wants it."""
    phantom = cut_body(3)
    pattern = block_pattern(phantom.cells, phantom.node_count)
    force = InternalForce(phantom, material(3, SOFT), kernels=FAST)
    other = InternalForce(phantom, material(3, SOFT))
    u, _ = _moving(phantom, size)
    found, wanted = np.full((2, len(pattern.columns), 3, 3), np.nan)
    for whole in (True, False):
        force.linearise(pattern, u, u, 0.0, 0.7, np.empty_like(u), found, whole, 0.3)
        wanted[:] = 0.0
        other.evaluate(u)
        other.add_stiffness(pattern, wanted, 0.4)
        other.add_stiffness(pattern, wanted, 0.3, "consistent", u)
        read = np.ones(len(wanted), dtype=bool)
        if not whole:
            row = np.repeat(np.arange(phantom.node_count), np.diff(pattern.starts))
            read = pattern.columns >= row
        assert np.abs(found - wanted)[read].max() < 1e-12 * np.abs(wanted).max()
        found[:] = np.nan
