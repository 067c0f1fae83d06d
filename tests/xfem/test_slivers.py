"""Slivers down to 1e-12 of an element, and exactly none: same solution, bounded conditioning."""

import numpy as np
import pytest
import xfem_exact_fields as exact
from xfem_bodies import boundary_nodes, scaled_dense_stiffness

from verify.xfem.cuts import Plane
from verify.xfem.elasticity import isotropic
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import solve_static
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.supports import Supports

SIZES = [0.5, 1e-1, 1e-2, 1e-4, 1e-6, 1e-9, 1e-12, 0.0, -1e-12, -1e-6]


def body(dim, size):
    """Cut size·h above the middle layer of nodes."""
    mesh = rectangle_mesh((8, 8)) if dim == 2 else box_mesh((2, 2, 4))
    h = 1 / 8 if dim == 2 else 1 / 4
    return cut_mesh(mesh, [Plane(np.full(dim, 0.5) + size * h * np.eye(dim)[-1], np.eye(dim)[-1])])


def clamped(phantom):
    last = phantom.mesh.points[:, -1]
    held = (last < 1e-9) | (last > 1.0 - 1e-9)
    return Supports.none(phantom).prescribe(phantom, held)


def scaled_condition_number(phantom):
    fixed = clamped(phantom).fixed.ravel()
    values = np.linalg.eigvalsh(scaled_dense_stiffness(phantom)[np.ix_(~fixed, ~fixed)])
    return values[-1] / values[0]


@pytest.mark.parametrize("dim", [2, 3])
def test_the_scaled_condition_number_does_not_see_slivers(dim):
    """At most twice that of the cut along the nodes, which is a conforming mesh without slivers."""
    conforming = scaled_condition_number(body(dim, 0.0))
    for size in SIZES:
        assert scaled_condition_number(body(dim, size)) < 2.0 * conforming
    # and it tends to it, instead of growing like 1/size²
    assert scaled_condition_number(body(dim, 1e-9)) == pytest.approx(conforming, rel=1e-6)


@pytest.mark.parametrize("size", SIZES)
def test_the_patch_test_holds_for_every_sliver(size):
    """F1 turned to a horizontal cut: constant stress along it, each half its own."""
    phantom = body(2, size)
    level = 0.5 + size / 8

    def stretched(x, side):
        strain = np.where(side[:, 0] > 0, 0.1, -0.05)
        gap = np.where(side[:, 0] > 0, 0.0, -0.02)
        across = gap - exact.ETA * strain * (x[:, 1] - level)
        return np.stack([strain * (x[:, 0] - 0.5), across], axis=1)

    supports = Supports.none(phantom).prescribe(phantom, boundary_nodes(phantom.mesh), stretched)
    solution = solve_static(phantom, isotropic(1.0, 0.3, "plane strain"), supports)
    want = stretched(phantom.node_points, phantom.node_side)
    assert np.abs(solution.displacement - want).max() < 1e-14
    plane = 1.0 / (1.0 - 0.3**2)  # E' in plane strain
    energy = 0.5 * plane * (0.1**2 * (1.0 - level) + 0.05**2 * level)
    assert solution.strain_energy == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_solution_is_continuous_in_the_position_of_the_cut_at_a_node(dim):
    """From above, exactly on and from below the nodes: the same body to the size moved."""
    energies = []
    for size in (1e-9, 1e-12, 0.0, -1e-12, -1e-9):
        phantom = body(dim, size)
        last = phantom.mesh.points[:, -1]
        supports = clamped(phantom).prescribe(
            phantom, last > 1 - 1e-9, np.full(dim, 0.01) * (np.arange(dim) == 0)
        )
        supports = supports.prescribe(
            phantom, phantom.mesh.points[:, 0] < 1e-9, lambda x, side: 0.01 * x * side[:, :1]
        )
        energies.append(solve_static(phantom, isotropic(1.0, 0.3, "solid"), supports).strain_energy)
    assert energies == pytest.approx([energies[2]] * 5, rel=1e-7)
