"""Exact solutions with a traction-free inclined cut: patch tests and observed orders."""

import numpy as np
import pytest
import xfem_exact_fields as exact
from xfem_bodies import boundary_nodes, relative_l2_error

import verify.xfem as xfem
from verify.accelerated import FAST
from verify.xfem.arrays import NotConvergedError
from verify.xfem.linear_solvers import PLAIN

LINE = xfem.Polyline([[-1.0, 0.0], [2.0, 1.0]])
PLANE = xfem.Plane([0.5, 0.5, 0.5], exact.NORMAL)


def solve(mesh, cut, field, solver="direct", kernels=PLAIN):
    phantom = xfem.cut_mesh(mesh, [cut])
    supports = xfem.Supports.none(phantom).prescribe(phantom, boundary_nodes(mesh), field)
    state = "plane strain" if mesh.dim == 2 else "solid"
    material = xfem.isotropic(exact.YOUNG, exact.POISSON, state)
    return phantom, xfem.solve_static(phantom, material, supports, solver=solver, kernels=kernels)


@pytest.mark.parametrize("kernels", [PLAIN, FAST], ids=["plain", "fast"])
def test_a_large_cut_cube_is_solved_by_iteration_as_exactly(kernels):
    """The cut leaves slivers of 1e-8 of the elements; what is plane is factorised at any size."""
    plane = xfem.Plane(PLANE.point + 1e-9, exact.NORMAL)
    phantom, solution = solve(xfem.box_mesh((12, 12, 12)), plane, exact.f1_3d, "auto", kernels)
    assert solution.solver == "iterative"
    assert phantom.node_count > 2000
    want = exact.f1_3d(phantom.node_points, phantom.node_side)
    # the slivers' faces are 1e-9 off where the field is exact
    assert np.abs(solution.displacement - want).max() < 1e-8
    assert solution.residual < 1e-11
    plate = solve(xfem.rectangle_mesh((48, 48)), LINE, exact.f3, "auto", kernels)[1]
    assert plate.solver == "direct"


def test_a_thin_strip_that_bends_is_factorised_where_iterations_do_not_end():
    """Equilibrium: the load works twice the strain energy; asked for, iterations say why not."""
    mesh = xfem.box_mesh((240, 5, 1), upper=(1.2, 0.02, 0.001))
    phantom = xfem.cut_mesh(mesh, [])
    held = xfem.Supports.none(phantom).prescribe(phantom, np.flatnonzero(mesh.points[:, 0] == 0.0))
    load = xfem.body_force(phantom, (0.0, 0.0, -1.0))
    material = xfem.isotropic(1e4, 0.3, "solid")
    solution = xfem.solve_static(phantom, material, held, load, kernels=FAST)
    assert phantom.node_count > 2000
    assert solution.solver == "direct"
    work = np.sum(load * solution.displacement)
    # round-off times the condition number, (length/thickness)⁴
    assert work == pytest.approx(2.0 * solution.strain_energy, rel=1e-4)
    with pytest.raises(NotConvergedError):
        xfem.solve_static(phantom, material, held, load, "iterative", kernels=FAST)


def test_energy_and_displacement_of_f3_converge_at_first_and_second_order():
    errors, energies = [], []
    for n in (16, 32, 64):
        phantom, solution = solve(xfem.rectangle_mesh((n, n)), LINE, exact.f3)
        errors.append(relative_l2_error(phantom, solution.displacement, exact.f3))
        energies.append(solution.strain_energy)
    # independent values: another minimal P1 XFEM on the same meshes, to the digits stated
    assert energies == pytest.approx([2.80440, 2.78535, 2.78055], abs=5.1e-6)
    assert errors == pytest.approx([1.153e-2, 2.937e-3, 7.366e-4], rel=5e-4)
    excess = np.array(energies) - exact.ENERGY_F3
    assert np.log2(errors[1] / errors[2]) > 1.95
    # with exact values on the boundary the energy converges like the square of its norm
    assert np.log2(excess[1] / excess[2]) / 2 > 0.98
