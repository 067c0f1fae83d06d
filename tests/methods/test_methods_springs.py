"""Mass–spring: what springs can be fitted to, and what not."""

import numpy as np
import pytest

from verify.methods import cut_by
from verify.methods.springs import SpringForce, spring_stiffness
from verify.xfem.block_pattern import block_pattern
from verify.xfem.cuts import Polyline
from verify.xfem.element import Material, isotropic
from verify.xfem.mesh import SimplexMesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh


def sheet_of_equilateral_triangles(edge=0.2):
    """A sheet sheared into a rhombus, with 60° between its sides."""
    square = rectangle_mesh((6, 6), diagonal="left")
    points = 6 * edge * square.points @ np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
    return SimplexMesh(points, square.cells)


@pytest.mark.parametrize("fit", ["fitted", "van_gelder"])
def test_equilateral_triangles_have_the_springs_of_lloyd_and_of_van_gelder(fit):
    mesh = SimplexMesh([[0, 0], [3, 0], [1.5, 3 * np.sqrt(0.75)]], [[0, 1, 2]])
    found, clamped = spring_stiffness(mesh, isotropic(7.0, 1 / 3, "plane stress"), fit)
    assert found[0] == pytest.approx(7.0 * np.sqrt(3) / 4, rel=1e-13)
    assert not clamped.any()


def test_a_regular_tetrahedron_has_the_springs_of_lloyd():
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.4
    edge = 0.4 * np.sqrt(8)
    found, _ = spring_stiffness(SimplexMesh(corners, [[0, 1, 2, 3]]), isotropic(7.0, 0.25, "solid"))
    assert found[0] == pytest.approx(2 * np.sqrt(2) / 25 * 7.0 * edge, rel=1e-13)


@pytest.mark.parametrize("state, poisson", [("plane stress", 1 / 3), ("plane strain", 0.25)])
def test_a_sheet_of_equilateral_triangles_is_exact_at_the_one_ratio_that_springs_have(
    state, poisson
):
    mesh = sheet_of_equilateral_triangles()
    young = 5.0
    force = SpringForce(cut_mesh(mesh, []), isotropic(young, poisson, state), "linear")
    modulus = young if state == "plane stress" else young / (1 - poisson**2)
    sideways = poisson if state == "plane stress" else poisson / (1 - poisson)
    strain = 1e-3
    u = strain * mesh.points * np.array([1.0, -sideways])
    forces, energy = force.evaluate(u)
    area = mesh.measures.sum()
    assert energy == pytest.approx(0.5 * modulus * strain**2 * area, rel=1e-12)
    boundary = np.unique(
        np.concatenate([np.delete(mesh.cells[c], k) for c, k in mesh.boundary_facets])
    )
    inner = np.setdiff1d(np.arange(len(mesh.points)), boundary)
    top = np.flatnonzero(mesh.points[:, 1] > mesh.points[:, 1].max() - 1e-9)
    # homogeneous and stress-free sideways: nothing acts inside, nothing on the free top
    scale = np.abs(forces).max()
    assert np.abs(forces[inner]).max() < 1e-12 * scale
    assert np.abs(forces[top[1:-1], 1]).max() < 1e-12 * scale


@pytest.mark.parametrize(("dim", "kinematics"), [(2, "corotational"), (3, "linear")])
def test_force_and_stiffness_are_derivatives_of_the_energy(dim, kinematics):
    rng = np.random.default_rng(4)
    mesh = SimplexMesh(rng.normal(size=(dim + 1, dim)), [list(range(dim + 1))])
    force = SpringForce(cut_mesh(mesh, []), Material(np.array(0.4), np.array(0.7)), kinematics)
    u, step = 0.3 * rng.normal(size=mesh.points.shape), 1e-6
    found, _ = force.evaluate(u)
    pattern = block_pattern(mesh.cells, len(mesh.points))
    K = pattern.matrix(force.stiffness(pattern, u)).toarray()
    gradient, columns = np.zeros(u.shape), []
    for place in np.ndindex(u.shape):
        up, down = u.copy(), u.copy()
        up[place] += step
        down[place] -= step
        (f_up, e_up), (f_down, e_down) = force.evaluate(up), force.evaluate(down)
        gradient[place] = (e_up - e_down) / (2 * step)
        columns.append(((f_up - f_down) / (2 * step)).ravel())
    # central differences of step 1e-6: 1e-12 of truncation, 1e-10 of round-off
    assert np.abs(gradient - found).max() < 1e-8
    assert np.abs(np.array(columns).T - K).max() < 1e-8


def test_springs_of_a_body_that_turns_and_opens_rigidly_bear_nothing():
    mesh = rectangle_mesh((5, 5))
    body = cut_by("snapping", mesh, [Polyline([[-1.0, 0.31], [2.0, 0.55]])])
    phantom = body.phantom
    angle = np.where(phantom.bodies == phantom.bodies[0], 0.0, 2.1)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    u = np.einsum("ijn,nj->ni", turn, phantom.node_points) - phantom.node_points
    force = SpringForce(phantom, isotropic(1e4, 0.3, "plane strain"))
    forces, energy = force.evaluate(u)
    assert energy < 1e-20 * 1e4
    assert np.abs(forces).max() < 1e-12 * 1e4
