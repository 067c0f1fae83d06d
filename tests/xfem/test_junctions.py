"""Cuts that meet: forks, branches, corners, element faces."""

from itertools import permutations

import numpy as np
import pytest
from cut_bodies import shaken
from cut_comparison import same_cut
from test_tips_beside_cuts import exterior, facet_measures
from xfem_bodies import zero_modes

import verify.xfem as xfem
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.cuts import ImplicitCut, Plane, PolygonPatch, ToolPath
from verify.xfem.faceted_cuts import Polyline


def sectors(rng, count, least=0.35):
    """Ascending angles of rays, no two nearer than `least`."""
    while True:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
        if np.diff(angles, append=angles[0] + 2.0 * np.pi).min() > least:
            return angles


def fork(point, angles, reach=2.0):
    """Cuts that leave a point, those at even places coming towards it."""
    ends = point + reach * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    lines = [[point, end] if k % 2 else [end, point] for k, end in enumerate(ends)]
    return [Polyline(line) for line in lines]


def areas(phantom):
    return np.sort(np.bincount(phantom.bodies[phantom.cells[:, 0]], phantom.volumes))


@pytest.mark.parametrize(("count", "seed"), [(2, 0), (3, 1), (3, 2), (4, 3), (5, 4)])
def test_cuts_that_end_in_one_point_of_an_element_leave_a_part_for_each_sector(count, seed):
    """Rigid modes are those of as many parts, and no part has pieces of two sectors."""
    rng = np.random.default_rng([count, seed])
    mesh = shaken(xfem.rectangle_mesh((3, 3)), seed)
    point, angles = rng.uniform(0.3, 0.7, 2), sectors(rng, count)
    cuts = fork(point, angles)
    for order in list(permutations(range(count)))[:: max(1, count - 2)][:3]:
        phantom = xfem.cut_mesh(mesh, [cuts[k] for k in order])
        assert phantom.bodies.max() + 1 == count
        modes, following = zero_modes(phantom)
        assert modes == 3 * count
        assert following > 1e-9
        # a part's pieces in a cell together lie in one sector: straight cuts are exact
        parts, number = np.unique(phantom.part, return_inverse=True)
        weights = np.bincount(number, phantom.volumes)
        x, y = (np.bincount(number, phantom.volumes * c) for c in phantom.piece_centroids.T)
        turn = np.arctan2(y / weights - point[1], x / weights - point[0]) % (2.0 * np.pi)
        sector = np.searchsorted(angles, turn) % count
        body = phantom.bodies[phantom.cells[parts, 0]]
        assert len(np.unique(np.stack([body, sector]), axis=1).T) == count


def half_planes(rng, count):
    """Half planes that leave one line, in any position and sense of turning."""
    frame, point = np.linalg.qr(rng.normal(size=(3, 3)))[0], rng.uniform(0.35, 0.65, 3)
    cuts = []
    for k, angle in enumerate(sectors(rng, count)):
        out = 3.0 * (np.cos(angle) * frame[0] + np.sin(angle) * frame[1])
        low, high = point - 3.0 * frame[2], point + 3.0 * frame[2]
        rim = [low, low + out, high + out, high]
        cuts.append(PolygonPatch(rim if k % 2 else rim[::-1]))
    return cuts


@pytest.mark.parametrize(("count", "seed"), [(2, 0), (3, 1), (4, 2)])
def test_half_planes_that_end_on_one_line_in_tetrahedra_leave_a_part_for_each_sector(count, seed):
    rng = np.random.default_rng([3, count, seed])
    mesh = shaken(xfem.box_mesh((2, 2, 2)), seed)
    cuts = half_planes(rng, count)
    phantom = xfem.cut_mesh(mesh, cuts)
    assert phantom.bodies.max() + 1 == count
    modes, following = zero_modes(phantom)
    assert modes == 6 * count
    assert following > 1e-9
    divided = xfem.subdivide(phantom)
    torn = facet_measures(divided.cut_facets).sum()
    # facets as thin as round-off measure up to its root, 1e-8 of their length
    assert exterior(divided) == pytest.approx(6.0 + 2.0 * torn, abs=1e-6)
    assert divided.cell_piece.max() + 1 == len(phantom.cells)


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("tip", ["inside", "extended"])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_stroke_that_goes_on_where_another_stopped_parts_the_body(dim, tip, turned):
    """Exactly straight on, from a point inside an element; the sense of the second is its own."""
    rng = np.random.default_rng(dim)
    mesh = shaken(xfem.rectangle_mesh((5, 5)) if dim == 2 else xfem.box_mesh((3, 3, 3)), 4)
    frame, point = np.linalg.qr(rng.normal(size=(dim, dim)))[0], rng.uniform(0.4, 0.6, dim)
    if dim == 2:
        far = point + np.array([[-3.0], [3.0]]) * frame[0]
        cuts = [Polyline([far[0], point]), Polyline([point, far[1]][::turned])]
    else:
        rim = np.array([[0.0, -3.0], [3.0, -3.0], [3.0, 3.0], [0.0, 3.0]])
        cuts = [
            PolygonPatch((point + (rim * [sign, sign]) @ frame[:2])[::way])
            for sign, way in ((-1.0, 1), (1.0, turned))
        ]
    for asked in (cuts, cuts[::-1]):
        phantom = xfem.cut_mesh(mesh, asked, tip)
        assert zero_modes(phantom)[0] == 2 * (3 if dim == 2 else 6)
        whole = xfem.cut_mesh(mesh, [Plane(point, frame[-1])], tip)
        np.testing.assert_allclose(areas(phantom), areas(whole), rtol=1e-12)
        torn = [facet_measures(xfem.subdivide(one).cut_facets).sum() for one in (phantom, whole)]
        assert torn[0] == pytest.approx(torn[1], rel=1e-9)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_second_stroke_from_the_end_of_the_first_parts_the_body_as_it_grows(dim, way):
    """Straight on; or it comes from the other side, and ends there."""
    rng = np.random.default_rng(dim)
    mesh = shaken(xfem.rectangle_mesh((5, 5)) if dim == 2 else xfem.box_mesh((3, 3, 3)), 4)
    frame, point = np.linalg.qr(rng.normal(size=(dim, dim)))[0], rng.uniform(0.4, 0.6, dim)
    deep = None if dim == 2 else 6.0 * frame[1]
    start = point if dim == 2 else point - 3.0 * frame[1]
    tips = [start - 3.0 * frame[0], start, start + 3.0 * frame[0]]
    cutter = SemiProgressiveCutter(mesh)
    for count, path in ((1, tips[:2]), (2, tips[1:][::way])):
        cutter.begin(ToolPath.of_tip(path, [count, count + 1.0], deep))
        for time in np.linspace(count, count + 1.0, 5):
            cutter.advance(time)
        assert cutter.phantom_mesh().bodies.max() + 1 == count
    assert same_cut(cutter.phantom_mesh(), xfem.cut_mesh(mesh, cutter.cuts))


@pytest.mark.parametrize("seed", range(5))
def test_a_fork_that_ends_inside_is_one_slit_that_opens_to_its_ends(seed):
    """The faces of the cut are as long as the slits, but for the elements in which they end."""
    rng = np.random.default_rng([7, seed])
    cells, reach = 12, 0.3
    mesh = shaken(xfem.rectangle_mesh((cells, cells)), seed)
    point, angles = rng.uniform(0.4, 0.6, 2), sectors(rng, 3)
    phantom = xfem.cut_mesh(mesh, fork(point, angles, reach))
    assert phantom.bodies.max() == 0
    divided = xfem.subdivide(phantom)
    torn = facet_measures(divided.cut_facets).sum()
    # each loses less than the way through an element at its tip, at most its longest edge
    assert 3.0 * (reach - np.sqrt(2.0) / cells * 1.3) < torn <= 3.0 * reach + 1e-12
    assert exterior(divided) == pytest.approx(4.0 + 2.0 * torn, abs=1e-9)
    # nothing is torn where no cut is
    middle = divided.cut_facets.mean(axis=1) - point
    off = np.abs(middle @ np.stack([-np.sin(angles), np.cos(angles)]))
    ahead = middle @ np.stack([np.cos(angles), np.sin(angles)]) > -1e-12
    assert np.where(ahead, off, 1.0).min(axis=1).max() < 1e-12


@pytest.mark.parametrize("bend", [15.0, 40.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_branch_from_the_kink_of_a_polyline_comes_off(bend, seed):
    """It leaves the stem steeper than that bends: on the convex side it would miss it else."""
    rng = np.random.default_rng([int(bend), seed])
    mesh = shaken(xfem.rectangle_mesh((5, 5)), seed)
    point, way = rng.uniform(0.35, 0.65, 2), rng.uniform(0.0, 2.0 * np.pi)
    turn, least = np.radians(bend), np.radians(bend + 10.0)
    side = rng.choice([1.0, -1.0])
    away = side * rng.uniform(least, np.pi - side * turn - least)

    def off(angle):
        return point + 3.0 * np.array([np.cos(way + angle), np.sin(way + angle)])

    stem = Polyline([2.0 * point - off(0.0), point, off(turn)])
    branch = Polyline([point, off(turn + away)])
    for cuts in ([stem, branch], [branch, stem]):
        phantom = xfem.cut_mesh(mesh, cuts)
        assert phantom.bodies.max() + 1 == 3
        assert zero_modes(phantom)[0] == 9


@pytest.mark.parametrize("policy", ["merge", "drop"])
def test_pieces_that_no_cut_keeps_apart_are_slivers_together_or_not_at_all(policy):
    """A fork just inside an edge: planes past the point cut thin pieces off thick parts."""
    mesh = xfem.rectangle_mesh((4, 4))
    point = np.array([0.375, 0.5 + 1e-4])
    cuts = fork(point, np.array([0.3, 2.2, 4.5]))
    phantom = xfem.cut_mesh(mesh, cuts)
    assert phantom.fraction.min() < 1e-3
    cell = phantom.parent[phantom.fraction.argmin()]
    assert len(np.unique(phantom.part[phantom.parent == cell])) == 3
    treated, report = xfem.treat_slivers(phantom, policy)
    assert treated.bodies.max() + 1 == 3
    # only what is dropped goes to another part
    moved = report.volume_share if policy == "drop" else 0.0
    np.testing.assert_allclose(areas(treated.corners), areas(phantom), atol=moved + 1e-12)


def without_a_quarter(mesh):
    """Leave out x < ½ < y: a re-entrant corner, in space a re-entrant edge, remains."""
    centre = mesh.points[mesh.cells].mean(axis=1)
    cells = mesh.cells[~((centre[:, 0] < 0.5) & (centre[:, 1] > 0.5))]
    used, numbers = np.unique(cells, return_inverse=True)
    return xfem.SimplexMesh(mesh.points[used], numbers.reshape(cells.shape))


def angle_body(dim):
    return without_a_quarter(xfem.rectangle_mesh((4, 4)) if dim == 2 else xfem.box_mesh((2, 2, 2)))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(("slope", "side"), [(1.0, 1.0), (0.6, -1.0), (1.7, 1.0)])
def test_a_cut_through_a_re_entrant_corner_leaves_no_hinge(dim, slope, side):
    """Above the line are two parts that meet in the corner only, whichever side is called plus."""
    mesh = angle_body(dim)
    normal = side * np.array([-slope, 1.0, 0.0])[:dim]
    phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.5] * dim, normal)])
    assert phantom.bodies.max() + 1 == 3
    assert zero_modes(phantom)[0] == 3 * (3 if dim == 2 else 6)
    above = phantom.mesh.points[:, 1] - 0.5 - slope * (phantom.mesh.points[:, 0] - 0.5)
    assert len(np.unique(phantom.bodies[: len(mesh.points)][above > 1e-9])) == 2


@pytest.mark.parametrize(
    ("side", "way", "tip"), [(1.0, 1.0, "inside"), (-1.0, -1.0, "through"), (1.0, -1.0, "nearest")]
)
def test_a_branch_from_a_stem_along_edges_or_faces_comes_off(side, way, tip):
    """Pieces without volume beside the stem must not hold the two sides of the branch together."""
    end = 0.5 + 3.0 * way
    plate = xfem.rectangle_mesh((4, 4))
    branches = [Polyline([[0.47, 0.5], [0.6, end]]), Polyline([[0.6, end], [0.47, 0.5]])]
    for branch in branches:
        stem = xfem.Plane([0.5, 0.5], [0.0, side])
        for cuts in ([stem, branch], [branch, stem]):
            assert xfem.cut_mesh(plate, cuts, tip).bodies.max() + 1 == 3
    path = ToolPath.of_tip([[0.6, end], [0.47, 0.5]], [2.0, 3.0])
    cutter = SemiProgressiveCutter(plate)
    for stroke in (ToolPath.of_tip([[0.5 - side, 0.5], [0.5 + side, 0.5]], [0.0, 1.0]), path):
        cutter.begin(stroke)
        cutter.advance(stroke.times[-1])
    assert cutter.phantom_mesh().bodies.max() + 1 == 3

    block = xfem.box_mesh((2, 2, 2))
    rim = [[0.45, -1.0, 0.5], [0.45, 2.0, 0.5], [0.55, 2.0, end], [0.55, -1.0, end]]
    for outline in (rim, rim[::-1]):
        cuts = [xfem.Plane([0.5] * 3, [0.0, 0.0, side]), PolygonPatch(outline)]
        phantom = xfem.cut_mesh(block, cuts, tip)
        assert phantom.bodies.max() + 1 == 3


def doubled(mesh, on_cut, above):
    """The conforming mesh: nodes on the cut (not at its tip) doubled for the cells above it."""
    new = np.full(len(mesh.points), -1)
    new[on_cut] = len(mesh.points) + np.arange(on_cut.sum())
    cells = np.where(above[:, None] & (new[mesh.cells] >= 0), new[mesh.cells], mesh.cells)
    return xfem.SimplexMesh(np.concatenate([mesh.points, mesh.points[on_cut]]), cells)


PLATE, BLOCK = xfem.rectangle_mesh((6, 6)), xfem.box_mesh((2, 2, 2))


@pytest.mark.parametrize("half_way", [False, True])
@pytest.mark.parametrize("diagonal", [False, True])
@pytest.mark.parametrize("plain", [PLATE, BLOCK], ids=["slanted plate", "block"])
def test_a_cut_along_element_faces_equals_the_mesh_with_doubled_nodes(plain, diagonal, half_way):
    """Parallel to an axis or along diagonals, through the body or to its middle."""
    dim, last, reference = plain.dim, plain.dim - 1, plain.points
    slant = np.array([[1.0, 0.3], [0.2, 1.1]]) if dim == 2 else np.eye(3)
    mesh, back = xfem.SimplexMesh(reference @ slant.T, plain.cells), np.linalg.inv(slant).T
    # the level set in the coordinates of the structured mesh, as a plane in space
    height = reference[:, last] - (reference[:, 0] if diagonal else 0.5)
    normal = back @ (np.eye(dim)[last] - diagonal * np.eye(dim)[0])
    flat = xfem.Plane(slant @ np.full(dim, 0.5), normal)

    def depth(x):
        return 0.5 - (x @ back)[:, 0] if half_way else np.full(len(x), np.inf)

    phantom = xfem.cut_mesh(mesh, [ImplicitCut(flat.level_set, depth)])
    on_cut = (np.abs(height) < 1e-9) & ((not half_way) | (reference[:, 0] < 0.5 - 1e-9))
    conforming = doubled(mesh, on_cut, height[mesh.cells].mean(axis=1) > 0.0)
    assert phantom.node_count == len(conforming.points)
    assert (phantom.fraction == 1.0).all()

    material = xfem.isotropic(1.0, 0.3, "plane strain" if dim == 2 else "solid")
    solutions = []
    for body in (phantom, xfem.cut_mesh(conforming, [])):
        place = np.concatenate([reference, reference[on_cut]])[body.node_parent]
        held = (place[:, last] < 1e-9) | (place[:, last] > 1.0 - 1e-9)
        held = held & ~((np.abs(place[:, 0]) < 1e-9) & diagonal)
        supports = xfem.Supports(np.repeat(held[:, None], dim, axis=1), np.zeros((len(held), dim)))
        load = xfem.body_force(body, -0.1 * np.eye(dim)[last])
        solutions.append(xfem.solve_static(body, material, supports, load))
    ours, theirs = solutions
    assert ours.strain_energy == pytest.approx(theirs.strain_energy, rel=1e-12)
    # compare cell by cell: the numbering of the doubled nodes differs
    got = ours.displacement[phantom.cells[np.argsort(phantom.parent)]]
    want = theirs.displacement[conforming.cells]
    assert np.abs(got - want).max() < 1e-12 * np.abs(want).max()
