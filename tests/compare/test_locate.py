import numpy as np
import pytest
from cut_meshes import cube, grid, layered, quadratic, solution

from verify.compare import cell_tree, locate, sides, simplices
from verify.compare.locate import SolutionField

RNG = np.random.default_rng(1)


@pytest.fixture(autouse=True, params=[True, False], ids=["kernels", "numpy"])
def compiled(request, monkeypatch):
    """Try both forms of the search: the compiled one, and that of an environment without numba."""
    for module in (cell_tree, locate, sides, simplices):
        monkeypatch.setattr(module, "COMPILED", request.param)


# a triangle in space has three corners and six nodes, not four and ten
SKEW = np.array([[0.1, 0.2, 0.0], [1.3, 0.1, 0.4], [0.3, 1.1, 0.7]]), np.array([[0, 1, 2]])


@pytest.mark.parametrize("mesh", [grid(7, 5), cube(), SKEW], ids=["plane", "space", "in space"])
def test_a_quadratic_field_on_quadratic_cells_is_reproduced_everywhere(mesh):
    """Values, and slopes along the cells."""
    points, cells = quadratic(*mesh) if mesh[1].shape[1] == mesh[0].shape[1] + 1 else (
        np.vstack([mesh[0], 0.5 * (mesh[0] + np.roll(mesh[0], -1, axis=0))]), np.arange(6)[None]
    )  # fmt: skip
    d = points.shape[1]
    form, slope = RNG.normal(size=(d, d, d)), RNG.normal(size=(d, d))

    def exact(x):
        return np.einsum("cij,ni,nj->nc", form, x, x) + x @ slope.T + 0.3

    field = SolutionField(solution(points, cells, exact(points), order=2))
    corners = mesh[0][mesh[1][RNG.integers(len(mesh[1]), size=300)]]
    x = np.einsum("nk,nkd->nd", RNG.dirichlet(np.ones(corners.shape[1]), 300), corners)
    u, gradient = field.evaluate(x)
    assert u == pytest.approx(exact(x), abs=1e-12)
    expected = np.einsum("cij,nj->nci", form + form.swapaxes(1, 2), x) + slope
    along = corners[:, 1] - corners[:, 0]
    assert np.abs(np.einsum("nci,ni->nc", gradient - expected, along)).max() < 1e-11


@pytest.mark.parametrize("mesh", [grid(7, 5), cube()], ids=["2D", "3D"])
def test_the_cell_found_is_the_one_that_brute_force_finds(mesh):
    points, cells = mesh
    field = SolutionField(solution(points, cells, np.zeros_like(points)))
    x = RNG.random((300, points.shape[1]))
    corners = points[cells]
    edges = corners[:, 1:] - corners[:, :1]
    weights = np.einsum("nmi,mij->nmj", x[:, None] - corners[None, :, 0], np.linalg.inv(edges))
    smallest = np.minimum(weights.min(axis=2), 1 - weights.sum(axis=2))
    assert np.array_equal(field.cells_at(x), smallest.argmax(axis=1))


@pytest.mark.parametrize("mesh", [grid(29, 22), cube()], ids=["2D", "3D"])
def test_the_cell_found_does_not_depend_on_the_points_asked_before(mesh):
    """Points that follow each other from cell to cell, and the same here and there."""
    points, cells = mesh
    field, random = SolutionField(solution(points, cells, np.zeros_like(points))), RNG.spawn(1)[0]
    way = np.linspace(*random.random((2, points.shape[1])), 500)
    order = random.permutation(len(way))
    assert np.array_equal(field.cells_at(way)[order], field.cells_at(way[order]))


@pytest.mark.parametrize("mesh", [grid(3, 4), cube()], ids=["2D", "3D"])
def test_a_point_outside_goes_to_the_nearest_cell(mesh):
    points, cells = mesh
    d = points.shape[1]
    field = SolutionField(solution(points, cells, np.zeros_like(points)))
    x = 3 * RNG.random((200, d)) - 1
    x = x[((x < 0) | (x > 1)).any(axis=1)]
    corners = points[cells[field.cells_at(x)]]
    # the foot on the square is the nearest point, and the cell found must contain it
    foot = np.clip(x, 0, 1)
    edges = corners[:, 1:] - corners[:, :1]
    weights = np.einsum("ni,nij->nj", foot - corners[:, 0], np.linalg.inv(edges))
    assert weights.min() > -1e-12
    assert weights.sum(axis=1).max() < 1 + 1e-12


@pytest.mark.parametrize("gap", [1e-3, 1e-9])
def test_on_a_cut_near_decides_the_side_also_at_slivers(gap):
    # three layers: below y = .5, a sliver, and above; each moved by its own number
    lines = [lambda x: np.full_like(x, 0.5), lambda x: np.full_like(x, 0.5 + gap)]
    points, cells, layer = layered(9, lines)
    field = SolutionField(solution(points, cells, layer[:, None] * np.ones(2)))
    x = np.column_stack([RNG.random(400), np.full(400, 0.5)])
    up = np.array([0.0, 1e-4])
    assert (field.displacement(x, x + up) == 1).all()
    assert (field.displacement(x, x - up) == 0).all()
    inside = x + np.array([0.0, 0.3 * gap])
    assert (field.displacement(inside) == 1).all()
    top = x + np.array([0.0, gap])
    assert (field.displacement(top, top + up) == 2).all()


@pytest.mark.parametrize("thin", [1e-6, 1e-12])
@pytest.mark.parametrize("apex", [0.0, 0.4], ids=["needle", "cap"])
def test_gradients_in_sliver_cells_lose_no_more_than_round_off_over_height(thin, apex):
    points = np.array([[0.0, 0.0], [1.0, 0.0], [apex, thin]])
    slope = np.array([[0.1, 0.2], [0.3, -0.4]])
    field = SolutionField(solution(points, np.array([[0, 1, 2]]), points @ slope.T + 1))
    x = points.mean(axis=0)[None]
    u, gradient = field.evaluate(x)
    assert np.abs(gradient - slope).max() < 4 * np.finfo(float).eps / thin
    assert np.abs(u - x @ slope.T - 1).max() < 1e-15


def turned(points):
    """Turn a mesh out of the axes, so that nothing lies on them."""
    return points @ np.linalg.qr(RNG.normal(size=2 * points.shape[1:]))[0] + 0.3


SLIVER = layered(9, [lambda x: np.full_like(x, 0.5), lambda x: np.full_like(x, 0.5 + 3e-11)])[:2]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("mesh", [grid(7, 5), cube(), SLIVER], ids=["2D", "3D", "thin"])
def test_on_facets_and_edges_the_cell_is_one_that_lies_towards_near(mesh, seed, monkeypatch):
    """A layer thinner than round-off of the search lies between two others as well."""
    monkeypatch.setitem(globals(), "RNG", np.random.default_rng(seed))
    points, cells = turned(mesh[0]), mesh[1]
    d = points.shape[1]
    field = SolutionField(solution(points, cells, np.zeros_like(points)))
    whole = np.flatnonzero(~field.shape.degenerate)
    corners = points[cells[whole[RNG.integers(len(whole), size=900)]]]
    shares = RNG.dirichlet(np.ones(d), 900)
    shares[::9, 0] = 0.0  # on an edge or a corner
    x = np.einsum("nk,nkd->nd", shares / shares.sum(1, keepdims=True), corners[:, :d])
    towards = RNG.normal(size=x.shape)
    found = field.cells_at(x, x + towards)

    normals, corners = field.shape.normals[whole], points[cells[whole]]
    facets = np.roll(corners, -1, axis=1)
    depth = np.einsum("mki,nmki->nmk", normals, x[:, None, None] - facets).min(axis=2)
    close = 1e-10 * field.scale  # a plane of a thin cell is close to points far from it
    off = np.maximum(corners.min(1) - x[:, None], x[:, None] - corners.max(1)).max(axis=2)
    holds = (depth > -close) & (off < close)
    ahead = np.einsum("nmi,ni->nm", corners.mean(axis=1) - x[:, None], towards) > 0
    place = np.searchsorted(whole, found), np.arange(900)
    assert holds[place[::-1]].all()
    could = (holds & ahead).any(axis=1)
    assert could.mean() > 0.4
    assert ahead[place[::-1]][could].all()
