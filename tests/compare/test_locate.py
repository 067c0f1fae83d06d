from dataclasses import replace

import numpy as np
import pytest
from cut_meshes import cube, grid, layered, quadratic, solution

from verify.compare import cell_tree, locate, sides
from verify.compare.cell_tree import build_cell_tree
from verify.compare.locate import SolutionField
from verify.compare.mass import kinetic
from verify.solution import Solution

RNG = np.random.default_rng(1)


@pytest.fixture(autouse=True, params=[True, False], ids=["kernels", "numpy"])
def compiled(request, monkeypatch):
    """Try both forms of the search: the compiled one, and that of an environment without numba."""
    for module in (cell_tree, locate, sides):
        monkeypatch.setattr(module, "COMPILED", request.param)


def second_degree(points):
    d = points.shape[1]
    a = np.arange(1, d * d * d + 1).reshape(d, d, d) / 7
    b = np.arange(d * d).reshape(d, d) - 1.5
    u = np.einsum("cij,ni,nj->nc", a, points, points) + points @ b.T + 0.3
    gradient = np.einsum("cij,nj->nci", a + np.swapaxes(a, 1, 2), points) + b
    return u, gradient


@pytest.mark.parametrize("mesh", [grid(7, 5), cube()], ids=["2D", "3D"])
def test_a_quadratic_field_on_quadratic_cells_is_reproduced_everywhere(mesh):
    points, cells = quadratic(*mesh)
    field = SolutionField(solution(points, cells, second_degree(points)[0], order=2))
    x = RNG.random((500, points.shape[1]))
    u, gradient = field.evaluate(x)
    exact, exact_gradient = second_degree(x)
    assert np.abs(u - exact).max() < 1e-13
    assert np.abs(gradient - exact_gradient).max() < 1e-12


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


@pytest.mark.parametrize("thin", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("apex", [0.0, 0.4], ids=["needle", "cap"])
def test_gradients_in_sliver_cells_lose_no_more_than_round_off_over_height(thin, apex):
    points = np.array([[0.0, 0.0], [1.0, 0.0], [apex, thin]])
    slope = np.array([[0.1, 0.2], [0.3, -0.4]])
    field = SolutionField(solution(points, np.array([[0, 1, 2]]), points @ slope.T + 1))
    x = points.mean(axis=0)[None]
    u, gradient = field.evaluate(x)
    assert np.abs(gradient - slope).max() < 4 * np.finfo(float).eps / thin
    assert np.abs(u - x @ slope.T - 1).max() < 1e-15


@pytest.mark.parametrize("d", [2, 3])
def test_a_body_pressed_to_nothing_has_a_tree_without_cells(d):
    tree = build_cell_tree(*np.full((2, 5, d), np.nan))
    assert (tree.cells < 0).all()


def test_a_quadratic_field_on_a_quadratic_triangle_in_space_is_reproduced_along_it():
    """Three corners and six nodes, not four and ten: values, and slopes along the surface."""
    corners = np.array([[0.1, 0.2, 0.0], [1.3, 0.1, 0.4], [0.3, 1.1, 0.7]])
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    points, form = np.vstack([corners, middles]), np.random.default_rng(4).normal(size=(3, 3, 3))

    def exact(x):
        return np.einsum("cab,na,nb->nc", form, x, x)

    field = SolutionField(Solution(points, np.arange(6)[None], exact(points)[None], order=2))
    inside = np.random.default_rng(5).dirichlet(np.ones(3), 20) @ corners
    u, gradient = field.evaluate(inside)
    assert u == pytest.approx(exact(inside), abs=1e-13)
    slope = np.einsum("cab,nb->nca", form + form.swapaxes(1, 2), inside)
    for along in corners[1:] - corners[0]:
        assert gradient @ along == pytest.approx(slope @ along, abs=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_the_foot_on_segments_is_the_nearest_of_many_points_on_them(d):
    segments, points = RNG.random((7, 2, d)), 2.0 * RNG.random((50, d)) - 0.5
    segments[3, 1] = segments[3, 0]  # one without a length
    distance, foot, which = sides.nearest_segments(points, segments)
    share = np.linspace(0.0, 1.0, 2001)[:, None, None]
    on_them = (1 - share) * segments[:, 0] + share * segments[:, 1]
    away = np.linalg.norm(points[:, None, None] - on_them, axis=3).min(axis=1)
    spacing = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).max() / 2000
    assert np.allclose(np.linalg.norm(points - foot, axis=1), distance, atol=1e-14)
    assert (distance <= away.min(axis=1) + 1e-14).all()
    assert (distance >= away.min(axis=1) - spacing).all()
    assert (away[np.arange(50), which] <= distance + spacing).all()
    nowhere = sides.nearest_segments(points, segments[:0])
    assert np.isinf(nowhere[0]).all()
    assert (nowhere[2] == -1).all()


@pytest.mark.parametrize("mesh", [grid(5, 4), cube()], ids=["2D", "3D"])
def test_energy_and_momenta_of_a_body_that_flies_and_turns_are_those_of_a_rigid_one(mesh):
    """With the moment of inertia of a unit square or cube about its middle, m / 6."""
    points, cells = mesh
    d = points.shape[1]
    flight, middle = np.arange(1.0, d + 1), np.full(d, 0.5)
    spin = np.array([0.3, -0.2, 0.7]) if d == 3 else np.array([0.0, 0.0, 0.7])
    arms = np.column_stack([points - middle, np.zeros((len(points), 3 - d))])
    velocity = flight + np.cross(spin, arms)[:, :d]
    moved = replace(solution(points, cells, np.zeros_like(points)), velocity=velocity[None])
    found = kinetic(moved, 2.0)
    own = 2.0 / 6.0 * spin[3 - len(found.spin[0]) :]
    about = np.cross(*(np.append(one, np.zeros(3 - d)) for one in (middle, 2.0 * flight)))
    assert found.energy == pytest.approx(flight @ flight + 0.5 * own @ spin[-len(own) :])
    assert found.linear[0] == pytest.approx(2.0 * flight)
    assert found.spin[0] == pytest.approx(own)
    assert found.angular[0] == pytest.approx(own + about[-len(own) :])


@pytest.mark.parametrize("sided", [False, True], ids=["nearest", "on a side"])
def test_the_nearest_triangle_is_the_one_that_points_sampled_on_all_triangles_say(sided):
    corners = RNG.random((40, 1, 3)) + 0.2 * RNG.standard_normal((40, 3, 3))
    sides = RNG.integers(-1, 2, (40, 1)).astype(np.int8) if sided else cell_tree.no_sides(corners)
    x = 3 * RNG.random((200, 3)) - 1
    wanted = RNG.integers(-1, 2, (200, 1)).astype(np.int8) if sided else cell_tree.no_sides(x)
    edges = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    across = np.cross(edges[:, 0], edges[:, 1])
    across /= np.linalg.norm(across, axis=1)[:, None]
    normals = np.cross(across[:, None], edges)
    normals /= np.linalg.norm(normals, axis=2)[..., None]
    # `normals[k]` is that of the edge opposite to the corner k, inwards
    tree = build_cell_tree(corners.min(axis=1), corners.max(axis=1), surface=True)
    found, distance = cell_tree.nearest_triangles(
        x, np.zeros((0, 3)), wanted, tree.over(corners, normals), across, sides, 1e-12
    )
    n = 60
    i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
    shares = np.column_stack([i, j, n - i - j])[i + j <= n] / n
    sampled = np.einsum("sk,mka->msa", shares, corners)
    away = np.linalg.norm(x[:, None, None] - sampled[None], axis=3).min(axis=2)
    away[(wanted[:, None] * sides[None] < 0).any(axis=2)] = np.inf
    longest = np.linalg.norm(edges, axis=2).max(axis=1)
    assert np.all(distance <= away.min(axis=1) + 1e-12)
    # between samples on the triangle that is found the distance is up to their spacing less
    own = away[np.arange(200), found]
    assert np.all(own - distance <= longest[found] / n)
    assert np.all(own - distance >= -1e-12)
