"""Semi-progressive cutting: a cut grows with the tool and ends as the cut made at once."""

import numpy as np
import pytest
from cut_comparison import assert_same_cut

from verify.geometry.simplices import measures
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.arrays import XfemError
from verify.xfem.cuts import ToolPath
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.subdivision import subdivide

PLANE_STROKES = [
    ToolPath.of_tip([[-0.1, 0.43], [0.4, 0.51], [0.8, 0.3]], [0.0, 1.0, 2.0]),
    ToolPath.of_tip([[0.3, 1.1], [0.33, 0.1]], [3.0, 4.0]),
    ToolPath.of_tip([[-0.1, 0.43], [0.4, 0.51], [0.8, 0.3]], [5.0, 6.0, 7.0]),
]
SPACE_STROKES = [
    ToolPath.of_tip(
        [[-0.1, 0.43, 1.1], [0.4, 0.51, 1.1], [0.8, 0.3, 1.1]], [0.0, 1.0, 2.0], [0.0, 0.1, -0.7]
    ),
    ToolPath.of_tip([[0.3, 1.1, 1.1], [0.33, 0.1, 1.2]], [3.0, 4.0], [0.1, 0.0, -0.7]),
    ToolPath.of_tip([[-0.1, -0.2, 0.48], [1.1, -0.2, 0.55]], [5.0, 6.0], [0.0, 1.4, 0.05]),
]


@pytest.mark.parametrize(
    ("mesh", "paths"),
    [
        (rectangle_mesh((9, 8), diagonal="alternating"), PLANE_STROKES),
        (box_mesh((3, 4, 3)), SPACE_STROKES),
    ],
)
def test_at_every_moment_the_growing_cut_is_the_cut_made_at_once(mesh, paths) -> None:
    cutter = SemiProgressiveCutter(mesh)
    split = 0
    for path in paths:
        cutter.begin(path)
        for time in np.linspace(path.times[0], path.times[-1], 6):
            increment = cutter.advance(time)
            split += increment is not None
            assert_same_cut(cutter.phantom_mesh(), cut_mesh(mesh, cutter.cuts))
    assert_same_cut(cutter.phantom_mesh(), cut_mesh(mesh, [path.sweep for path in paths]))
    assert split > len(paths)
    # divided for who draws it, with the points in which cuts meet: a few facets are in more parts
    grown, whole = (subdivide(one) for one in (cutter.phantom_mesh(), cut_mesh(mesh, cutter.cuts)))
    for simplices in (lambda body: body.points[body.cells], lambda body: body.cut_facets):
        one, other = (measures(simplices(body)).sum() for body in (grown, whole))
        assert one == pytest.approx(other, rel=1e-12)


def test_random_strokes_are_at_every_moment_the_cuts_made_at_once():
    rng, split = np.random.default_rng(32), 0
    meshes = rectangle_mesh((9, 8), diagonal="alternating"), box_mesh((3, 4, 3))
    for mesh in [*meshes] * 4:
        cutter, space = SemiProgressiveCutter(mesh), mesh.space
        for begin in (0.0, 2.0, 4.0):
            tips = rng.uniform(-0.2, 1.2, (3, space))
            tips[:, 2:] = 1.1  # above the block, its other end at any depth
            blade = np.append(rng.uniform(-0.2, 0.2, 2), -rng.uniform(0.4, 1.4))
            times = begin + np.arange(3.0)
            cutter.begin(ToolPath.of_tip(tips, times, None if space == 2 else blade))
            for time in np.linspace(times[0], times[-1], 5):
                split += cutter.advance(time) is not None
                assert_same_cut(cutter.phantom_mesh(), cut_mesh(mesh, cutter.cuts))
    assert split > 60


def test_delay_is_element_size_over_tool_speed() -> None:
    # crossing elements of size h at speed v takes a time in proportion to h / v (Table 4.6): a
    # horizontal cut through the middle of a row of right triangles passes h / 2 in each
    for n, speed in ((8, 0.05), (16, 0.4)):
        cutter, height = SemiProgressiveCutter(rectangle_mesh((n, n))), 0.5 + 0.5 / n
        cutter.begin(ToolPath.of_tip([[-0.1, height], [1.1, height]], [0.0, 1.2 / speed]))
        cutter.advance(1e3)
        crossings = cutter.crossings
        assert len(crossings.cell) == 2 * n
        np.testing.assert_allclose(crossings.delay, 0.5 / n / speed, rtol=1e-12, atol=1e-13)
        assert (crossings.seen == 1e3).all()


def test_a_live_tool_whose_path_is_told_bit_by_bit_cuts_what_is_recorded_of_it() -> None:
    mesh = rectangle_mesh((15, 14))
    cutter = SemiProgressiveCutter(mesh)
    with pytest.raises(XfemError, match="begin one first"):
        cutter.extend([[[0.0, 0.0]]], [0.0])
    angle = np.linspace(0.0, 2.2, 60)
    tips = np.stack([-0.05 + 0.45 * angle, 0.5 + 0.2 * np.sin(3.0 * angle)], axis=1)
    cutter.begin(ToolPath.of_tip(tips[:1], [0.0]))
    for k in range(1, 60):
        cutter.extend(tips[k : k + 1, None], [float(k)])
        cutter.advance(float(k))
    grown = cutter.phantom_mesh()
    assert_same_cut(grown, cut_mesh(mesh, cutter.cuts))
    # where the tool has long been, the path known in advance gives the same but for kinks
    known = cut_mesh(mesh, [ToolPath.of_tip(tips, np.arange(60)).sweep])
    assert abs(grown.node_count - known.node_count) <= 4
    assert len(np.unique(grown.bodies)) == len(np.unique(known.bodies))


def test_a_tool_that_leaves_and_comes_back_goes_on_cutting() -> None:
    # a body in the form of a comb: the path crosses its two teeth and the gap between
    mesh = rectangle_mesh((9, 6))
    centre = mesh.points[mesh.cells].mean(axis=1)
    gap = (abs(centre[:, 0] - 0.5) < 0.2) & (centre[:, 1] > 0.4)
    used, cells = np.unique(mesh.cells[~gap], return_inverse=True)
    comb = SimplexMesh(mesh.points[used], cells.reshape(-1, 3))
    path = ToolPath.of_tip([[-0.1, 0.83], [1.1, 0.77]], [0.0, 1.0])
    cutter = SemiProgressiveCutter(comb)
    cutter.begin(path)
    for time in np.linspace(0.0, 1.0, 12):
        cutter.advance(time)
    assert_same_cut(cutter.phantom_mesh(), cut_mesh(comb, [path.sweep]))
    assert len(np.unique(cutter.phantom_mesh().bodies)) == 3


@pytest.mark.parametrize(
    ("tips", "splits"),
    [
        ([[0.2, 0.2], [0.2, 0.2]], False),  # without length
        ([[1.5, 0.2], [2.0, 0.8]], False),  # beside the body
        ([[0.43, 0.45], [0.47, 0.46]], False),  # within one element
        ([[-0.25, 0.0], [1.0, 0.625]], True),  # through vertices
        ([[-0.1, 0.0], [1.1, 0.0]], False),  # along the boundary
    ],
)
def test_a_degenerate_stroke_cuts_what_the_cut_at_once_does(tips, splits) -> None:
    mesh, path = rectangle_mesh((8, 8)), ToolPath.of_tip(tips, [0.0, 1.0])
    cutter = SemiProgressiveCutter(mesh)
    cutter.begin(path)
    changed = [cutter.advance(time) is not None for time in np.linspace(0.0, 1.0, 6)]
    assert_same_cut(cutter.phantom_mesh(), cut_mesh(mesh, [path.sweep]))
    assert any(changed) is splits
