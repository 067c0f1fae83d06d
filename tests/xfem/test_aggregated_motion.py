"""Aggregated cells in motion: the mass CᵀMC, what falls, turns and is cut on the way."""

import numpy as np
import pytest
from cut_bodies import DENSITY, GRAVITY, material, rotation, treated_body
from test_cell_aggregation import mesh_of, near_nodes
from test_sliver_policies import degenerate_cuts
from time_schemes import SCHEMES

import verify.xfem as xfem
from verify.methods.mass_variants import shifted_mass
from verify.xfem.block_pattern import body_pattern
from verify.xfem.body import MotionState
from verify.xfem.energy_balance import BalanceRecorder
from verify.xfem.explicit import element_critical_steps
from verify.xfem.implicit import ImplicitEuler
from verify.xfem.mass import consistent_mass
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.release import ancestors, inherit_state


def split(dim, size=1e-3):
    """Body cut through above its middle layer of nodes, with slivers of all shapes."""
    return near_nodes(dim, size)


def moving(phantom, top_held=False, policy="merge"):
    """Body with its default treatment, perhaps held at the top and under its weight."""
    last = phantom.node_points[:, -1]
    # behind the cut nodes at the top belong to the lower part
    held = top_held & (last > 1.0 - 1e-9) & (phantom.bodies == phantom.bodies[last.argmax()])
    dim = phantom.mesh.dim
    treated = treated_body(phantom, policy, held)
    v = treated.phantom
    assert (v.aggregation is not None) == (policy == "merge")
    own = held if v.aggregation is None else held[v.node_corner]
    fixed = np.repeat(own[:, None], dim, axis=1)
    weight = treated.mass.weight(-GRAVITY * np.eye(dim)[-1])
    supports = xfem.Supports(fixed, np.zeros(fixed.shape))
    return xfem.DynamicBody(treated.force, treated.mass, weight=weight, supports=supports)


@pytest.mark.parametrize("lumping", [xfem.side_wise_mass, consistent_mass, "row sum"])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_mass_of_every_part_is_its_own(dim, lumping):
    """CᵀMC moves rigid parts as M does: mass, first and second moments of each part."""
    phantom = split(dim)
    treated, _ = xfem.treat_slivers(phantom)
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


@pytest.mark.parametrize("seed", range(4))
def test_the_critical_step_is_never_below_that_of_the_smallest_element(seed):
    """Up to four cuts at random. K ≤ ω²M for every piece, hence CᵀKC ≤ ω²CᵀMC."""
    dim = 2 + seed % 2
    mesh = mesh_of(dim, 5 if dim == 2 else 3, seed // 2)
    phantom = xfem.cut_mesh(mesh, degenerate_cuts(mesh, seed))
    treated, _ = xfem.treat_slivers(phantom)
    pattern = body_pattern(treated)
    K = pattern.matrix(xfem.InternalForce(treated, material(dim), "linear").stiffness(pattern))
    mass = xfem.side_wise_mass(treated, DENSITY)
    bound = element_critical_steps(mesh, material(dim), DENSITY).min()
    assert mass.keeps_element_steps
    # eigenvalues of dense matrices to 1e-12
    assert xfem.critical_step(K, mass) >= (1.0 - 1e-9) * bound


FALLING = {
    "2D": lambda: (split(2), "merge"),
    "3D": lambda: (split(3), "merge"),
    "slivers kept": lambda: (split(2, 1e-12), "keep"),
    "along edges": lambda: (
        xfem.cut_mesh(xfem.rectangle_mesh((8, 8)), [xfem.Plane([0.5, 0.5], [0, 1])]),
        "keep",
    ),
}


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", FALLING)
def test_a_freed_half_falls_with_g_and_the_held_half_does_not_notice(name, scheme):
    """From rest, as a rigid body to round-off, by the scheme's parabola; the account closes."""
    phantom, policy = FALLING[name]()
    body = moving(phantom, True, policy)
    v, state, dim = body.force.phantom, body.rest(), phantom.mesh.dim
    free = v.bodies != v.bodies[body.fixed.any(axis=1)][0]
    h, count = 0.002, 8
    account = xfem.run(scheme(body, h), body, state, count)
    down = -GRAVITY * h * count * np.eye(dim)[-1]
    assert np.abs(state.velocity[free] - down).max() < 1e-11
    steps = count + {"ForwardEuler": -1, "SymplecticEuler": 1, "RealTimeEuler": 1}.get(
        scheme.__name__, int(scheme is ImplicitEuler)
    )
    assert np.abs(state.displacement[free] - 0.5 * h * steps * down).max() < 1e-12
    size = np.ptp(account.gravity) + account.kinetic.max()
    assert np.ptp(account.balance) <= 1e-10 * size
    body.weight[free] = 0.0
    alone = body.rest()
    xfem.run(scheme(body, h), body, alone, count)
    assert np.abs(state.displacement - alone.displacement)[~free].max() < 1e-12


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("scheme", [xfem.CentralDifferences, RealTimeEuler, xfem.EnergyMomentum])
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
    account = xfem.run(scheme(body, 0.002), body, state, 12)
    # C reproduces translations: forces inside a part sum to zero, whatever follows whatever
    assert momenta() == pytest.approx(before, abs=1e-10 * DENSITY)
    if scheme in (xfem.EnergyMomentum, xfem.CentralDifferences):
        assert np.ptp(account.angular_momentum, axis=0).max() < 1e-9 * DENSITY
    if scheme is xfem.EnergyMomentum:
        assert account.drift < 1e-10


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("held", [False, True])
def test_a_cut_midway_keeps_momenta_and_loses_what_slivers_moved_otherwise(dim, held):
    """Momenta of each part of the new body; energy by a share of the order of the slivers'."""
    new = split(dim)
    old = xfem.cut_mesh(new.mesh, [])
    waves = np.sin(3.0 * old.node_points + np.arange(dim))
    state = MotionState(0.05 * waves, 0.3 * waves[:, ::-1].copy())
    body = moving(new, top_held=held)
    v = body.force.phantom
    source = ancestors(old, new)
    still = source[v.node_corner][body.fixed[:, 0]]
    state.displacement[still] = state.velocity[still] = 0.0
    after = inherit_state(old, v, state, body)
    # nodes with an unknown stay where they are
    assert np.array_equal(after.displacement, state.displacement[source][v.node_corner])
    assert not held or (after.velocity[body.fixed] == 0.0).all()
    before = xfem.side_wise_mass(new, DENSITY).apply(state.velocity[source])
    momentum, place = body.mass.apply(after.velocity), v.node_points + after.displacement
    for part in range(new.bodies.max() + 1):
        mine, here = new.bodies == part, v.bodies == part
        if held and body.fixed[here].any():
            continue  # its supports take up momentum
        lost = momentum[here].sum(axis=0) - before[mine].sum(axis=0)
        assert np.abs(lost).max() < 1e-11 * DENSITY
        # about the same places: Σ x ∧ p as antisymmetric part of Σ x pᵀ
        turn = place[here].T @ momentum[here] - v.extend(place)[mine].T @ before[mine]
        assert np.abs(turn - turn.T).max() < 1e-11 * DENSITY
    kinetic = 0.5 * np.sum(state.velocity[source] * before)
    strain = treated_body(new, "keep").force.evaluate(state.displacement[source])[1]
    rows = BalanceRecorder(body, after).close()
    assert rows.kinetic[0] <= kinetic * (1.0 + 1e-12) or held
    assert (rows.kinetic[0], rows.strain[0]) == pytest.approx((kinetic, strain), rel=0.02)
