"""One space, two bases: the thesis' blocks as an independent check of the stiffness."""

import numpy as np
import pytest
from thesis_blocks import shifted_stiffness, transformed_matrix
from xfem_bodies import sparse_stiffness

from verify.xfem.cuts import ImplicitCut, Plane, Polyline
from verify.xfem.element import isotropic
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

CASES = {
    "through": (rectangle_mesh((5, 5)), Polyline([[-1.0, 0.0], [2.0, 1.0]])),
    "edge crack": (rectangle_mesh((5, 5)), Polyline([[-1.0, 0.52], [0.5, 0.52]])),
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


def test_two_parts_beyond_one_cut_have_unknowns_of_their_own():
    # a hexagon whose cut takes off two opposite corners: beyond it is not one part, but two
    turn = np.pi / 3 * np.arange(6)
    points = np.vstack([[[0.0, 0.0]], np.column_stack([np.cos(turn), np.sin(turn)])])
    around = np.arange(6)
    mesh = SimplexMesh(points, np.column_stack([0 * around, 1 + around, 1 + (around + 1) % 6]))
    phantom = cut_mesh(mesh, [ImplicitCut(lambda x: 0.7 - np.abs(x[:, 0]))])
    assert np.bincount(phantom.node_parent)[0] == 3
    assert phantom.bodies.max() == 2  # the middle and both corners
