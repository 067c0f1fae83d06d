"""One space, three bases: equal displacements; and the thesis' blocks as an independent check."""

import numpy as np
import pytest
import xfem_exact_fields as exact
from thesis_blocks import shifted_stiffness, transformation, transformed_matrix
from xfem_bodies import boundary_nodes, sparse_stiffness

from verify.xfem.cuts import ImplicitCut, Plane, Polyline
from verify.xfem.element import isotropic
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import solve_static

CASES = {
    "through": (rectangle_mesh((6, 6)), Polyline([[-1.0, 0.0], [2.0, 1.0]])),
    "edge crack": (rectangle_mesh((6, 6)), Polyline([[-1.0, 0.52], [0.5, 0.52]])),
    "along edges": (rectangle_mesh((6, 6)), Polyline([[-1.0, 0.5], [2.0, 0.5]])),
    "through nodes": (rectangle_mesh((6, 6)), Polyline([[-0.5, 0.0], [1.5, 1.0]])),
    "cube": (box_mesh((2, 3, 2)), Plane([0.5, 0.5, 0.5], [-1.0, -2.0, 3.0])),
}


def blocks_by_the_thesis(phantom, sign_of_kaa=1.0):
    """(u, a) stiffness from nodal signs and fractions only."""
    mesh = phantom.mesh
    split = np.zeros(len(mesh.cells), dtype=bool)
    split[phantom.parent[phantom.split]] = True
    plus = phantom.label[:, 0] > 0
    above = np.bincount(phantom.parent[plus], phantom.fraction[plus], minlength=len(mesh.cells))
    state = "plane strain" if mesh.dim == 2 else "solid"
    return shifted_stiffness(
        mesh,
        isotropic(1.0, 0.3, state),
        np.where(phantom.level_sets[:, 0] >= 0.0, 1, -1),
        above,
        phantom.enriched_nodes,
        split,
        sign_of_kaa,
    )


@pytest.mark.parametrize("name", CASES)
def test_the_transformed_stiffness_equals_the_thesis_blocks_with_the_corrected_sign(name):
    mesh, cut = CASES[name]
    phantom = cut_mesh(mesh, [cut])
    through_t = transformed_matrix(phantom, "shifted", sparse_stiffness(phantom))
    assert np.abs(through_t - blocks_by_the_thesis(phantom)).max() < 1e-14


def test_the_sign_printed_in_2_64_makes_the_stiffness_indefinite():
    """Negative control: the wrong sign of K^aa must not pass unnoticed."""
    phantom = cut_mesh(*[(CASES["through"][0]), [CASES["through"][1]]])
    right = np.linalg.eigvalsh(blocks_by_the_thesis(phantom))
    wrong = np.linalg.eigvalsh(blocks_by_the_thesis(phantom, sign_of_kaa=-1.0))
    assert right[0] > -1e-14
    assert wrong[0] < -0.1 * wrong[-1]


@pytest.mark.parametrize("basis", ["shifted", "heaviside"])
def test_all_bases_give_the_same_displacement_to_round_off(basis):
    """The system solved in its own unknowns, Dirichlet values included, by a dense solver."""
    mesh, cut = CASES["through"]
    phantom = cut_mesh(mesh, [cut])
    nodes = boundary_nodes(mesh)
    supports = Supports.none(phantom).prescribe(phantom, nodes, exact.f3)
    sidewise = solve_static(phantom, isotropic(1.0, 0.3, "plane strain"), supports).displacement
    K = transformed_matrix(phantom, basis, sparse_stiffness(phantom))
    T = transformation(phantom, basis)
    given = np.linalg.solve(T, supports.values)
    # an enriched node with a prescribed value has both u and a prescribed
    on_boundary = np.isin(
        np.concatenate([np.arange(len(mesh.points)), phantom.enriched_nodes]), nodes
    )
    fixed = np.repeat(on_boundary, 2)
    q = given.ravel().copy()
    q[~fixed] = np.linalg.solve(K[np.ix_(~fixed, ~fixed)], -K[np.ix_(~fixed, fixed)] @ q[fixed])
    assert np.abs(T @ q.reshape(-1, 2) - sidewise).max() < 1e-13


def test_two_parts_beyond_one_cut_have_unknowns_of_their_own():
    # a hexagon whose cut takes off two opposite corners: beyond it is not one part, but two
    turn = np.pi / 3 * np.arange(6)
    points = np.vstack([[[0.0, 0.0]], np.column_stack([np.cos(turn), np.sin(turn)])])
    around = np.arange(6)
    mesh = SimplexMesh(points, np.column_stack([0 * around, 1 + around, 1 + (around + 1) % 6]))
    phantom = cut_mesh(mesh, [ImplicitCut(lambda x: 0.7 - np.abs(x[:, 0]))])
    assert np.bincount(phantom.node_parent)[0] == 3
    assert phantom.bodies.max() == 2  # the middle and both corners
