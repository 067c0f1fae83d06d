"""A ghost penalty with its mass in motion, and the choice of a sliver policy for what moves."""

import numpy as np
import pytest
from cut_bodies import DENSITY, GRAVITY, cut_body, cut_membrane, material, penalised
from swings import aggregated, let_go, rest_step, stretched
from time_schemes import SCHEMES

import verify.xfem as xfem
from verify.xfem.block_pattern import block_pattern
from verify.xfem.explicit import RESONANCE_FREE, ForwardEuler
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import inverted_cells


def sliver(dim, size):
    mesh = xfem.rectangle_mesh((8, 8)) if dim == 2 else xfem.box_mesh((3, 3, 4))
    up = np.eye(dim)[-1]
    return xfem.cut_mesh(
        mesh, [xfem.Plane(np.full(dim, 0.5) + size / (8 if dim == 2 else 4) * up, up)]
    )


@pytest.mark.parametrize("scheme", [s for s in SCHEMES if s is not ForwardEuler])
def test_every_scheme_closes_its_account_with_a_penalty_and_its_mass(scheme):
    treated = penalised(cut_body(3))
    v, mass = treated.phantom, treated.mass
    assert mass.diagonal is None
    body = xfem.DynamicBody(
        treated.force,
        mass,
        weight=mass.weight([0.0, 0.0, -GRAVITY]),
        supports=xfem.Supports.none(v).prescribe(v, v.mesh.points[:, -1] == 0.0),
    )
    state = body.rest()
    state.velocity[:] = 0.1 * np.random.default_rng(0).normal(size=body.shape)
    state.velocity[body.fixed] = 0.0
    account = xfem.run(scheme(body, 0.004), body, state, 20)
    size = np.ptp(account.gravity) + account.kinetic.max()
    assert account.penalty.max() > 1e-4 * size
    assert np.ptp(account.balance) <= 1e-10 * size
    if scheme is xfem.EnergyMomentum:
        assert account.drift <= 1e-10


def test_the_penalty_of_a_kink_is_that_of_its_definition():
    """u = e max(x − ½, 0) bends across one facet, on both sides of the cut: γ (λ + 2μ) h A e²."""
    mesh = xfem.rectangle_mesh((4, 4))
    x, y = mesh.points.T
    mesh = xfem.SimplexMesh(np.column_stack([np.where(x > 0.5, 2.0 * x - 0.5, x), y]), mesh.cells)
    v = xfem.cut_mesh(mesh, [xfem.Plane([0.5, 0.6], [0.0, 1.0])])
    bent = 0.01 * np.maximum(v.node_points - 0.5, 0.0) * [1.0, 0.0]
    modulus, height = 1e4 * 0.7 / (1.3 * 0.4), 0.5 * (0.25 + 0.5)
    energy = 0.5 * np.vdot(bent, GhostPenalty(v, material(2), 0.1).matrix @ bent)
    assert energy == pytest.approx(0.1 * modulus * height * 0.25 * 0.01**2, rel=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_penalty_does_not_tie_halves_together_however_small_the_sliver(dim):
    """Each strained in its own way costs nothing; also where the cut runs along faces of elements,
    which then have one piece each.
    """
    strain = 0.1 * np.arange(1.0, 1.0 + dim**2).reshape(dim, dim)
    for size in (1e-3, 1e-12, 0.0):
        v = sliver(dim, size)
        parted = (v.node_side > 0) * (v.node_points @ strain + 1.0)
        force = GhostPenalty(v, material(dim), 0.1).matrix @ parted
        # round-off of λ + 2μ over elements of size one
        assert np.abs(force).max() < 1e-10
        assert abs(np.vdot(force, parted)) < 2e-10


def test_slivers_stay_upright_with_a_penalty_or_aggregated_and_not_without():
    """A plate at 15 % nominal strain, 0.9 of the resonance-free step."""
    v = xfem.cut_mesh(xfem.rectangle_mesh((8, 8)), [xfem.Plane([0.5, 0.5 + 1e-3 / 8], [0.0, 1.0])])
    share = 0.9 * RESONANCE_FREE
    assert let_go(v, share, 1_000)[1] > 0
    assert let_go(aggregated(v)[0], share, 1_000)[1] == 0
    treated = penalised(v)
    held = xfem.Supports.none(v).prescribe(v, v.mesh.points[:, 0] < 1e-9)
    body = xfem.DynamicBody(treated.force, treated.mass, supports=held)
    step = rest_step(v, xfem.side_wise_mass(v, DENSITY), material(2))
    state = body.rest()
    state.displacement[:] = stretched(v.node_points)
    scheme = xfem.CentralDifferences(body, share * step)
    for _ in range(100):
        for _ in range(10):
            scheme.step(state)
        assert len(inverted_cells(body.force, state.displacement)) == 0


def test_factors_that_are_none_and_penalties_of_other_bodies_are_refused():
    v = cut_body(2)
    with pytest.raises(xfem.XfemError, match="positive"):
        GhostPenalty(v, material(2), 0.0)
    with pytest.raises(xfem.XfemError, match="another body"):
        xfem.InternalForce(v, material(2), ghost=GhostPenalty(cut_body(2), material(2)))
    with pytest.raises(xfem.XfemError, match="membrane"):
        GhostPenalty(cut_membrane(), material(2))
    ghost = GhostPenalty(v, material(2))
    pattern = block_pattern(v.cells, v.node_count)
    with pytest.raises(xfem.XfemError, match="lacks couplings"):
        ghost.add_stiffness(pattern, np.zeros((len(pattern.columns), 2, 2)))
