"""A cut exactly along element faces is the mesh with doubled nodes, to round-off."""

import numpy as np
import pytest

from verify.xfem.cuts import ImplicitCut, Plane
from verify.xfem.elasticity import isotropic
from verify.xfem.loads import body_force
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import solve_static
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.supports import Supports


def doubled(mesh, on_cut, above):
    """The conforming mesh: nodes on the cut (not at its tip) doubled for the cells above it."""
    new = np.full(len(mesh.points), -1)
    new[on_cut] = len(mesh.points) + np.arange(on_cut.sum())
    cells = np.where(above[:, None] & (new[mesh.cells] >= 0), new[mesh.cells], mesh.cells)
    return SimplexMesh(np.concatenate([mesh.points, mesh.points[on_cut]]), cells)


def through(x):
    return np.ones(len(x), dtype=bool)


def half_way(x):
    return x[:, 0] < 0.5 - 1e-9


PLATE = rectangle_mesh((8, 8))
SLANTED = SimplexMesh(PLATE.points @ np.array([[1.0, 0.3], [0.2, 1.1]]).T, PLATE.cells)
BLOCK = box_mesh((4, 2, 4))


@pytest.mark.parametrize("reach", [through, half_way])
@pytest.mark.parametrize("plane", ["level", "diagonal"])
@pytest.mark.parametrize("name", ["plate", "slanted plate", "block"])
def test_a_cut_along_element_faces_equals_the_mesh_with_doubled_nodes(name, plane, reach):
    mesh = {"plate": PLATE, "slanted plate": SLANTED, "block": BLOCK}[name]
    dim = mesh.dim
    # the level set in the reference coordinates of the structured mesh, as a plane in space
    reference = PLATE.points if dim == 2 else BLOCK.points
    last = dim - 1
    height = reference[:, last] - (0.5 if plane == "level" else reference[:, 0])
    fit = np.linalg.lstsq(np.c_[mesh.points, np.ones(len(mesh.points))], height, rcond=None)[0]
    to_reference = np.linalg.lstsq(np.c_[mesh.points, np.ones(len(mesh.points))], reference, None)[
        0
    ]
    flat = Plane(-fit[dim] * fit[:dim] / (fit[:dim] @ fit[:dim]), fit[:dim])

    def depth(x):
        first = (np.c_[x, np.ones(len(x))] @ to_reference)[:, 0]
        return np.full(len(x), np.inf) if reach is through else 0.5 - first

    phantom = cut_mesh(mesh, [ImplicitCut(flat.level_set, depth)])
    on_cut = (np.abs(height) < 1e-9) & reach(reference)
    above = height[mesh.cells].mean(axis=1) > 0.0
    conforming = doubled(mesh, on_cut, above)
    assert phantom.node_count == len(conforming.points)
    assert (phantom.fraction == 1.0).all()

    state = "plane strain" if dim == 2 else "solid"
    material, gravity = isotropic(1.0, 0.3, state), np.eye(dim)[last] * -0.1
    solutions = []
    for body in (phantom, cut_mesh(conforming, [])):
        place = np.concatenate([reference, reference[on_cut]])[body.node_parent]
        held = (place[:, last] < 1e-9) | (place[:, last] > 1.0 - 1e-9)
        held = held & ~((np.abs(place[:, 0]) < 1e-9) & (plane == "diagonal"))
        supports = Supports(np.repeat(held[:, None], dim, axis=1), np.zeros((len(held), dim)))
        solutions.append(solve_static(body, material, supports, body_force(body, gravity)))
    ours, theirs = solutions
    assert ours.strain_energy == pytest.approx(theirs.strain_energy, rel=1e-12)
    # compare cell by cell: the numbering of the doubled nodes differs
    order = np.argsort(phantom.parent)
    got = ours.displacement[phantom.cells[order]]
    want = theirs.displacement[conforming.cells]
    assert np.abs(got - want).max() < 1e-12 * np.abs(want).max()
