"""Loads add up, whatever the cut; supports and inputs that make no sense are refused."""

from itertools import product
from math import factorial, prod

import numpy as np
import pytest

import verify.xfem as xfem
from verify.xfem.loads_and_supports import UnsupportedBodyError, simplex_rule

LINE = xfem.Polyline([[-1.0, 0.1], [2.0, 1.1]])
PLATE = xfem.cut_mesh(xfem.rectangle_mesh((5, 5)), [LINE])
BLOCK = xfem.cut_mesh(xfem.box_mesh((3, 3, 3)), [xfem.Plane([0.5, 0.5, 0.5], [-1.0, -2.0, 3.0])])
STRAIN = xfem.isotropic(1.0, 0.3, "plane strain")


@pytest.mark.parametrize("phantom", [PLATE, BLOCK], ids=["plate", "block"])
def test_gravity_on_each_body_is_its_weight_at_its_centre_of_mass(phantom):
    """Force and moment are exact on every piece, so that a freed body falls without turning."""
    dim = phantom.mesh.dim
    load = xfem.body_force(phantom, np.arange(1.0, dim + 1))
    per_piece = phantom.bodies[phantom.cells[:, 0]]
    for body in range(2):
        weight = phantom.volumes[per_piece == body]
        centre = weight @ phantom.piece_centroids[per_piece == body] / weight.sum()
        here = phantom.bodies == body
        assert load[here].sum(axis=0) == pytest.approx(weight.sum() * np.arange(1.0, dim + 1))
        # Σ f_k x_k with a constant density is density·V·(centre of mass)
        moment = load[here].T @ phantom.node_points[here]
        want = weight.sum() * np.outer(np.arange(1.0, dim + 1), centre)
        assert moment == pytest.approx(want, rel=1e-13)


def test_a_density_that_jumps_across_the_cut_acts_on_the_right_side():
    load = xfem.body_force(PLATE, lambda x, side: np.where(side > 0, [0.0, 1.0], 0.0))
    above = PLATE.volumes[PLATE.piece_side[:, 0] > 0].sum()
    assert load[:, 1].sum() == pytest.approx(above)
    assert (load[PLATE.node_side[:, 0] < 0] == 0.0).all()


@pytest.mark.parametrize("phantom", [PLATE, BLOCK], ids=["plate", "block"])
def test_a_uniform_pressure_on_the_whole_surface_balances_on_the_whole_and_opens_the_cut(phantom):
    """∮ n dA = 0 over the body; over one half it is minus the area vector of the cut."""
    mesh = phantom.mesh
    facets = mesh.boundary_facets

    def outward(x, side):
        nearest = np.abs(np.stack([x, x - 1.0], axis=-1)).reshape(len(x), -1).argmin(axis=1)
        normal = np.zeros_like(x)
        normal[np.arange(len(x)), nearest // 2] = np.where(nearest % 2 == 1, 1.0, -1.0)
        return normal

    load = xfem.traction(phantom, facets, outward)
    assert np.abs(load.sum(axis=0)).max() < 1e-14
    upper = load[phantom.node_side[:, 0] > 0].sum(axis=0)
    if mesh.dim == 2:
        assert upper == pytest.approx([-1 / 3, 1.0], abs=1e-14)
    else:
        assert upper == pytest.approx(np.array([-1.0, -2.0, 3.0]) / 3.0, abs=1e-14)


def test_a_pulled_plate_with_a_cut_along_the_pull_has_the_uniaxial_solution():
    phantom = xfem.cut_mesh(
        xfem.rectangle_mesh((6, 6)), [xfem.Polyline([[-1.0, 0.52], [2.0, 0.52]])]
    )
    mesh = phantom.mesh
    x = mesh.points
    facets = mesh.boundary_facets
    local = np.arange(3) != facets[:, 1:]
    ends = mesh.points[mesh.cells[facets[:, 0]][local].reshape(-1, 2)]
    right = facets[(ends[:, :, 0] > 1.0 - 1e-9).all(axis=1)]
    supports = xfem.Supports.none(phantom).prescribe(phantom, x[:, 0] < 1e-9, components=(0,))
    corners = (x[:, 0] < 1e-9) & ((x[:, 1] < 1e-9) | (x[:, 1] > 1.0 - 1e-9))
    supports = supports.prescribe(phantom, corners, components=(1,))
    load = xfem.traction(phantom, right, [1.0, 0.0])
    for state, modulus in (("plane stress", 1.0), ("plane strain", 1.0 / 0.91)):
        solution = xfem.solve_static(phantom, xfem.isotropic(1.0, 0.3, state), supports, load)
        assert solution.displacement[:, 0] == pytest.approx(phantom.node_points[:, 0] / modulus)
        assert solution.strain_energy == pytest.approx(0.5 / modulus, rel=1e-12)
        assert solution.reaction.sum(axis=0) == pytest.approx([-1.0, 0.0], abs=1e-13)


@pytest.mark.parametrize("dim", [1, 2, 3])
def test_quadrature_is_exact_up_to_its_degree(dim):
    """∫ Π λ_i^{a_i} = d! Π a_i! / (Σ a_i + d)! times the volume."""
    for degree in (1, 2, 4, 7):
        points, weights = simplex_rule(dim, degree)
        for powers in product(range(degree + 1), repeat=dim + 1):
            if sum(powers) <= degree:
                want = factorial(dim) * prod(map(factorial, powers)) / factorial(sum(powers) + dim)
                assert weights @ (points ** np.array(powers)).prod(axis=1) == pytest.approx(want)


def test_a_piece_that_nothing_holds_is_named():
    held = xfem.Supports.none(PLATE).prescribe(PLATE, PLATE.mesh.points[:, 1] < 1e-9)
    with pytest.raises(UnsupportedBodyError, match=r"a piece of 0\.4 m² around .* is not held"):
        xfem.solve_static(PLATE, STRAIN, held)


def test_a_body_held_in_one_node_can_still_turn_and_is_refused():
    phantom = xfem.cut_mesh(xfem.rectangle_mesh((3, 3)), [])
    one = xfem.Supports.none(phantom).prescribe(phantom, [0])
    with pytest.raises(UnsupportedBodyError, match="rigid body"):
        xfem.solve_static(phantom, STRAIN, one)
    two = one.prescribe(phantom, [3], components=(1,))
    assert (
        xfem.solve_static(phantom, STRAIN, two, xfem.body_force(phantom, [0, -1])).residual < 1e-12
    )
    # moved rigidly, all forces are round-off: of the products K u
    shifted = xfem.Supports(two.fixed, np.where(two.fixed, [3.0, -7.0], 0.0))
    assert xfem.solve_static(phantom, STRAIN, shifted).residual < 1e-12
