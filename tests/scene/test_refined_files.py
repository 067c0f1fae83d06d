"""Levels of a mesh from a file: the same body with the same groups, and orders against theory."""

import meshio
import numpy as np
import pytest

from verify.exchange import problem_of
from verify.geometry.simplices import measures
from verify.judge.convergence import extrapolate
from verify.scene import load_scene, read_mesh
from verify.scene.parts import pieces_on_part
from verify.solvers import find_solver
from verify.solvers.body_of_scene import background_mesh, material_of
from verify.xfem.mesh import box_mesh, rectangle_mesh

CASE = """
title = "A body from a file, refined"
requirement = "Its answer shall converge."
[geometry]
kind = "file"
file = "body.vtu"
dimension = {d}
[mesh]
pattern = "given"
refine = {refine}
[material]
young = 1e4
poisson = 0.3
density = 1000.0
{plane}
{more}
[[supports]]
where = "{held}"
displacement = {value}
[[cuts]]
{cut}
"""
REGION = '[[material.regions]]\nwhere = "group:part=2"\nyoung = 4e4\n'


def body(d, seed, count):
    """A square or cube: its inner nodes at random, turned; its hard cells, and its low side."""
    mesh = (rectangle_mesh, box_mesh)[d - 2]((count,) * d, (0.0,) * d, (1.0,) * d)
    points, cells = mesh.points, mesh.cells
    rng = np.random.default_rng(seed)
    inner = ((points > 1e-9) & (points < 1 - 1e-9)).all(axis=1)
    points = points + np.where(inner[:, None], rng.uniform(-0.2, 0.2, points.shape) / count, 0.0)
    facets = np.sort(np.concatenate([np.delete(cells, i, axis=1) for i in range(d + 1)]), axis=1)
    low = np.unique(facets[(np.abs(points[:, 0]) < 1e-9)[facets].all(axis=1)], axis=0)
    turn = np.linalg.qr(rng.standard_normal((d, d)))[0]
    return points @ turn, cells, rng.random(len(cells)) < 0.4, low, turn


def cut_across(d, turn, middle=0.47, reach=3.0):
    """An inclined line, or plane, across the unit square or cube; or up to x = `reach`."""
    begin, end = [-1.0, middle - 0.2], [reach, middle + 0.13 * reach]
    if d == 2:
        return f'kind = "polyline"\npoints = {(np.array([begin, end]) @ turn).tolist()}'
    corners = np.array([[*begin, -1.0], [*end, -1.0], [*end, 2.0], [*begin, 2.0]])
    corners[:, 1] += 0.1 * corners[:, 2]
    return f'kind = "polygon"\npoints = {(corners @ turn).tolist()}'


def case(folder, d, mesh, cut, *, refine=2, more=REGION, held="group:part=3", value=None):
    points, cells, hard, low, _ = mesh
    kinds = (("triangle", "line"), ("tetra", "triangle"))[d - 2]
    parts = [np.where(hard, 2, 1), np.full(len(low), 3)]
    flat = np.column_stack([points, np.zeros((len(points), 3 - d))])
    blocks = list(zip(kinds, (cells, low), strict=True))
    meshio.Mesh(flat, blocks, cell_data={"part": parts}).write(folder / "body.vtu")
    text = CASE.format(
        d=d, refine=refine, plane='plane = "strain"' if d == 2 else "", more=more, held=held,
        value=[0.0] * d if value is None else value, cut=cut,
    )  # fmt: skip
    (folder / "case.toml").write_text(text)
    return load_scene(folder / "case.toml")


@pytest.mark.parametrize("d", [2, 3])
def test_body_and_groups_keep_their_measure_and_cells_their_shape(tmp_path, d):
    mesh = body(d, 3, 2)
    scene = case(tmp_path, d, mesh, cut_across(d, mesh[-1]))
    corners = mesh[0][mesh[1]]
    hard, worst = measures(corners[mesh[2]]).sum(), []
    for level in range(scene.mesh.count):
        grid, size = background_mesh(scene, level)
        assert len(grid.cells) == 2 ** (d * level) * len(mesh[1])
        assert grid.measures.sum() == pytest.approx(1.0, rel=1e-13)
        stiff = material_of(scene, grid).mu > 1e4 / 2.6 * 2.0
        assert grid.measures[stiff].sum() == pytest.approx(hard, rel=1e-13)
        facets = np.concatenate([np.delete(grid.cells, i, axis=1) for i in range(d + 1)])
        facets, times = np.unique(np.sort(facets, axis=1), axis=0, return_counts=True)
        assert times.max() == 2  # no node hangs, or else there is more boundary
        rim = grid.points[facets[times == 1]]
        assert measures(rim).sum() == pytest.approx(2.0 * d, rel=1e-13)
        on = pieces_on_part(scene.geometry, "group:part=3", rim).facet
        assert measures(rim[on]).sum() == pytest.approx(1.0, rel=1e-13)
        edges = np.linalg.norm(grid.edge_vectors, axis=2)
        worst.append((grid.measures / edges.max(axis=1) ** d).min())
        assert size == pytest.approx(background_mesh(scene, 0)[1] / 2**level)
    assert worst[2] == pytest.approx(worst[1], rel=1e-9)  # three shapes, on any level
    assert worst[1] > 0.2 * worst[0]


@pytest.mark.parametrize(("d", "solver"), [(2, "xfem"), (3, "xfem"), (2, "conforming")])
def test_a_smooth_field_is_approached_with_the_second_order(tmp_path, d, solver):
    """A quadratic displacement, tractions of it on both faces of an inclined cut: h² in L2."""
    if solver == "conforming":
        pytest.importorskip("dolfinx_solver")
    mesh = body(d, 7, 4 if d == 2 else 2)
    rng = np.random.default_rng(8)
    a, b, c = rng.uniform(-1.0, 1.0, (3, d))
    shear = 1e4 / 2.6
    lam = 2.0 * shear * 0.3 / 0.4
    names = "xyz"[:d]

    def linear(v):
        """Write v·x as a formula."""
        return (
            "(" + " + ".join(f"({w!r}) * {x}" for w, x in zip(v.tolist(), names, strict=True)) + ")"
        )

    # u = (a·x)(b·x) c, so that ∇u = c ⊗ g with g = (b·x) a + (a·x) b, of gradient B
    value = [f"({w!r}) * {linear(a)} * {linear(b)}" for w in c.tolist()]
    gradient = np.outer(a, b) + np.outer(b, a)
    force = -((lam + shear) * gradient @ c + shear * np.trace(gradient) * c)
    cut = cut_across(d, mesh[-1])
    places = np.array(eval(cut.split("points = ")[1]))  # of this test's own text
    spans = np.diff(places, axis=0)
    normal = np.array([-spans[0, 1], spans[0, 0]]) if d == 2 else np.cross(spans[0], spans[1])
    normal = -normal / np.linalg.norm(normal)  # out of the positive side
    traction = gradient @ c  # of σ n = λ (c·g) n + μ (c (g·n) + g (c·n)), with g = B x
    rows = lam * np.outer(normal, traction)
    rows += shear * (np.outer(c, gradient @ normal) + gradient * (c @ normal))
    more = f'[[loads]]\nkind = "body_force"\nforce = {force.tolist()}\n'
    more += f'[[loads]]\nkind = "cut_faces"\ntraction = {[linear(row) for row in rows]}\n'
    scene = case(tmp_path, d, mesh, cut, more=more, held="boundary", value=value)
    errors = []
    for level in range(scene.mesh.count):
        found = find_solver(solver).solve(scene, level, 0)
        corners, moved = found.points[found.cells], found.displacement[0][found.cells]
        # middles of edges: there a linear interpolant of a quadratic is farthest off
        pairs = [(i, j) for j in range(d + 1) for i in range(j)]
        x = np.stack([corners[:, [i, j]].mean(axis=1) for i, j in pairs], axis=1)
        u = np.stack([moved[:, [i, j]].mean(axis=1) for i, j in pairs], axis=1)
        wrong = np.sum((u - (x @ a * (x @ b))[..., None] * c) ** 2, axis=2).mean(axis=1)
        errors.append(np.sqrt(measures(corners) @ wrong))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (np.abs(orders - 2.0) < 0.25).all(), (errors, orders)


def test_a_guest_gets_the_refined_mesh(tmp_path):
    mesh = body(3, 1, 2)
    scene = case(tmp_path, 3, mesh, cut_across(3, mesh[-1]), refine=1)
    problem = problem_of(scene, 1)
    points, cells = read_mesh(scene, 1)
    assert len(cells) == 8 * len(mesh[1])
    np.testing.assert_array_equal(problem.points, points)
    held = np.flatnonzero(np.abs((points @ mesh[-1].T)[:, 0]) < 1e-9)
    assert set(problem.held[0].nodes) == set(held)


@pytest.mark.fenicsx
def test_at_a_tip_energies_are_of_first_order_against_a_graded_reference(tmp_path):
    """λ = ½: the energy of uniform meshes falls short by O(h), of graded P2 by far less.

    Ends of the support (λ about 0.7) matter less from level to level.
    """
    pytest.importorskip("dolfinx_solver")
    mesh = body(2, 5, 4)
    load = '[[loads]]\nkind = "cut_faces"\npressure = 1e3\n'
    scene = case(tmp_path, 2, mesh, cut_across(2, mesh[-1], reach=0.6), refine=3, more=load)

    def energies(name, levels, **given):
        solver = find_solver(name)
        return [float(solver.solve(scene, k, 0, **given).ledger["strain"][0]) for k in levels]

    best = energies("reference", range(1, 3))
    # extended to the far side of its element, the end may lie on either side of where it is asked
    short = best[-1] - np.array(energies("xfem", range(4), tip="inside"))
    orders = np.log2(short[:-1] / short[1:])
    assert orders.mean() == pytest.approx(1.0, abs=0.2), (short, orders)
    assert best[-1] - best[0] < 0.1 * short[-1]


@pytest.mark.fenicsx
def test_where_a_body_turns_in_the_interval_covers_the_value_of_another_mesh(tmp_path):
    """An L, turned, with a cut that ends in an arm: the reference is graded to its inner corner.

    A body described by its corners is meshed and graded anew. Graded to the tip of the cut alone,
    the stated half-width was 1.2e-3, and the energy 3.4e-3 off.
    """
    pytest.importorskip("dolfinx_solver")
    mesh = rectangle_mesh((8, 8), (0.0, 0.0), (1.0, 1.0))
    cells = mesh.cells[(mesh.points[mesh.cells].mean(axis=1) < 0.5).any(axis=1)]
    turn = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]])
    meshio.Mesh(mesh.points @ turn, [("triangle", cells)]).write(tmp_path / "body.vtu")
    x, y = (" + ".join(f"({c!r}) * {n}" for c, n in zip(row, "xy", strict=True))
            for row in turn.tolist())  # fmt: skip
    corners = np.array([[0, 0], [1, 0], [1, 0.5], [0.5, 0.5], [0.5, 1], [0, 1]]) @ turn
    cut = f"points = {(np.array([[0.7, -0.1], [0.74, 0.21]]) @ turn).tolist()}"
    load = f'[[loads]]\nkind = "traction"\nwhere = "{x} > 1.0 - 1e-9"\ntraction = [20.0, 50.0]\n'
    text = CASE.format(d=2, refine=1, plane='plane = "strain"', more=load, value=[0.0, 0.0],
                       held=f"{y} > 1.0 - 1e-9", cut=f'kind = "polyline"\n{cut}')  # fmt: skip
    (tmp_path / "given.toml").write_text(text)
    begin, end = text.index("[geometry]"), text.index("[material]")
    own = f'[geometry]\nkind = "polygon"\ncorners = {corners.tolist()}\n'
    own += '[mesh]\npattern = "unstructured"\nsizes = [0.1]\n'
    (tmp_path / "own.toml").write_text(text[:begin] + own + text[end:])
    solver = find_solver("reference")

    def energy(name, level):
        scene = load_scene(tmp_path / f"{name}.toml")
        return float(solver.solve(scene, level, 0).ledger["strain"][0])

    found = extrapolate([energy("given", level) for level in range(3)], [4, 2, 1], formal=4.0)
    assert abs(energy("own", 1) - found.value) < found.half_width
    assert found.half_width < 5e-4 * found.value


@pytest.mark.fenicsx
def test_in_space_a_body_turns_in_along_edges(tmp_path):
    """A block less a quarter of it: the edge inside, and none where its ends turn by 30°."""
    pytest.importorskip("dolfinx_solver")
    from reference.meshing.inner_lines import singular_lines

    mesh = box_mesh((4, 4, 2), (0.0,) * 3, (1.0,) * 3)
    cells = mesh.cells[(mesh.points[mesh.cells].mean(axis=1)[:, :2] < 0.5).any(axis=1)]
    used, number = np.unique(cells, return_inverse=True)
    points = mesh.points[used]
    points[:, 2] += np.tan(np.pi / 12) * np.abs(points[:, 0] - 0.25)
    turn = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    blocks = [("tetra", number.reshape(-1, 4))]
    meshio.Mesh(points @ turn, blocks).write(tmp_path / "body.vtu")
    text = CASE.format(d=3, refine=1, plane="", more="", held="boundary", value=[0.0] * 3, cut="")
    (tmp_path / "case.toml").write_text(text.split("[[cuts]]")[0])
    scene = load_scene(tmp_path / "case.toml")
    lines = singular_lines(scene, *read_mesh(scene), np.zeros((0, 3), dtype=int)) @ turn.T
    np.testing.assert_allclose(lines[..., :2], 0.5, atol=1e-12)
    assert np.linalg.norm(lines[:, 0] - lines[:, 1], axis=1).sum() == pytest.approx(1.0)
