"""Linear stiffness of triangles in space: the plane-stress plate in its plane, nothing across."""

import numpy as np
import pytest
from cut_bodies import rotation
from xfem_bodies import boundary_nodes

from verify.xfem.block_pattern import block_pattern
from verify.xfem.cuts import Plane
from verify.xfem.elasticity import isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import solve_static
from verify.xfem.structured_meshes import rectangle_mesh
from verify.xfem.supports import Supports

MATERIAL = isotropic(1e4, 0.3, "plane stress")
TURN = rotation(3, 0.8)


def plate(turn=None):
    """The same cut plate in the plane, or in space and turned."""
    flat = rectangle_mesh((6, 5))
    point, normal = np.array([0.5, 0.53]), np.array([-0.3, 1.0])
    if turn is None:
        return cut_mesh(flat, [Plane(point, normal)])
    points = np.pad(flat.points, ((0, 0), (0, 1))) @ turn.T
    cut = Plane(turn @ np.append(point, 0.0), turn @ np.append(normal, 0.0))
    return cut_mesh(SimplexMesh(points, flat.cells), [cut])


def dense(phantom):
    pattern = block_pattern(phantom.cells, phantom.node_count)
    return pattern.matrix(InternalForce(phantom, MATERIAL, "linear").stiffness(pattern)).toarray()


def test_a_turned_membrane_has_the_turned_stiffness_of_the_plate_and_none_across():
    flat, membrane = plate(), plate(TURN)
    nodes = flat.node_count
    plane = dense(flat).reshape(nodes, 2, nodes, 2)
    space = np.einsum("ki,aibj,lj->akbl", TURN[:, :2], plane, TURN[:, :2])
    got = dense(membrane).reshape(nodes, 3, nodes, 3)
    assert got == pytest.approx(space, abs=1e-11 * np.abs(plane).max())


def test_each_half_of_a_cut_membrane_passes_the_patch_test_in_its_plane():
    """Constant strain along the cut, another one per half, free contraction across."""
    membrane = plate(np.eye(3))
    along = np.array([1.0, 0.3, 0.0]) / np.hypot(1.0, 0.3)
    across = np.array([-0.3, 1.0, 0.0]) / np.hypot(1.0, 0.3)

    def stretched(x, side):
        local = x - np.array([0.5, 0.53, 0.0])
        strain = np.where(side[:, 0] > 0, 0.1, -0.05)
        return (strain * (local @ along))[:, None] * along - (0.3 * strain * (local @ across))[
            :, None
        ] * across

    supports = Supports.none(membrane).prescribe(membrane, boundary_nodes(membrane.mesh), stretched)
    everywhere = np.ones(len(membrane.mesh.points), dtype=bool)
    supports = supports.prescribe(membrane, everywhere, components=(2,))
    solution = solve_static(membrane, MATERIAL, supports)
    want = stretched(membrane.node_points, membrane.node_side)
    assert solution.displacement == pytest.approx(want, abs=1e-14)
    area = 0.47  # above the cut, which passes through (.5, .53)
    energy = 0.5 * 1e4 * (0.1**2 * area + 0.05**2 * (1.0 - area))
    assert solution.strain_energy == pytest.approx(energy, rel=1e-12)
