"""A ghost penalty with its mass in motion, and the choice of a sliver policy for what moves."""

import numpy as np
import pytest
from cut_bodies import DENSITY, GRAVITY, cut_body, cut_membrane, material, penalised, rotation
from swings import let_go, rest_step, stretched

from verify.xfem.arrays import XfemError
from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane
from verify.xfem.energy_balance import run
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import RESONANCE_FREE, CentralDifferences, SymplecticEuler
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.internal_force import InternalForce, inverted_cells
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler

SCHEMES = [
    CentralDifferences,
    SymplecticEuler,
    RealTimeEuler,
    ImplicitEuler,
    Trapezoidal,
    EnergyMomentum,
]


def sliver(dim, size):
    mesh = rectangle_mesh((8, 8)) if dim == 2 else box_mesh((3, 3, 4))
    up = np.eye(dim)[-1]
    return cut_mesh(mesh, [Plane(np.full(dim, 0.5) + size / (8 if dim == 2 else 4) * up, up)])


@pytest.mark.parametrize("kinematics", ["corotational", "linear"])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_penalised_stiffness_is_the_derivative_of_force_and_energy(dim, kinematics):
    v, stuff = cut_body(dim), material(dim)
    force = InternalForce(v, stuff, kinematics, ghost=GhostPenalty(v, stuff, 0.1))
    random = np.random.default_rng(0)
    u, w = 0.03 * random.normal(size=(2, v.node_count, dim))
    pattern = side_wise_mass(v, 1.0).pattern(v, force.ghost.couplings)
    K = pattern.matrix(force.stiffness(pattern, u))
    h = 1e-6
    (plus, above), (minus, below) = (force.evaluate(u + s * h * w) for s in (1.0, -1.0))
    at = force.evaluate(u)[0]
    assert force.penalty_energy(u) > 0.0
    # central differences: h² of third derivatives, and round-off/h
    assert (above - below) / (2 * h) == pytest.approx(np.sum(at * w), rel=1e-7)
    change = ((plus - minus) / (2 * h)).ravel()
    assert np.abs(K @ w.ravel() - change).max() < 1e-7 * np.abs(change).max()


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_every_scheme_closes_its_account_with_a_penalty_and_its_mass(scheme, dim):
    treated = penalised(cut_body(dim))
    v, mass = treated.phantom, treated.mass
    assert mass.diagonal is None
    body = DynamicBody(
        treated.force,
        mass,
        weight=mass.weight(-GRAVITY * np.eye(dim)[-1]),
        supports=Supports.none(v).prescribe(v, v.mesh.points[:, -1] == 0.0),
    )
    state = body.rest()
    state.velocity[:] = 0.1 * np.random.default_rng(0).normal(size=body.shape)
    state.velocity[body.fixed] = 0.0
    account = run(scheme(body, 0.004), body, state, 40)
    size = np.ptp(account.gravity) + account.kinetic.max()
    assert account.penalty.max() > 1e-4 * size
    assert np.ptp(account.balance) <= 1e-10 * size
    if scheme is EnergyMomentum:
        assert account.drift <= 1e-10


@pytest.mark.parametrize("dim", [2, 3])
def test_a_turning_body_does_not_feel_the_penalty(dim):
    v = cut_body(dim)
    force = penalised(v).force
    turned = v.node_points @ (rotation(dim, 1.0) - np.eye(dim)).T + 0.3
    force_, energy = force.evaluate(turned)
    # round-off of λ + 2μ over elements of size one
    assert np.abs(force_).max() < 1e-10
    assert energy < 1e-12


def test_the_penalty_of_a_kink_is_that_of_its_definition():
    """u = e max(x − ½, 0) bends across one facet, on both sides of the cut: γ (λ + 2μ) h A e²."""
    mesh = rectangle_mesh((4, 4))
    x, y = mesh.points.T
    mesh = SimplexMesh(np.column_stack([np.where(x > 0.5, 2.0 * x - 0.5, x), y]), mesh.cells)
    v = cut_mesh(mesh, [Plane([0.5, 0.6], [0.0, 1.0])])
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


def test_slivers_with_a_penalty_stay_upright_at_nine_tenths_of_the_resonance_free_step():
    """A plate at 15 % nominal strain: inverts with nothing done, and not with the penalty."""
    v = cut_mesh(rectangle_mesh((8, 8)), [Plane([0.5, 0.5 + 1e-3 / 8], [0.0, 1.0])])
    assert let_go(v, 0.9 * RESONANCE_FREE, 1_000)[1] > 0
    treated = penalised(v)
    body = DynamicBody(
        treated.force,
        treated.mass,
        supports=Supports.none(v).prescribe(v, v.mesh.points[:, 0] < 1e-9),
    )
    step = rest_step(v, side_wise_mass(v, DENSITY), material(2))
    state = body.rest()
    state.displacement[:] = stretched(v.node_points)
    scheme, inverted = CentralDifferences(body, 0.9 * RESONANCE_FREE * step), 0
    for number in range(1_000):
        scheme.step(state)
        if number % 10 == 0:
            inverted += len(inverted_cells(body.force, state.displacement)) > 0
    assert inverted == 0


def test_factors_that_are_none_and_penalties_of_other_bodies_are_refused():
    v = cut_body(2)
    with pytest.raises(XfemError, match="positive"):
        GhostPenalty(v, material(2), 0.0)
    with pytest.raises(XfemError, match="another body"):
        InternalForce(v, material(2), ghost=GhostPenalty(cut_body(2), material(2)))
    with pytest.raises(XfemError, match="membrane"):
        GhostPenalty(cut_membrane(), material(2))
    ghost = GhostPenalty(v, material(2))
    pattern = block_pattern(v.cells, v.node_count)
    with pytest.raises(XfemError, match="lacks couplings"):
        ghost.add_stiffness(pattern, np.zeros((len(pattern.columns), 2, 2)))
