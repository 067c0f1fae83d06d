"""Aggregated cells in motion: the mass CᵀMC, what falls, turns and is cut on the way."""

import numpy as np
import pytest
from cut_bodies import DENSITY, GRAVITY, material, rotation, treated_body
from test_cell_aggregation import mesh_of, near_nodes
from test_sliver_policies import degenerate_cuts
from time_schemes import SCHEMES

from verify.methods.mass_variants import shifted_mass
from verify.xfem.block_pattern import body_pattern
from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.energy_balance import BalanceRecorder, run
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import (
    CentralDifferences,
    ForwardEuler,
    critical_step,
    element_critical_steps,
)
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import consistent_mass, side_wise_mass
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.release import ancestors, inherit_state
from verify.xfem.slivers import treat_slivers


def moving(phantom, top_held=False):
    """Body with its default treatment, perhaps held at the top and under its weight."""
    last = phantom.node_points[:, -1]
    # behind the cut nodes at the top belong to the lower part
    held = top_held & (last > 1.0 - 1e-9) & (phantom.bodies == phantom.bodies[last.argmax()])
    dim = phantom.mesh.dim
    treated = treated_body(phantom, held=held)
    v = treated.phantom
    assert v.aggregation is not None
    fixed = np.repeat(held[v.node_corner][:, None], dim, axis=1)
    weight = treated.mass.weight(-GRAVITY * np.eye(dim)[-1])
    supports = Supports(fixed, np.zeros(fixed.shape))
    return DynamicBody(treated.force, treated.mass, weight=weight, supports=supports)


def split(dim, size=1e-3):
    """Body cut through above its middle layer of nodes, with slivers of all shapes."""
    return near_nodes(dim, size)


@pytest.mark.parametrize("lumping", [side_wise_mass, consistent_mass, "row sum"])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_mass_of_every_part_is_its_own(dim, lumping):
    """CᵀMC moves rigid parts as M does: mass, first and second moments of each part."""
    phantom = split(dim)
    treated, _ = treat_slivers(phantom)
    found, want = (
        shifted_mass(v, DENSITY, lumping) if lumping == "row sum" else lumping(v, DENSITY)
        for v in (treated, phantom)
    )
    for part in range(phantom.bodies.max() + 1):
        fields = []
        for v in (treated, phantom):
            here = (v.bodies == part)[:, None]
            fields.append(here * np.column_stack([np.ones(v.node_count), v.node_points]))
        moments = [f.T @ m.apply(f) for f, m in zip(fields, (found, want), strict=True)]
        assert moments[0] == pytest.approx(moments[1], abs=1e-12 * DENSITY)
        pulled = [f.T @ m.weights for f, m in zip(fields, (found, want), strict=True)]
        assert pulled[0] == pytest.approx(pulled[1], abs=1e-12 * DENSITY)


@pytest.mark.parametrize("seed", range(10))
def test_the_critical_step_is_never_below_that_of_the_smallest_element(seed):
    """Up to four cuts at random. K ≤ ω²M for every piece, hence CᵀKC ≤ ω²CᵀMC."""
    dim = 2 + seed % 2
    mesh = mesh_of(dim, 5 if dim == 2 else 3, seed // 2)
    phantom = cut_mesh(mesh, degenerate_cuts(mesh, seed))
    treated, _ = treat_slivers(phantom)
    pattern = body_pattern(treated)
    K = pattern.matrix(InternalForce(treated, material(dim), "linear").stiffness(pattern))
    mass = side_wise_mass(treated, DENSITY)
    bound = element_critical_steps(mesh, material(dim), DENSITY).min()
    assert mass.keeps_element_steps
    # eigenvalues of dense matrices to 1e-12
    assert critical_step(K, mass) >= (1.0 - 1e-9) * bound


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("dim", [2, 3])
def test_a_freed_half_falls_with_g_and_the_account_closes(dim, scheme):
    """The upper half is held, the lower one falls from rest: to round-off as a rigid body."""
    body = moving(split(dim), top_held=True)
    v, state = body.force.phantom, body.rest()
    free = v.bodies != v.bodies[body.fixed.any(axis=1)][0]
    h, count = 0.002, 20
    account = run(scheme(body, h), body, state, count)
    assert state.velocity[free] == pytest.approx(
        np.broadcast_to(-GRAVITY * h * count * np.eye(dim)[-1], (free.sum(), dim)), abs=1e-11
    )
    fallen = {"SymplecticEuler": count + 1, "ForwardEuler": count - 1}
    steps = fallen.get(scheme.__name__, count)
    if scheme in (RealTimeEuler,) or scheme.__name__ == "ImplicitEuler":
        steps = count + 1
    assert state.displacement[free, -1] == pytest.approx(
        -0.5 * GRAVITY * h**2 * count * steps, rel=1e-10
    )
    size = np.ptp(account.gravity) + account.kinetic.max()
    assert np.ptp(account.balance) <= 1e-10 * size


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("scheme", [s for s in SCHEMES if s is not ForwardEuler])
def test_a_free_body_keeps_its_momenta_part_by_part(dim, scheme):
    """Turning and deforming at random; central differences keep the angular momentum, too."""
    body = moving(split(dim))
    body.weight = np.zeros(body.shape)
    v, state = body.force.phantom, body.rest()
    random = np.random.default_rng(0)
    state.velocity[:] = 0.1 * random.normal(size=body.shape)
    state.velocity += v.node_points @ (rotation(dim, 0.5) - np.eye(dim)).T

    def momenta():
        momentum = body.mass.apply(state.velocity)
        parts = [v.bodies == k for k in range(v.bodies.max() + 1)]
        return np.array([momentum[part].sum(axis=0) for part in parts])

    before = momenta()
    account = run(scheme(body, 0.002), body, state, 30)
    # C reproduces translations: forces inside a part sum to zero, whatever follows whatever
    assert momenta() == pytest.approx(before, abs=1e-10 * DENSITY)
    if scheme in (EnergyMomentum, CentralDifferences):
        assert np.ptp(account.angular_momentum, axis=0).max() < 1e-9 * DENSITY
    if scheme is EnergyMomentum:
        assert account.drift < 1e-10


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("held", [False, True])
def test_a_cut_midway_keeps_momenta_and_loses_what_slivers_moved_otherwise(dim, held):
    """Momenta of each part of the new body; energy by a share of the order of the slivers'."""
    new = split(dim)
    old = cut_mesh(new.mesh, [])
    random = np.random.default_rng(1)
    waves = np.sin(3.0 * old.node_points + random.uniform(0.0, 3.0, dim))
    state = MotionState(0.05 * waves, 0.3 * waves[:, ::-1].copy())
    body = moving(new, top_held=held)
    v = body.force.phantom
    source = ancestors(old, new)
    still = source[v.node_corner][body.fixed[:, 0]]
    state.displacement[still] = state.velocity[still] = 0.0
    after = inherit_state(old, v, state, body)
    assert np.array_equal(ancestors(old, v), source)
    # nodes with an unknown stay where they are
    assert np.array_equal(after.displacement, state.displacement[source][v.node_corner])
    assert not held or (after.velocity[body.fixed] == 0.0).all()
    corner_mass = side_wise_mass(new, DENSITY)
    before = corner_mass.apply(state.velocity[source])
    momentum = body.mass.apply(after.velocity)
    place = v.extend(v.node_points + after.displacement)
    for part in range(new.bodies.max() + 1):
        if held and body.fixed[v.bodies == part].any():
            continue  # its supports take up momentum
        mine, here = new.bodies == part, v.bodies == part
        assert momentum[here].sum(axis=0) == pytest.approx(
            before[mine].sum(axis=0), abs=1e-11 * DENSITY
        )
        # about the same places: Σ x ∧ p as antisymmetric part of Σ x pᵀ
        first = place[mine].T @ before[mine]
        second = (v.node_points + after.displacement)[here].T @ momentum[here]
        assert second - second.T == pytest.approx(first - first.T, abs=1e-11 * DENSITY)
    kinetic = 0.5 * np.sum(state.velocity[source] * before)
    strain = treated_body(new, "keep").force.evaluate(state.displacement[source])[1]
    rows = BalanceRecorder(body, after).close()
    assert rows.kinetic[0] <= kinetic * (1.0 + 1e-12) or held
    assert rows.kinetic[0] == pytest.approx(kinetic, rel=0.02)
    assert rows.strain[0] == pytest.approx(strain, rel=0.02)
