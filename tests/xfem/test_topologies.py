"""Kinds of cuts in general position: parts of the body, and how much of the cut is realised.

docs/theory/xfem.md has a row for each kind; here is what its cells say.
"""

import re

import numpy as np
import pytest
from cut_bodies import shaken
from doc_pages import rows_of_table
from test_tips_beside_cuts import exterior, facet_measures
from xfem_bodies import zero_modes

import verify.xfem as xfem
from verify.xfem.arrays import XfemError
from verify.xfem.cuts import Plane, PolygonPatch, Polyline, ToolPath, TriangulatedSurface

PLANE, SPACE = "plane", "space"
ALONG = "runs along edges or faces of elements, through nodes"


def line(*points):
    return Polyline(points)


def sheet(*points, low=-1.0, high=2.0):
    """A strip in space over a polyline in x and z, along y."""
    rims = [[[x, y, z] for x, z in points] for y in (low, high)]
    count = len(points)
    pairs = [[[i, i + 1, count + i + 1], [i, count + i + 1, count + i]] for i in range(count - 1)]
    return TriangulatedSurface(np.concatenate(rims), np.reshape(pairs, (-1, 3)))


def patch(x, y, point=(0.5, 0.5, 0.47), normal=(0.1, 0.15, 1.0)):
    """A rectangle in an inclined plane, from x[0] to x[1] and y[0] to y[1] along it."""
    frame = np.linalg.qr(np.array([normal, [0.1, 1.0, 0.2], [1.0, 0.0, 0.0]]).T)[0].T
    place = np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])
    return PolygonPatch(point + place @ frame[[2, 1]])


STEM, FLAT = line([-1.0, 0.31], [2.0, 0.73]), Plane([0.5, 0.5, 0.47], [0.1, 0.15, 1.0])
ROOT = [0.4, 0.31 + 0.14 * 1.4]  # on the stem
POINT, CENTRE = np.array([0.47, 0.52]), [0.47, 0.52, 0.49]
RAYS = [np.array([np.cos(a), np.sin(a)]) for a in (0.3, 1.2, 2.4)]
LID = 0.47 - 0.1 * -0.08  # height of FLAT over x = 0.42, y = 0.5

# parts, cuts; the measure of the realised cut is that of the cut as given, to round-off
EXACT = {
    "goes through": {PLANE: (2, [STEM]), SPACE: (2, [FLAT])},
    "crosses another one": {
        PLANE: (4, [STEM, line([0.37, -1.0], [0.61, 2.0])]),
        SPACE: (4, [FLAT, Plane([0.43, 0.5, 0.5], [3.0, 0.2, 0.5])]),
    },
    "ends on another one (branch, junction line)": {
        PLANE: (3, [STEM, line(ROOT, [0.61, 2.0])]),
        SPACE: (3, [FLAT, PolygonPatch([
            [0.42, -1.0, LID + 0.15 * 1.5], [0.42, 2.0, LID - 0.15 * 1.5], [0.42, 2.0, 2.0],
            [0.42, -1.0, 2.0]])]),
    },
    "goes on where another one ends": {
        PLANE: (2, [line([-1.0, 0.31], ROOT), line(ROOT, [2.0, 0.73])]),
        SPACE: (2, [patch((-3.0, 0.03), (-3.0, 3.0)), patch((0.03, 3.0), (-3.0, 3.0))]),
    },
    "meets two others in one point": {
        PLANE: (6, [line(POINT - 2.0 * ray, POINT + 2.0 * ray) for ray in RAYS]),
        SPACE: (8, [Plane(CENTRE, n) for n in ([1, 0.2, 0.1], [0.1, 1, 0.3], [0.2, -0.3, 1])]),
    },
    "meets two others in one line": {
        SPACE: (6, [Plane(CENTRE, [*ray, -0.5 * ray[0] - 0.3 * ray[1]]) for ray in RAYS]),
    },
    "goes through an element with others, nearer than its size": {
        PLANE: (9, [STEM, line([-1.0, 0.33], [2.0, 0.75]), line([0.37, -1.0], [0.61, 2.0]),
                    line([0.4, -1.0], [0.66, 2.0])]),
        SPACE: (9, [Plane([x, 0.5, z], n) for n in (FLAT.normal, [3.0, 0.2, 0.5])
                    for x, z in ((0.43, 0.47), (0.46, 0.5))]),
    },
    "takes a corner of the body off": {
        PLANE: (2, [line([-1.0, 1.05], [1.05, -1.0])]),
        SPACE: (2, [Plane([0.15, 0.0, 0.0], [1.0, 0.7, 0.8])]),
    },
    "goes through a corner of the body": {
        PLANE: (2, [line([-1.0, -1.3], [2.0, 2.6])]),
        SPACE: (2, [Plane([0.0, 0.0, 0.0], [1.0, -1.3, 0.3])]),
    },
    ALONG: {
        PLANE: (3, [line([-1.0, 0.4], [2.0, 0.4]), line([0.6, -1.0], [0.6, 0.4])]),
        SPACE: (3, [Plane([0.0, 0.0, 1 / 3], [0.0, 0.0, 1.0]), PolygonPatch([
            [2 / 3, -1.0, -1.0], [2 / 3, 2.0, -1.0], [2 / 3, 2.0, 1 / 3], [2 / 3, -1.0, 1 / 3]])]),
    },
}  # fmt: skip
# parts, cuts, bends or ends: each may cost so much of the cut as the mesh is coarse
APPROXIMATED = {
    "ends inside, on one side or both": {
        PLANE: (1, [line([-1.0, 0.31], [0.53, 0.47]), line([0.21, 0.81], [0.87, 0.71])]),
        SPACE: (1, [patch((-3.0, 0.08), (-3.0, 3.0))]),
    },
    "ends behind another one that it crosses": {
        PLANE: (2, [line([-1.0, 0.31], [2.0, 0.73]), line([0.1, 0.1], [0.63, 0.81])]),
        SPACE: (2, [patch((-3.0, 0.08), (-3.0, 3.0)), Plane([0.5, 0.5, 0.5], [-0.1, 1.0, 0.2])]),
    },
    "bends by at most a right angle, is curved": {
        PLANE: (2, [line([-1.0, 0.53], [0.52, 0.53], [0.56, 2.0])]),
        SPACE: (2, [sheet([-1.0, 0.48], [0.47, 0.48], [0.5, 2.0])]),
    },
    "closes on itself (island)": {
        PLANE: (2, [Polyline([[0.2, 0.2], [0.8, 0.25], [0.85, 0.8], [0.25, 0.75]], closed=True)]),
        SPACE: (2, [TriangulatedSurface(
            0.1 + 0.83 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0],
                                   [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1.0]]),
            np.array([[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5],
                      [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 7, 3], [1, 5, 7]]))]),
    },
}  # fmt: skip
# nothing is cut, and the body stays one: the measured cut of a scene says so as `missing`
NOT_CUT = {
    "has both ends in one element": {
        PLANE: lambda x, y: line([x - 0.01, y - 0.02], [x + 0.01, y + 0.01]),
        SPACE: lambda *at: patch((-0.02, 0.02), (-0.02, 0.02), at),
    },
    "is an island or hairpin between nodes of an element": {
        PLANE: lambda x, y: line([-1.0, y], [x, y], [x, y + 1e-3], [-1.0, y + 1e-3]),
        SPACE: lambda x, _, z: sheet([-1.0, z], [x, z], [x, z + 1e-3], [-1.0, z + 1e-3]),
    },
}  # fmt: skip
# a strip of elements holds together what the cuts together would part
BRIDGED = {
    "overlaps one of its plane by less than an element": {
        PLANE: [line([-1.0, 0.31], [0.5, 0.52]), line([0.495, 0.5193], [2.0, 0.73])],
        SPACE: [patch((-3.0, 0.03), (-3.0, 3.0)), patch((0.02, 3.0), (-3.0, 3.0))],
    },
}
REFUSED = {
    "crosses or touches itself": {
        PLANE: (lambda: line([0.1, 0.1], [0.9, 0.8], [0.8, 0.2], [0.2, 0.9]),
                "segments 0 and 2 of the polyline intersect"),
        SPACE: (lambda: sheet([0.1, 0.1], [0.9, 0.8], [0.8, 0.2], [0.2, 0.9]),
                "triangles 0 and 5 of the surface intersect"),
    },
    "is swept by a blade across its own path": {
        PLANE: (lambda: ToolPath.of_tip(
            [[0.1, 0.1], [0.9, 0.8], [0.8, 0.2], [0.2, 0.9]], range(4)),
            "segments 0 and 2 of the polyline intersect"),
        SPACE: (lambda: ToolPath.of_tip(
            [[0.1, 0.1, 0], [0.9, 0.8, 0], [0.8, 0.2, 0], [0.2, 0.9, 0]], range(4), [0, 0.3, 1]),
            "triangles . and . of the sweep of the blade intersect"),
    },
    "turns back on itself": {
        PLANE: (lambda: line([0.1, 0.5], [0.9, 0.5], [0.5, 0.5]),
                "the polyline turns back on itself at vertex 1"),
        SPACE: (lambda: ToolPath.of_tip(
            [[0.1, 0.5, 0], [0.9, 0.5, 0], [0.5, 0.5, 0]], range(3), [0, 0, 1]),
            "the blade turns back on its own sweep near"),
    },
}  # fmt: skip


def mesh_of(where, seed, moved=0.2):
    """A unit square or cube, its inner nodes moved at random."""
    mesh = xfem.rectangle_mesh((5, 5)) if where == PLANE else xfem.box_mesh((3, 3, 3))
    return shaken(mesh, seed, moved)


def polygons(cut, space):
    """Facets (f, corners, space) of a cut; of a plane a piece that is larger than the body."""
    if isinstance(cut, Plane):
        frame = np.linalg.qr(np.column_stack([cut.normal, np.eye(space)[:, :space]]))[0].T
        ends = [[-1, -1], [1, -1], [1, 1], [-1, 1]] if space == 3 else [[-1], [1]]
        return [cut.point + 4.0 * np.array(ends) @ frame[1:space]]
    return [cut.corners] if isinstance(cut, PolygonPatch) else list(cut.arrays.corners)


def inside_the_box(corners):
    """Measure of a segment or convex polygon inside the unit square or cube."""
    shape = list(corners)
    closed = len(shape) > 2
    for axis in range(len(shape[0])):
        for sign, bound in ((1.0, 0.0), (-1.0, -1.0)):
            kept, pairs = [], list(zip(shape, shape[1:] + shape[:1], strict=True))
            for a, b in pairs if closed else pairs[:1]:
                fa, fb = sign * a[axis] - bound, sign * b[axis] - bound
                if fa >= 0.0:
                    kept.append(a)
                if fa * fb < 0.0:
                    kept.append(a + (b - a) * fa / (fa - fb))
                if fb >= 0.0 and not closed:
                    kept.append(b)
            if len(shape := kept) < 2:
                return 0.0
    if not closed:
        return np.linalg.norm(shape[1] - shape[0])
    spokes = np.array(shape[1:]) - shape[0]
    return 0.5 * np.linalg.norm(np.cross(spokes[:-1], spokes[1:]).sum(axis=0))


def asked(cuts, where):
    space = 2 if where == PLANE else 3
    return sum(inside_the_box(one) for cut in cuts for one in polygons(cut, space))


def rows(kinds):
    return [(where, kind) for kind, own in kinds.items() for where in own]


def realised(mesh, cuts, tip="inside"):
    """The cut mesh, and the measure of its cut: outside are the boundary and its two faces."""
    phantom = xfem.cut_mesh(mesh, cuts, tip)
    divided = xfem.subdivide(phantom)
    torn = facet_measures(divided.cut_facets).sum()
    assert exterior(divided) == pytest.approx(2.0 * mesh.space + 2.0 * torn, abs=1e-8)
    assert phantom.volumes.sum() == pytest.approx(1.0, rel=1e-12)
    return phantom, torn


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("where", "kind"), rows(EXACT))
def test_parts_and_realised_cut_are_those_of_the_cuts_as_given(where, kind, seed):
    """Each part has its rigid motions as modes without energy, and there are no others."""
    parts, cuts = EXACT[kind][where]
    for tip in ("inside", "extended"):
        phantom, torn = realised(mesh_of(where, seed, 0.0 if kind == ALONG else 0.2), cuts, tip)
        assert phantom.bodies.max() + 1 == parts
        assert torn == pytest.approx(asked(cuts, where), rel=1e-9)
    assert zero_modes(phantom)[0] == parts * (3 if where == PLANE else 6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("where", "kind"), rows(APPROXIMATED))
def test_parts_are_right_where_the_realised_cut_is_not_the_one_given(where, kind, seed):
    parts, cuts = APPROXIMATED[kind][where]
    phantom, torn = realised(mesh_of(where, seed), cuts)
    assert phantom.bodies.max() + 1 == parts
    assert zero_modes(phantom)[0] == parts * (3 if where == PLANE else 6)
    # a chord of each element, or the element in which a cut ends: of these coarse meshes
    want = asked(cuts, where)
    assert 1e-3 < 1.0 - torn / want < 0.35


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("where", "kind"), rows(NOT_CUT))
def test_what_lies_between_the_nodes_of_an_element_cuts_nothing(where, kind, seed):
    mesh = mesh_of(where, seed)
    middle = mesh.points[mesh.cells].mean(axis=1)
    cut = NOT_CUT[kind][where](*middle[np.linalg.norm(middle - 0.45, axis=1).argmin()])
    assert asked([cut], where) > 0.0
    for tip in ("inside", "extended"):
        assert not xfem.cut_mesh(mesh, [cut], tip).split.any()


@pytest.mark.parametrize("tip", ["inside", "extended"])
@pytest.mark.parametrize(("where", "kind"), rows(BRIDGED))
def test_strokes_that_overlap_a_little_leave_a_bridge(where, kind, tip):
    """Known, and said on the page: each ends in the same element, and neither at an end."""
    phantom = xfem.cut_mesh(mesh_of(where, 0), BRIDGED[kind][where], tip)
    assert phantom.bodies.max() == 0
    assert phantom.split.any()


@pytest.mark.parametrize(("where", "kind"), rows(REFUSED))
def test_a_cut_that_comes_back_to_itself_is_refused(where, kind):
    made, said = REFUSED[kind][where]
    with pytest.raises(XfemError, match=said):
        made()


@pytest.mark.parametrize("kind", [kind for kind, own in EXACT.items() if PLANE in own])
def test_a_membrane_is_cut_as_the_plane(kind):
    """By surfaces that stand on it; also if it is bent, for its mesh is the same."""
    parts, cuts = EXACT[kind][PLANE]
    flat = mesh_of(PLANE, 0)
    x, y = flat.points.T
    standing = [
        TriangulatedSurface(
            [[*p, z] for z in (-2.0, 2.0) for p in cut.vertices], [[0, 1, 3], [0, 3, 2]])
        for cut in cuts
    ]  # fmt: skip
    want = np.sort(areas(xfem.cut_mesh(flat, cuts)))
    for height in (0.0, 0.3):
        points = np.stack([x, y, height * np.sin(3.0 * x)], axis=1)
        phantom = xfem.cut_mesh(xfem.SimplexMesh(points, flat.cells), standing)
        assert phantom.bodies.max() + 1 == parts
        if height == 0.0:
            np.testing.assert_allclose(areas(phantom), want, rtol=1e-9)


def areas(phantom):
    return np.sort(np.bincount(phantom.bodies[phantom.cells[:, 0]], phantom.volumes))


def test_the_page_says_of_each_kind_what_is_asserted_here():
    """No second list: rows are kinds, and cells begin with how they are taken."""
    taken = {
        "exact": EXACT,
        "approximated": APPROXIMATED,
        "not cut": NOT_CUT,
        "bridged": BRIDGED,
        "refused": REFUSED,
    }
    asserted = {(kind, where): how for how, kinds in taken.items() for where, kind in rows(kinds)}
    told = {
        (kind, where): how
        for kind, *cells in rows_of_table("theory/xfem.md", "a cut that")
        for where, cell in zip((PLANE, SPACE), cells, strict=True)
        for how in [re.split(r"[:;]", cell)[0]]
        if how != "–"
    }
    assert told == asserted


@pytest.mark.parametrize("x", [0.5, 1.5])
def test_triangles_with_a_common_vertex_are_refused_where_they_cross_beside_it(x):
    """The far edge of one goes through the other, at half or two thirds of its length."""
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    first, triangles = [[0, 0, 0], [1, -1, 0], [1, 1, 0]], [[0, 1, 2], [0, 3, 4]]
    across, above = ([[x, 0, low], [x, 0.1, 0.4]] for low in (-0.3, 0.1))
    TriangulatedSurface(np.array([*first, *above]) @ turn, triangles)
    with pytest.raises(XfemError, match="triangles 0 and 1 of the surface intersect"):
        TriangulatedSurface(np.array([*first, *across]) @ turn, triangles)
