"""Explicit steps of corotational motion: what bounds them, and what the time grid does to them."""

from itertools import product

import numpy as np
import pytest
from cut_bodies import DENSITY, isotropic, material, rotation
from swings import aggregated, cube, let_go, plate, uniform

import verify.xfem as xfem
from verify.accelerated import FAST
from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import StepFailedError
from verify.xfem.explicit import RESONANCE_FREE, element_critical_steps
from verify.xfem.implicit import Trapezoidal
from verify.xfem.mass import consistent_mass, side_wise_mass
from verify.xfem.subdivision import subdivide
from verify.xfem.turning_faces import TurningFaces


def deformed(random, mesh, strain):
    """A linear field: stretches up to 1 + strain, one of them that, then any rotation."""
    space, dim = mesh.space, mesh.dim
    stretch = 1.0 + strain * random.uniform(-0.9, 1.0, size=space)
    stretch[random.integers(dim)] = 1.0 + strain
    if random.uniform() < 0.3:
        stretch[:] = 1.0 + strain
    axes, _ = np.linalg.qr(random.normal(size=(space, space)))
    if dim < space:  # stretches are those in the plane
        axes[:, :2], _ = np.linalg.qr(mesh.edge_vectors[0].T)
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    F = rotation(space, random.uniform(0.0, 6.0)) @ axes @ np.diag(stretch) @ axes.T
    return mesh.points @ (F - np.eye(space)).T


@pytest.mark.parametrize(
    ("dim", "space", "state"), [(2, 2, "plane strain"), (3, 3, "solid"), (2, 3, "plane stress")]
)
def test_no_stretch_in_reach_and_no_rotation_makes_the_exact_step_of_an_element_smaller(
    dim, space, state
):
    random = np.random.default_rng(5)
    for strain, poisson in product((0.15, 1.0, 2.0), (0.0, 0.49)):
        stuff = isotropic(1e4, poisson, state)
        for _ in range(8):
            mesh = xfem.SimplexMesh(random.normal(size=(dim + 1, space)), [range(dim + 1)])
            phantom = xfem.cut_mesh(mesh, [])
            force = xfem.InternalForce(phantom, stuff)
            pattern = block_pattern(phantom.cells, phantom.node_count)
            K = pattern.matrix(force.stiffness(pattern, deformed(random, mesh, strain)))
            exact = xfem.critical_step(K, xfem.side_wise_mass(phantom, DENSITY))
            bound = element_critical_steps(mesh, stuff, DENSITY, strain)[0]
            assert exact >= (1.0 - 1e-9) * bound


def growth(phantom, turn, steps=2000):
    """Largest energy over that of the start, from the highest mode at 5 % strain, with ωh given."""
    force, mass = xfem.InternalForce(phantom, material(3)), xfem.side_wise_mass(phantom, DENSITY)
    body = xfem.DynamicBody(force, mass)
    K = body.pattern.matrix(force.stiffness(body.pattern, np.zeros(body.shape))).toarray()
    root = np.repeat(np.sqrt(mass.diagonal), 3)
    values, vectors = np.linalg.eigh(K / np.outer(root, root))
    mode = (vectors[:, -1] / root).reshape(body.shape)
    slopes = np.einsum("pik,pil->pkl", mode[phantom.cells], phantom.mesh.gradients[phantom.parent])
    state = body.rest()
    state.displacement[:] = 0.05 / np.linalg.norm(slopes, ord=2, axis=(1, 2)).max() * mode
    start, largest = force.evaluate(state.displacement)[1], 0.0
    scheme = xfem.CentralDifferences(body, turn / np.sqrt(values[-1]))
    for step in range(steps):
        try:
            scheme.step(state)
        except StepFailedError:
            return np.inf
        if step % 7 == 0:
            kinetic = 0.5 * (mass.apply(state.velocity) * state.velocity).sum()
            largest = max(largest, (force.evaluate(state.displacement)[1] + kinetic) / start)
        if largest > 100.0:
            break
    return largest


def test_an_uncut_cube_blows_up_where_three_turns_of_its_fastest_mode_are_a_full_one():
    """ωh = √3, .87 of the linear critical step; a little below, and at √2, nothing happens."""
    phantom = xfem.cut_mesh(xfem.box_mesh((2, 2, 2)), [])
    assert growth(phantom, np.sqrt(3.0)) > 100.0
    assert growth(phantom, 0.97 * np.sqrt(3.0)) < 1.01
    assert growth(phantom, np.sqrt(2.0)) < 1.01


def test_an_uncut_cube_let_go_from_a_uniform_stretch_needs_the_smaller_step_too():
    """15 % strain: at .9 of the linear step it blows up, at .9 of the resonance-free one not."""
    phantom = xfem.cut_mesh(xfem.box_mesh((3, 3, 3)), [])
    assert let_go(phantom, 0.9, 2_000, start=uniform)[0] > 10.0
    largest, inverted = let_go(phantom, 0.9 * RESONANCE_FREE, 2_000, start=uniform)
    assert inverted == 0
    assert largest < 1.01


@pytest.mark.parametrize(
    ("make", "seed", "steps"),
    [
        (plate, 0, 2_000),
        (cube, 0, 2_000),
        *(
            pytest.param(make, seed, 10_000, marks=pytest.mark.heavy)
            for make in (plate, cube)
            for seed in (0, 1, 2)
        ),
    ],
)
def test_nine_tenths_of_the_resonance_free_step_neither_inverts_nor_blows_up(make, seed, steps):
    """15 % nominal strain; cuts askew, default sliver policy. The scheme's energy oscillates."""
    cut = make(seed)
    treated, report = aggregated(cut)
    assert report.aggregated > 0
    assert treated.bodies.max() == cut.bodies.max()
    largest, inverted = let_go(treated, 0.9 * RESONANCE_FREE, steps)
    assert inverted == 0
    assert largest < 1.01


def test_slivers_that_ring_cost_few_corrections_more_with_a_consistent_mass():
    """A stretched strip with a cut through it recoils: the lumped mass lets no sliver ring.

    Both solve the same steps; what a sliver without mass does from step to step must not be what a
    step begins with. A quarter more is left for the waves that only the consistent mass carries.
    """
    mesh = xfem.rectangle_mesh((9, 28), (0.0, 0.0), (0.1, 0.3))
    phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.05, 0.1], np.array([-0.3, 1.0]) / 1.09**0.5)])
    force = xfem.InternalForce(phantom, xfem.isotropic(2e4, 0.3, "plane strain"))
    solves = []
    for mass_of in (side_wise_mass, consistent_mass):
        body = xfem.DynamicBody(force, mass_of(phantom, DENSITY))
        state, x = body.rest(), phantom.node_points - [0.05, 0.15]
        state.displacement[:] = x * [-0.05, 0.15]
        state.velocity[:] = x[:, ::-1] * [-1.0, 1.0]
        scheme = Trapezoidal(body, 0.005)
        for _ in range(40):
            scheme.step(state)
        solves.append(scheme.solves)
    assert solves[1] <= 1.25 * solves[0]


class Counted(Trapezoidal):
    """Counts its matrices."""

    matrices = 0

    def _assemble(self, end, kind):
        self.matrices += 1
        super()._assemble(end, kind)


class Anew(Counted):
    """Makes and factorises its matrix for every correction."""

    _again = property(lambda self: False, lambda self, value: None)


@pytest.mark.parametrize("contact", [False, True])
@pytest.mark.parametrize("dim, fraction", [(2, 0.3), (2, 1e-6), (3, 1e-3)])
def test_a_matrix_that_is_kept_leads_to_the_same_ends_of_steps(dim, fraction, contact):
    """A body that turns by a radian, cut beside a node; with contact its halves are pressed."""
    mesh = xfem.rectangle_mesh((5, 4)) if dim == 2 else xfem.box_mesh((3, 2, 2))
    node = mesh.points[np.argmin(np.linalg.norm(mesh.points - 0.5, axis=1))]
    cut = xfem.Plane(node + fraction * np.eye(dim)[-1] / 4.0, [0.1, 0.0, 1.0][-dim:])
    v = xfem.cut_mesh(mesh, [cut])
    force, found = xfem.InternalForce(v, material(dim)), []
    faces = TurningFaces(v, material(dim)) if contact else None
    body = xfem.DynamicBody(force, consistent_mass(v, DENSITY), contact=faces)
    schemes = Counted(body, 0.0025), Anew(body, 0.0025)
    for scheme in schemes:
        state, x = body.rest(), v.node_points - 0.5
        state.velocity[:] = x @ (4.0 * rotation(dim, np.pi / 2) - 0.1 * np.eye(dim))
        for _ in range(100):
            scheme.step(state)
        found.append(subdivide(v).interpolation @ state.displacement)
    assert np.abs(found[0] - found[1]).max() < 1e-8 * np.abs(found[1]).max()  # 100 of 1e-10
    assert schemes[1].matrices == schemes[1].solves
    assert contact or schemes[0].matrices < schemes[0].solves


def test_a_linear_body_takes_one_correction_a_step_whatever_its_linear_solver():
    """Its forces are linear: conjugate gradients go on until the step is solved."""
    v = xfem.cut_mesh(
        xfem.rectangle_mesh((12, 12)), [xfem.Plane([0.4, 0.52], [0.2, 1.0])], "inside"
    )
    force = xfem.InternalForce(v, material(2), "linear", FAST)
    body = xfem.DynamicBody(force, consistent_mass(v, DENSITY))
    state = body.rest()
    state.velocity[:] = np.sin(3.0 * v.node_points[:, ::-1])
    for step in (1e-3, 3e-3, 1e-2):  # a scheme anew iterates
        scheme = Trapezoidal(body, step)
        for _ in range(3):
            scheme.step(state)
        assert scheme.solves == 3
