"""A cut along the edges or faces of the mesh: every method is the mesh with doubled nodes."""

import numpy as np
import pytest
from method_bodies import CUTTING, MATERIAL, at_places, hang, held_at

from verify.methods.cut_body import OpenedMesh
from verify.xfem.cuts import Plane, Polyline
from verify.xfem.loads_and_supports import body_force
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import solve_static

AXIS = {2: 1, 3: 2}


def ends(axis):
    return lambda points: (points[:, axis] < 1e-9) | (points[:, axis] > 1 - 1e-9)


def doubled_by_hand(mesh, on_cut):
    """Equilibrium on a mesh whose nodes on the cut are doubled by a rule written here."""
    axis = AXIS[mesh.dim]
    above = mesh.points[mesh.cells].mean(axis=1)[:, axis] > 0.5
    number = np.arange(len(mesh.points))
    number[on_cut] = len(mesh.points) + np.arange(on_cut.sum())
    cells = np.where(above[:, None], number[mesh.cells], mesh.cells)
    points = np.concatenate([mesh.points, mesh.points[on_cut]])
    phantom = cut_mesh(OpenedMesh(points, cells, mesh.boundary_facets), [])
    force = np.array([0.3, -1.0, 0.2])[: mesh.dim]
    supports = held_at(phantom, ends(axis))
    static = solve_static(phantom, MATERIAL[mesh.dim], supports, body_force(phantom, force))
    return points, phantom, static


@pytest.mark.parametrize("method", CUTTING)
@pytest.mark.parametrize("dim, through", [(2, False), (3, True)])
def test_a_cut_along_mesh_lines_is_the_mesh_with_doubled_nodes(method, dim, through):
    mesh = rectangle_mesh((4, 4)) if dim == 2 else box_mesh((1, 2, 2))
    axis = AXIS[dim]
    on_cut = np.abs(mesh.points[:, axis] - 0.5) < 1e-12
    if dim == 2:
        cut = Polyline([[-1.0, 0.5], [2.0 if through else 0.5, 0.5]])
        # the end of the cut, at a node, stays closed
        on_cut &= mesh.points[:, 0] < (2.0 if through else 0.5 - 1e-9)
    else:
        cut = Plane([0, 0, 0.5], [0, 0, 1])
    body, static = hang(method, mesh, [cut], ends(axis))
    points, phantom, expected = doubled_by_hand(mesh, on_cut)
    assert body.counts.nodes == len(points)
    assert body.phantom.volumes.sum() == pytest.approx(1.0, rel=1e-14)
    assert static.strain_energy == pytest.approx(expected.strain_energy, rel=1e-11)

    def above(centres):
        return centres[:, axis] > 0.5

    found = at_places(body, static.displacement, above)
    side = np.zeros(len(points))
    for k in range(dim + 1):
        side[phantom.cells[:, k]] = above(points[phantom.cells].mean(axis=1))
    rows = np.column_stack([np.round(points, 9), side, expected.displacement])
    wanted = rows[np.lexsort(rows[:, : dim + 1].T)]
    # round-off of two solves with other node numbers, condition number below 1e3
    assert np.abs(found - wanted).max() < 1e-11 * np.abs(expected.displacement).max()
