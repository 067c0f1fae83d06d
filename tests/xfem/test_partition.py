"""Division of cells by cuts: volumes, watertight pieces, degrees of freedom of every side."""

from itertools import permutations

import numpy as np
import pytest
from cut_bodies import shaken
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from verify.xfem.clip import ROUND_OFF_SHARE
from verify.xfem.cuts import ImplicitCut, Plane, PolygonPatch, Polyline
from verify.xfem.element import isotropic
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.pieces import split_cells
from verify.xfem.statics import solve_static

TRIANGLE = SimplexMesh([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1, 2]])
TETRAHEDRON = SimplexMesh(np.concatenate([np.zeros((1, 3)), np.eye(3)]), [[0, 1, 2, 3]])
MESHES = {2: rectangle_mesh((3, 3)), 3: box_mesh((2, 2, 2))}

# a level-set value: ordinary, a sliver, exactly zero, below round-off, or huge
VALUE = st.one_of(
    st.floats(-1.0, 1.0),
    st.sampled_from([0.0, 1e-12, -1e-12, 1e-9, -1e-6, 1e-15, -1e-15, 1e-17, 1e3, -1e3]),
)


def nodal_cut(mesh, values):
    """A cut given by its nodal values, whatever they are: more degenerate than any geometry.

    It has no end, and its interpolated zero set counts as being on it.
    """
    nodal = np.resize(values, len(mesh.points))
    return ImplicitCut(lambda x: nodal if np.array_equal(x, mesh.points) else np.zeros(len(x)))


def check_pieces(mesh, cuts):
    partition = split_cells(mesh, cuts)
    total = np.bincount(partition.parent, partition.fraction, minlength=len(mesh.cells))
    split = np.unique(partition.parent)
    assert (partition.simplices.fraction >= 0.0).all()
    # sums of at most some ten products of a few factors each
    assert np.abs(total[split] - 1.0).max(initial=0.0) <= 1e-14
    phantom = cut_mesh(mesh, cuts)
    assert phantom.volumes.sum() == pytest.approx(mesh.measures.sum(), rel=1e-14)
    assert (phantom.fraction > 0.0).all()
    # no unknown without material, no material without unknowns
    assert np.array_equal(np.unique(phantom.cells), np.arange(phantom.node_count))
    assert np.array_equal(phantom.node_parent[phantom.cells], mesh.cells[phantom.parent])
    return phantom


@pytest.mark.parametrize("dim", [2, 3])
@given(st.data())
@settings(max_examples=40, deadline=None)
def test_any_nodal_values_give_pieces_that_fill_their_cells(dim, data):
    mesh = MESHES[dim]
    cuts = [
        nodal_cut(mesh, data.draw(st.lists(VALUE, min_size=5, max_size=27)))
        for _ in range(data.draw(st.integers(1, 3)))
    ]
    check_pieces(mesh, cuts)


@pytest.mark.parametrize("dim", [2, 3])
def test_thousands_of_random_and_degenerate_cuts_lose_no_volume_and_no_piece(dim):
    """One mesh of 2000 separate simplices, each with its own nodal values."""
    rng = np.random.default_rng(dim)
    one = TRIANGLE if dim == 2 else TETRAHEDRON
    count, corners = 2000, dim + 1
    offsets = np.zeros((count, dim))
    offsets[:, 0] = 2.0 * np.arange(count)
    mesh = SimplexMesh(
        (one.points + offsets[:, None]).reshape(-1, dim),
        np.arange(count * corners).reshape(count, corners),
    )
    values = rng.choice([-1.0, 1.0], (count, corners)) * 10.0 ** rng.uniform(-14, 2, (count, 1))
    values = values * 10.0 ** rng.choice([0.0, 0.0, -6.0, -12.0], (count, corners))
    values[rng.random((count, corners)) < 0.1] = 0.0
    phantom = check_pieces(mesh, [nodal_cut(mesh, values.ravel())])
    # a cell splits into two unless one of them has no more than round-off of its volume
    used = phantom.level_sets.reshape(count, corners)
    sides = [(row[row > 0.0].tolist(), row[row < 0.0].tolist()) for row in used]
    least = np.array([min(share(above, below), share(below, above)) for above, below in sides])
    assert ((least > 0.0) & (least < 1e-20)).any()
    pieces = np.bincount(phantom.parent, minlength=count)
    assert np.array_equal(pieces, np.where(least > ROUND_OFF_SHARE, 2, 1))


def share(own, others):
    """Share of a simplex on the side of the corners `own`, by its level set at these and others.

    A zero point of an edge divides it into two simplices with a corner on the cut in place of one.
    """
    if not own or not others:
        return float(bool(own))
    p, q = own[0], others[0]
    return (abs(p) * share(own, others[1:]) + abs(q) * share(own[1:], others)) / (abs(p) + abs(q))


@pytest.mark.parametrize("dim", [2, 3])
def test_a_cut_off_corner_keeps_all_digits_of_its_volume(dim):
    """φ = size − Σx cuts off the corner at the origin: a fraction of size^dim."""
    mesh = TRIANGLE if dim == 2 else TETRAHEDRON
    for size in (1.0, 1e-3, 1e-6, 1e-9, 1e-12):
        phantom = cut_mesh(mesh, [Plane([0.5 * size] * 2 + [0.0] * (dim - 2), -np.ones(dim))])
        if size == 1.0 or size**dim < ROUND_OFF_SHARE:
            assert phantom.fraction == pytest.approx([1.0], rel=1e-15)
        else:
            # φ itself carries a round-off of some 1e-17 from subtracting coordinates near 1e-12
            assert phantom.fraction.min() == pytest.approx(size**dim, rel=1e-15 / size + 1e-14)


def _short_cuts(dim, count, rng):
    """Cuts in boxes of three elements' length, none within two of them of another, as one mesh."""
    size = (6 * count,) + (6,) * (dim - 1)
    mesh = shaken((rectangle_mesh if dim == 2 else box_mesh)(size, (0,) * dim, size), 1, 0.15)
    cuts = []
    for k in range(count):
        middle = np.full(dim, 3.0) + 6.0 * k * np.eye(dim)[0] + 0.2 * rng.random(dim)
        frame = np.linalg.qr(rng.standard_normal((dim, dim)))[0]
        if dim == 2:
            cuts.append(Polyline([middle - 1.4 * frame[0], middle + 1.4 * frame[0]]))
        else:
            corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ frame[:2]
            cuts.append(PolygonPatch(middle + 1.1 * corners))
    return mesh, cuts


@pytest.mark.parametrize("dim", [2, 3])
def test_cuts_apart_from_one_another_divide_together_what_each_does_alone(dim):
    """Also what is decided at once, of cuts whose extensions cross, is what they do in turn."""
    mesh, cuts = _short_cuts(dim, 3, np.random.default_rng(1))
    together = cut_mesh(mesh, cuts)
    added = 0
    for k, cut in enumerate(cuts):
        alone = cut_mesh(mesh, [cut])
        rows, mine = np.flatnonzero(alone.split), np.flatnonzero(together.label[:, k])
        assert len(rows) > 0
        np.testing.assert_array_equal(together.parent[mine], alone.parent[rows])
        np.testing.assert_array_equal(together.label[mine, k], alone.label[rows, 0])
        np.testing.assert_allclose(together.fraction[mine], alone.fraction[rows], atol=1e-14)
        added += alone.node_count - len(mesh.points)
    assert added > 0
    assert together.node_count == len(mesh.points) + added
    assert together.split.sum() == (together.label != 0).sum()


def _coarse_mesh(dim, rng):
    """Few unstructured simplices, so that several planes go through each."""
    corners = np.stack(np.meshgrid(*[[0.0, 1.0]] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    points = np.vstack([corners, rng.random((6, dim))])
    return SimplexMesh(points, Delaunay(points).simplices.astype(np.int64))


def _signs(planes, points):
    return np.stack([np.sign((points - p.point) @ p.normal) for p in planes], axis=1)


def _random_planes(dim, rng):
    count = rng.integers(2, 5)
    normals = rng.standard_normal((count, dim))
    if rng.random() < 0.5:  # layers: each is split off what the one before it has left
        normals[:] = normals[0] + 0.05 * rng.standard_normal((count, dim))
    return [Plane(0.2 + 0.6 * rng.random(dim), n / np.linalg.norm(n)) for n in normals]


def _plane_of_nodes(mesh, rng):
    """Along a part of the boundary, along a facet inside, or through one node of it."""
    d = mesh.dim
    cell, opposite = rng.integers(len(mesh.cells)), rng.integers(d + 1)
    if rng.random() < 0.5:
        outside = np.argwhere(mesh.neighbours < 0)
        cell, opposite = outside[rng.integers(len(outside))]
    facet = mesh.points[np.delete(mesh.cells[cell], opposite)]
    normal = np.linalg.svd(facet[1:] - facet[0])[2][-1]
    if rng.random() < 0.25:
        normal = normal + 0.3 * rng.standard_normal(d)
    return Plane(facet[0], rng.choice([-1.0, 1.0]) * normal / np.linalg.norm(normal))


def _structured_mesh(dim, rng):
    """Layers of nodes that planes may follow."""
    shape = tuple(int(n) for n in rng.integers(1, 4 if dim == 2 else 3, dim))
    return (rectangle_mesh if dim == 2 else box_mesh)(shape)


@pytest.mark.parametrize(("make", "of_nodes"), [(_coarse_mesh, 1), (_structured_mesh, 2)])
@pytest.mark.parametrize(("dim", "bodies"), [(2, 12), (3, 5)])
def test_every_unknown_lies_on_the_sides_of_its_pieces_in_any_order_of_the_cuts(
    dim, bodies, of_nodes, make
):
    rng = np.random.default_rng([dim, of_nodes])
    places = 0
    for _ in range(bodies):
        mesh = make(dim, rng)
        planes = _random_planes(dim, rng) + [_plane_of_nodes(mesh, rng) for _ in range(of_nodes)]
        orders = list(permutations(range(len(planes))))
        for order in [orders[k] for k in rng.choice(len(orders), 2, replace=False)]:
            cuts = [planes[k] for k in order]
            phantom = cut_mesh(mesh, cuts)
            # planes end nowhere, so that no piece lies on both sides of one
            truth = _signs(cuts, phantom.piece_centroids)
            np.testing.assert_array_equal(phantom.piece_side, truth)
            corners = phantom.cells.shape[1]
            np.testing.assert_array_equal(
                phantom.node_side[phantom.cells], np.repeat(truth[:, None], corners, axis=1)
            )
            # an unknown with the number of its node is that of the material in which the node lies
            own = phantom.cells < len(mesh.points)
            level = phantom.level_sets[phantom.mesh.cells[phantom.parent]]
            home = (level * truth[:, None] >= 0.0).all(axis=2)
            meets = np.zeros(len(mesh.points), dtype=bool)
            meets[phantom.mesh.cells[phantom.parent][home]] = True
            stands = np.zeros(len(mesh.points), dtype=bool)
            stands[phantom.cells[own & home]] = True
            np.testing.assert_array_equal(stands, meets)
            places += truth.size * corners
    assert places >= 300


def test_parts_between_planes_that_move_rigidly_are_held_where_they_are():
    mesh = rectangle_mesh((3, 3))
    planes = [Plane([0.40, 0.0], [1.0, 0.2]), Plane([0.55, 0.0], [1.0, 0.1])]
    for order in ((0, 1), (1, 0)):
        phantom = cut_mesh(mesh, [planes[k] for k in order])
        supports = Supports.none(phantom).prescribe(
            phantom,
            np.arange(len(mesh.points)),
            lambda x, side: np.column_stack([0.1 * side.sum(axis=1), 0.0 * x[:, 0]]),
        )
        solved = solve_static(phantom, isotropic(1.0, 0.3, "plane strain"), supports)
        assert solved.strain_energy < 1e-28
