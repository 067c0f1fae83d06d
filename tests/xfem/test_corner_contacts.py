"""Parts that a cut leaves touching in a corner or an edge only are bodies of their own."""

import numpy as np
import pytest
from xfem_bodies import zero_modes

from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.xfem.cuts import Plane, PolygonPatch
from verify.xfem.faceted_cuts import Polyline
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.tool_path import ToolPath


def without_a_quarter(mesh):
    """Leave out x < ½ < y: a re-entrant corner, in space a re-entrant edge, remains."""
    centre = mesh.points[mesh.cells].mean(axis=1)
    cells = mesh.cells[~((centre[:, 0] < 0.5) & (centre[:, 1] > 0.5))]
    used, numbers = np.unique(cells, return_inverse=True)
    return SimplexMesh(mesh.points[used], numbers.reshape(cells.shape))


def angle_body(dim):
    return without_a_quarter(rectangle_mesh((4, 4)) if dim == 2 else box_mesh((2, 2, 2)))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("slope", [1.0, 0.6, 1.7])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_cut_through_a_re_entrant_corner_leaves_no_hinge(dim, slope, side):
    """Above the line are two parts that meet in the corner only, whichever side is called plus."""
    mesh = angle_body(dim)
    normal = side * np.array([-slope, 1.0, 0.0])[:dim]
    phantom = cut_mesh(mesh, [Plane([0.5] * dim, normal)])
    assert phantom.bodies.max() + 1 == 3
    assert zero_modes(phantom)[0] == 3 * (3 if dim == 2 else 6)
    above = phantom.mesh.points[:, 1] - 0.5 - slope * (phantom.mesh.points[:, 0] - 0.5)
    assert len(np.unique(phantom.bodies[: len(mesh.points)][above > 1e-9])) == 2


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("tip", ["inside", "through", "nearest"])
def test_a_branch_from_a_stem_along_edges_or_faces_comes_off(side, way, tip):
    """Pieces without volume beside the stem must not hold the two sides of the branch together."""
    end = 0.5 + 3.0 * way
    plate = rectangle_mesh((4, 4))
    branches = [Polyline([[0.47, 0.5], [0.6, end]]), Polyline([[0.6, end], [0.47, 0.5]])]
    for branch in branches:
        stem = Plane([0.5, 0.5], [0.0, side])
        for cuts in ([stem, branch], [branch, stem]):
            assert cut_mesh(plate, cuts, tip).bodies.max() + 1 == 3
    path = ToolPath.of_tip([[0.6, end], [0.47, 0.5]], [2.0, 3.0])
    cutter = SemiProgressiveCutter(plate)
    for stroke in (ToolPath.of_tip([[0.5 - side, 0.5], [0.5 + side, 0.5]], [0.0, 1.0]), path):
        cutter.begin(stroke)
        cutter.advance(stroke.times[-1])
    assert cutter.phantom_mesh().bodies.max() + 1 == 3

    block = box_mesh((2, 2, 2))
    rim = [[0.45, -1.0, 0.5], [0.45, 2.0, 0.5], [0.55, 2.0, end], [0.55, -1.0, end]]
    for outline in (rim, rim[::-1]):
        cuts = [Plane([0.5] * 3, [0.0, 0.0, side]), PolygonPatch(outline)]
        phantom = cut_mesh(block, cuts, tip)
        assert phantom.bodies.max() + 1 == 3
