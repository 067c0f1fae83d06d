"""Pieces of cut cells: exact volumes, no lost piece, no crash, however degenerate the cut."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from verify.xfem.cuts import ImplicitCut, Plane
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.pieces import split_cells
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.subdivision import subdivide

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
@settings(max_examples=150, deadline=None)
def test_any_nodal_values_give_pieces_that_fill_their_cells(dim, data):
    mesh = MESHES[dim]
    cuts = [
        nodal_cut(mesh, data.draw(st.lists(VALUE, min_size=5, max_size=27)))
        for _ in range(data.draw(st.integers(1, 3)))
    ]
    check_pieces(mesh, cuts)


@pytest.mark.parametrize("dim", [2, 3])
def test_ten_thousand_random_and_degenerate_cuts_lose_no_volume_and_no_piece(dim):
    """One mesh of 5000 separate simplices, each with its own nodal values."""
    rng = np.random.default_rng(dim)
    one = TRIANGLE if dim == 2 else TETRAHEDRON
    count, corners = 5000, dim + 1
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
    # a cell splits into two unless all its nodes are on one side, zero being the plus side
    used = phantom.level_sets.reshape(count, corners)
    above, below = (used > 0.0).any(axis=1), (used < 0.0).any(axis=1)
    pieces = np.bincount(phantom.parent, minlength=count)
    assert np.array_equal(pieces, np.where(above & below, 2, 1))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-6, 1e-9, 1e-12])
def test_a_cut_off_corner_keeps_all_digits_of_its_volume(dim, size):
    """φ = size − Σx cuts off the corner at the origin: a fraction of size^dim."""
    mesh = TRIANGLE if dim == 2 else TETRAHEDRON
    phantom = cut_mesh(mesh, [Plane([0.5 * size] * 2 + [0.0] * (dim - 2), -np.ones(dim))])
    if size == 1.0:
        assert phantom.fraction.tolist() == [1.0]
    else:
        # φ itself carries a round-off of some 1e-17 from subtracting coordinates of size 1e-12
        assert phantom.fraction.min() == pytest.approx(size**dim, rel=1e-15 / size + 1e-14)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_the_subdivision_is_watertight_and_fills_the_body(dim, seed):
    """Every facet has two cells, or lies on the body's surface or on the cut, twice."""
    rng = np.random.default_rng(seed)
    mesh = MESHES[dim]
    cuts = [Plane(rng.uniform(0.3, 0.7, dim), rng.normal(size=dim)) for _ in range(2)]
    body = subdivide(cut_mesh(mesh, cuts))
    corners = body.points[body.cells]
    edges = corners[:, 1:] - corners[:, :1]
    volumes = np.linalg.det(edges) / (2 if dim == 2 else 6)
    assert (volumes > 0.0).all()
    assert volumes.sum() == pytest.approx(1.0, rel=1e-13)
    keep = np.array([[j for j in range(dim + 1) if j != k] for k in range(dim + 1)])
    facets, count = np.unique(
        np.sort(body.cells[:, keep].reshape(-1, dim), axis=1), axis=0, return_counts=True
    )
    assert count.max() == 2
    free = body.points[facets[count == 1]]
    on_box = ((np.abs(free) < 1e-12).all(axis=1) | (np.abs(free - 1.0) < 1e-12).all(axis=1)).any(1)
    assert (~on_box).sum() == 2 * len(body.cut_facets)
    # Gauss: the outward normals of a closed surface add up to zero, body by body
    area = _areas(free).sum()
    assert area == pytest.approx((4 if dim == 2 else 6) + 2 * _areas(body.cut_facets).sum())


def _areas(facets):
    if facets.shape[1] == 2:
        return np.linalg.norm(facets[:, 1] - facets[:, 0], axis=1)
    return np.linalg.norm(np.cross(*(facets[:, k] - facets[:, 0] for k in (1, 2))), axis=1) / 2


def test_a_thin_layer_between_two_cuts_keeps_its_volume():
    gap = 1e-9
    cuts = [Plane([0.5, 0.52], [0.0, 1.0]), Plane([0.5, 0.52 + gap], [0.0, 1.0])]
    phantom = check_pieces(rectangle_mesh((4, 4)), cuts)
    layer = phantom.bodies[phantom.cells[:, 0]]
    volumes = np.bincount(layer, phantom.volumes)
    assert len(volumes) == 3
    # positions carry round-off of 1e-16, the gap a relative 1e-7 of it
    assert volumes.min() == pytest.approx(gap, rel=1e-6)


@pytest.mark.parametrize("tip", ["inside", "through"])
def test_a_cut_splits_as_it_does_beside_one_that_meets_nothing(tip) -> None:
    mesh = box_mesh((3, 3, 3))
    beyond = Plane((9.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    rng = np.random.default_rng(11)
    cuts = [Plane(rng.random(3), rng.standard_normal(3)) for _ in range(6)]
    cuts.append(Plane((1 / 3, 0.0, 0.0), (1.0, 0.0, 0.0)))  # along faces
    cuts.append(Plane((0.0, 0.0, 0.0), (1.0, -1.0, 0.0)))  # through nodes
    for cut in cuts:
        alone, among = split_cells(mesh, [cut], tip), split_cells(mesh, [cut, beyond], tip)
        np.testing.assert_array_equal(alone.parent, among.parent)
        np.testing.assert_array_equal(alone.label, among.label[:, :1])
        for name, mine in vars(alone.simplices).items():
            np.testing.assert_allclose(mine, getattr(among.simplices, name), rtol=1e-14, atol=1e-16)
        np.testing.assert_allclose(alone.points.positions, among.points.positions, atol=1e-15)
        np.testing.assert_array_equal(alone.points.ends, among.points.ends)
