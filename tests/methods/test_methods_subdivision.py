"""Subdivision: a conforming mesh like any other, slivers and all."""

import numpy as np
import pytest
import skfem
from method_bodies import MATERIAL, hang
from skfem.models.elasticity import linear_elasticity

from verify.methods import cut_by
from verify.xfem.block_pattern import block_pattern
from verify.xfem.cuts import Plane, Polyline
from verify.xfem.explicit import critical_step, element_critical_steps
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import box_mesh, rectangle_mesh

LINES = [Polyline([[-0.1, 0.31], [0.62, 0.55]])]
CROSSING = [Polyline([[0.13, 0.31], [0.88, 0.77]]), Polyline([[0.13, 0.72], [0.88, 0.24]])]
PLANES = [Plane([0.5, 0.5, 0.47], [0.1, 0.2, 1.0])]


def ends(axis):
    return lambda points: (points[:, axis] < 1e-9) | (points[:, axis] > 1 - 1e-9)


@pytest.mark.parametrize(
    ("method", "mesh", "cuts"),
    [
        ("removal_refined", rectangle_mesh((7, 7)), LINES),
        ("subdivision", rectangle_mesh((7, 7), diagonal="crossed"), CROSSING),
        ("snapping_subdivision", box_mesh((3, 3, 3)), PLANES),
    ],
    ids=["one end", "crossing", "space"],
)
def test_the_energy_is_that_of_another_program_on_the_subdivided_mesh(method, mesh, cuts):
    axis = mesh.dim - 1
    body, static = hang(method, mesh, cuts, ends(axis))
    shown = body.conforming
    # in scikit-fem: assembled, loaded and held by other code; nothing but points and cells shared
    make, element = {
        2: (skfem.MeshTri, skfem.ElementTriP1),
        3: (skfem.MeshTet, skfem.ElementTetP1),
    }[mesh.dim]
    basis = skfem.Basis(
        make(shown.points.T.copy(), shown.cells.T.copy()), skfem.ElementVector(element())
    )
    material = MATERIAL[mesh.dim]
    K = linear_elasticity(float(material.lam), float(material.mu)).assemble(basis)
    force = np.array([0.3, -1.0, 0.2])[: mesh.dim]

    @skfem.LinearForm
    def weight(v, w):
        return sum(force[k] * v[k] for k in range(mesh.dim))

    held = np.flatnonzero(np.repeat(ends(axis)(shown.points), mesh.dim))
    u = skfem.solve(*skfem.condense(K, weight.assemble(basis), D=held))
    # a sliver of 1e-5 of a cell costs five digits of the solve at most
    assert static.strain_energy == pytest.approx(0.5 * u @ K @ u, rel=1e-10)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_critical_step_of_subdivision_vanishes_with_the_sliver_that_of_xfem_does_not(dim):
    mesh = rectangle_mesh((6, 6)) if dim == 2 else box_mesh((2, 2, 2))
    axis = dim - 1
    material = MATERIAL[dim]
    uncut = element_critical_steps(mesh, material, 1.0).min()
    sizes = np.array([1e-1, 1e-2, 1e-3])
    steps = {"subdivision": [], "virtual_node": []}
    for size in sizes:
        normal = np.eye(dim)[axis]
        cut = Plane(0.5 + size * normal / (6 if dim == 2 else 2), normal)
        for method, found in steps.items():
            body = cut_by(method, mesh, [cut])
            pattern = block_pattern(body.phantom.cells, body.phantom.node_count)
            blocks = InternalForce(body.phantom, material, "linear").stiffness(pattern)
            mass = side_wise_mass(body.phantom, 1.0)
            found.append(critical_step(pattern.matrix(blocks), mass))
    slope = np.diff(np.log(steps["subdivision"])) / np.diff(np.log(sizes))
    # a height of ε h: exponent 1 once ε is small against one
    assert slope[1:] == pytest.approx(1.0, abs=0.05)
    assert min(steps["virtual_node"]) > (1 - 1e-6) * uncut


def test_an_end_inside_a_triangle_becomes_a_node_of_the_subdivision():
    tip = np.array([0.53, 0.51])
    body = cut_by("subdivision", rectangle_mesh((8, 8)), [Polyline([[-1.0, 0.45], tip])])
    assert np.abs(body.conforming.cut_facets - tip).sum(axis=2).min() < 1e-15
    length = np.linalg.norm(np.diff(body.conforming.cut_facets, axis=1), axis=2).sum()
    start = np.array([0.0, 0.45 + 0.06 / 1.53])
    assert length == pytest.approx(np.linalg.norm(tip - start), rel=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("method", ["subdivision", "snapping_subdivision", "snapping"])
def test_cuts_that_almost_pass_through_nodes_leave_valid_meshes(method, dim):
    mesh = rectangle_mesh((4, 4)) if dim == 2 else box_mesh((2, 2, 2))
    normal = np.array([0.3, 1.0, 0.7])[:dim]
    for offset in (1e-4, 1e-9, 1e-12, 1e-15, 0.0):
        body = cut_by(method, mesh, [Plane(np.full(dim, 0.5) + offset * normal, normal)])
        assert body.phantom.mesh.measures.sum() == pytest.approx(1.0, rel=1e-12)
        assert body.phantom.bodies.max() == 1
