"""Scenes in space through the adapter: discs, cylinders, sweeps, membranes, mesh files."""

import meshio
import numpy as np
import pytest
from case_texts import body_text, cut_text, sheet_text, support_text, weight_text

from verify.scene import load_scene
from verify.solvers.xfem import XfemSolver
from verify.xfem.mesh import rectangle_mesh

CUBE = body_text(
    "A cube", "It shall be cut.", [1.0, 1.0, 1.0], [[4, 4, 4], [8, 8, 8]], density="1.0"
)
PULLED = support_text("bottom", [0, 0, 0]) + support_text("top", [0, 0, 0.1])
ENDS = support_text("boundary", [0, 0, 0])


def scene(folder, text):
    (folder / "space.toml").write_text(text)
    return load_scene(folder / "space.toml")


def disc(radius, normal="0.0, 0.0, 1.0", height=0.53):
    place = f"centre = [0.5, 0.5, {height}]\nnormal = [{normal}]"
    return f'[[cuts]]\nkind = "disc"\n{place}\nradius = {radius}\n'


def areas(facets):
    """Areas of triangles (f, 3, 3), or lengths of segments (f, 2, 3)."""
    edges = facets[:, 1:] - facets[:, :1]
    return np.sqrt(np.linalg.det(edges @ edges.transpose(0, 2, 1))) / (facets.shape[1] - 1)


def volume(solution):
    corners = solution.points[solution.cells]
    return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6


def deviation(solution, level_set):
    return np.abs(level_set(solution.cut_facets.reshape(-1, 3))).max()


@pytest.mark.parametrize("tip, inside, outside", [("inside", 2.0, 0.0), ("extended", 0.0, 2.0)])
def test_a_disc_is_cut_in_its_plane_and_ends_within_elements_of_its_rim(
    tmp_path, tip, inside, outside
):
    """Elements in which the rim ends are whole, or divided: the rim moves by up to √2 h."""
    content = CUBE + PULLED + disc(0.3, "0.1, 0.0, 1.0")
    found = XfemSolver().solve(scene(tmp_path, content), 1, tip=tip)
    normal = np.array([0.1, 0.0, 1.0]) / np.hypot(0.1, 1.0)
    assert deviation(found, lambda x: (x - [0.5, 0.5, 0.53]) @ normal) <= 1e-12
    reach = np.linalg.norm(found.cut_facets.reshape(-1, 3) - [0.5, 0.5, 0.53], axis=1).max()
    edge = 0.125 * np.sqrt(2)
    assert reach <= 0.3 + outside * edge + 1e-12
    area = areas(found.cut_facets).sum()
    assert np.pi * (0.3 - inside * edge) ** 2 < area < np.pi * (0.3 + outside * edge) ** 2
    assert (area > np.pi * 0.09) == (tip == "extended")
    assert volume(found) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("sweep, expected", [(360.0, 2 * np.pi * 0.3), (180.0, np.pi * 0.3)])
def test_a_cylinder_cuts_its_mantle(tmp_path, sweep, expected):
    """Faceted in each element: area and distance differ by O(h²/R)."""
    cut = (
        '[[cuts]]\nkind = "cylinder"\nbase = [0.52, 0.51, -0.1]\naxis = [0.0, 0.0, 2.0]\n'
        f"radius = 0.3\nheight = 1.2\ntowards = [1.0, 0.0, 0.0]\nsweep = {sweep}\n"
    )
    found = XfemSolver().solve(scene(tmp_path, CUBE + ENDS + cut), 1, tip="nearest")
    off = deviation(found, lambda x: np.hypot(x[:, 0] - 0.52, x[:, 1] - 0.51) - 0.3)
    assert off <= 0.125**2 / 0.3
    # a sector ends inside elements, at each of its two ends within about an element
    assert areas(found.cut_facets).sum() == pytest.approx(expected, abs=0.02 + (sweep < 360) * 0.25)
    if sweep == 180.0:
        assert found.cut_facets[..., 1].min() >= 0.51 - 0.125 * np.sqrt(2)


def test_two_halves_of_a_cube_turn_apart_without_strain(tmp_path):
    """Corotational: the part of the boundary that is turned ends at the cut, inside elements."""
    cut = (
        '[[cuts]]\nkind = "polygon"\n'
        "points = [[-0.1, -0.1, 0.53], [1.1, -0.1, 0.53], [1.1, 1.1, 0.57], [-0.1, 1.1, 0.57]]\n"
    )
    above = "z > 0.53 + 0.04 * (y + 0.1) / 1.2"
    turned = (
        '[analysis]\nkinematics = "corotational"\n'
        f'[[supports]]\nwhere = "{above.replace(">", "<")}"\n'
        f'displacement = [0.0, 0.0, 0.0]\n[[supports]]\nwhere = "{above}"\n'
        "displacement = [0.1, 0.0, 0.2]\n"
        "rotation = { angle = 70.0, centre = [0.5, 0.5, 0.5], axis = [1.0, 1.0, 1.0] }\n"
    )
    found = XfemSolver().solve(scene(tmp_path, CUBE + turned + cut), 0)
    assert found.ledger["strain"][0] <= 1e-20
    assert np.linalg.norm(found.displacement[0], axis=1).max() > 0.5


MEMBRANE = (
    sheet_text("A sheet in space", "It shall be cut.")
    + '[analysis]\nkind = "dynamic"\nkinematics = "corotational"\n'
    + "duration = 0.5\ntime_step = 0.01\noutputs = 3\n"
    + support_text("x < 1e-9", [0, 0, 0])
    + weight_text(3)
)
ACROSS = cut_text([0.47, -0.1, -1.0], [0.43, 1.1, -1.0], [0.43, 1.1, 1.0], [0.47, -0.1, 1.0])


def sheet(folder, height):
    mesh = rectangle_mesh([6, 6])
    points = np.column_stack([mesh.points, height(*mesh.points.T)])
    meshio.Mesh(points, [("triangle", mesh.cells)]).write(folder / "sheet.vtu")


def test_a_piece_cut_off_a_membrane_falls(tmp_path):
    sheet(tmp_path, lambda x, y: 0.1 * np.sin(3 * x) * y)
    found = XfemSolver().solve(scene(tmp_path, MEMBRANE + ACROSS), 0, 0)
    assert (found.dimension, found.cell_dimension, found.cut_facets.shape[1]) == (3, 2, 2)
    free = found.points[:, 0] > 0.6
    np.testing.assert_allclose(found.displacement[-1][free][:, 2], -1.225, rtol=1e-8)
    # the sheet that is cut: its length between the sides
    assert areas(found.cut_facets).sum() == pytest.approx(np.hypot(1.0, 0.04), rel=0.02)


def test_a_flat_membrane_without_tension_sags_as_one_that_is_hardly_curved(tmp_path):
    """At first nothing resists its inner nodes across its plane."""
    text = MEMBRANE
    for gone in ('kind = "dynamic"\n', "duration = 0.5\ntime_step = 0.01\noutputs = 3"):
        text = text.replace(gone, "", 1)
    energies = []
    for height in (0.0, 1e-6):
        sheet(tmp_path, lambda x, y, height=height: -height * np.sin(3 * x) * np.sin(3 * y))
        found = XfemSolver().solve(scene(tmp_path, text.replace("x < 1e-9", "boundary")), 0, 0)
        assert -0.5 < found.displacement[-1][:, 2].min() < -0.05
        energies.append(found.ledger["strain"][-1])
    assert energies[1] == pytest.approx(energies[0], rel=1e-4)
