"""Exact solutions with a traction-free inclined cut: patch tests and observed orders."""

import numpy as np
import pytest
import xfem_exact_fields as exact
from xfem_bodies import boundary_nodes, relative_l2_error

from verify.xfem.arrays import NotConvergedError
from verify.xfem.cuts import Plane, Polyline
from verify.xfem.element import isotropic
from verify.xfem.loads_and_supports import Supports, body_force
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import solve_static

LINE = Polyline([[-1.0, 0.0], [2.0, 1.0]])
PLANE = Plane([0.5, 0.5, 0.5], exact.NORMAL)


def solve(mesh, cut, field, solver="direct"):
    phantom = cut_mesh(mesh, [cut])
    supports = Supports.none(phantom).prescribe(phantom, boundary_nodes(mesh), field)
    state = "plane strain" if mesh.dim == 2 else "solid"
    material = isotropic(exact.YOUNG, exact.POISSON, state)
    return phantom, solve_static(phantom, material, supports, solver=solver)


@pytest.mark.parametrize("diagonal", ["right", "left", "alternating", "crossed"])
@pytest.mark.parametrize("n", [5, 8])
def test_a_cut_plate_passes_the_patch_test_to_round_off(n, diagonal):
    phantom, solution = solve(rectangle_mesh((n, n), diagonal=diagonal), LINE, exact.f1)
    assert solution.strain_energy == pytest.approx(exact.ENERGY_F1, rel=1e-9)
    want = exact.f1(phantom.node_points, phantom.node_side)
    # round-off of a solve with a few hundred unknowns, displacements of order 0.1
    assert np.abs(solution.displacement - want).max() < 1e-14


@pytest.mark.parametrize("solver", ["direct", "iterative"])
def test_a_cut_cube_passes_the_patch_test_to_round_off(solver):
    phantom, solution = solve(box_mesh((4, 4, 4)), PLANE, exact.f1_3d, solver)
    assert solution.strain_energy == pytest.approx(exact.ENERGY_F1_3D, rel=1e-9)
    want = exact.f1_3d(phantom.node_points, phantom.node_side)
    tolerance = 1e-14 if solver == "direct" else 1e-13  # CG stops at a relative residual of 1e-13
    assert np.abs(solution.displacement - want).max() < tolerance


def test_a_large_cut_cube_is_solved_by_iteration_as_exactly_as_by_factorisation():
    """The cut leaves slivers of 1e-8 of the elements; what is plane is factorised at any size."""
    plane = Plane([0.5, 0.5, 0.5 + 1e-9], [0.0, 0.0, 1.0])
    phantom, solution = solve(box_mesh((12, 12, 12)), plane, exact.f1_3d, "auto")
    assert solution.solver == "iterative"
    assert phantom.node_count > 2000
    _, direct = solve(box_mesh((12, 12, 12)), plane, exact.f1_3d, "direct")
    assert solution.strain_energy == pytest.approx(direct.strain_energy, rel=1e-13)
    assert np.abs(solution.displacement - direct.displacement).max() < 1e-12
    assert solution.residual < 1e-11
    assert solve(rectangle_mesh((48, 48)), LINE, exact.f1, "auto")[1].solver == "direct"


def test_a_thin_strip_that_bends_is_factorised_where_iterations_do_not_end():
    """Equilibrium: the load works twice the strain energy; asked for, iterations say why not."""
    mesh = box_mesh((240, 5, 1), upper=(1.2, 0.02, 0.001))
    phantom = cut_mesh(mesh, [])
    held = Supports.none(phantom).prescribe(phantom, np.flatnonzero(mesh.points[:, 0] == 0.0))
    load = body_force(phantom, (0.0, 0.0, -1.0))
    solution = solve_static(phantom, isotropic(1e4, 0.3, "solid"), held, load)
    assert phantom.node_count > 2000
    assert solution.solver == "direct"
    work = np.sum(load * solution.displacement)
    # round-off times the condition number, (length/thickness)⁴
    assert work == pytest.approx(2.0 * solution.strain_energy, rel=1e-4)
    with pytest.raises(NotConvergedError):
        solve_static(phantom, isotropic(1e4, 0.3, "solid"), held, load, "iterative")


def test_swapped_sides_of_the_prescribed_values_are_seen_in_the_displacement():
    """Negative control. The energy alone is blind to it: both halves are congruent."""
    phantom, solution = solve(rectangle_mesh((8, 8)), LINE, lambda x, side: exact.f1(x, -side))
    assert relative_l2_error(phantom, solution.displacement, exact.f1) > 1.0


def test_energy_and_displacement_of_f3_converge_at_first_and_second_order():
    errors, energies = [], []
    for n in (16, 32, 64):
        phantom, solution = solve(rectangle_mesh((n, n)), LINE, exact.f3)
        errors.append(relative_l2_error(phantom, solution.displacement, exact.f3))
        energies.append(solution.strain_energy)
    # independent values: another minimal P1 XFEM on the same meshes, to the digits stated
    assert energies == pytest.approx([2.80440, 2.78535, 2.78055], abs=5.1e-6)
    assert errors == pytest.approx([1.153e-2, 2.937e-3, 7.366e-4], rel=5e-4)
    excess = np.array(energies) - exact.ENERGY_F3
    assert np.log2(errors[1] / errors[2]) > 1.95
    # with exact values on the boundary the energy converges like the square of its norm
    assert np.log2(excess[1] / excess[2]) / 2 > 0.98


def test_the_solution_does_not_depend_on_the_numbering_of_nodes_and_cells():
    mesh = rectangle_mesh((8, 8))
    _, solution = solve(mesh, LINE, exact.f3)
    rng = np.random.default_rng(3)
    order = rng.permutation(len(mesh.points))
    place = np.argsort(order)
    cells = place[mesh.cells][rng.permutation(len(mesh.cells))]
    shuffled = type(mesh)(mesh.points[order], rng.permuted(cells, axis=1))
    _, other = solve(shuffled, LINE, exact.f3)
    assert other.strain_energy == pytest.approx(solution.strain_energy, rel=1e-13)
    # the real unknown of each node keeps the node's number on both meshes
    assert np.allclose(other.displacement[place], solution.displacement[: len(place)], atol=1e-13)
