"""Blades: energies and momenta at every opening, elements and edges that open, by every method."""

import meshio
import numpy as np
import pytest
from case_texts import cut_text, sheet_text, support_text, weight_text
from tool_path_scenes import (
    BODIES,
    CROSSING,
    INCLINED,
    KINKED,
    MOTION,
    PLANE,
    SPUN,
    UNSTRUCTURED,
    path_text,
)

from verify.compare.mass import separated_parts
from verify.compare.motion_account import energy_scale, total_energy
from verify.scene import load_scene
from verify.solvers.body_of_scene import Openings
from verify.solvers.interface import find_solver
from verify.solvers.xfem import XfemSolver
from verify.xfem.cuts import Polyline
from verify.xfem.mesh import rectangle_mesh
from verify.xfem.phantom import cut_mesh


def solve(folder, text, **parameters):
    (folder / "tool.toml").write_text(text)
    return XfemSolver().solve(load_scene(folder / "tool.toml"), 0, 0, **parameters)


def test_a_membrane_is_cut_in_motion(tmp_path, openings):
    mesh = rectangle_mesh((8, 6), (0, 0), (1.0, 0.8))
    points = np.column_stack([mesh.points, 0.1 * np.sin(2.0 * mesh.points[:, 0])])
    meshio.Mesh(points, [("triangle", mesh.cells)]).write(tmp_path / "sheet.vtu")
    blade = path_text([[-0.1, 0.32, -0.5], [1.1, 0.55, -0.5]], [0.0, 0.25], (1.0, [0.0, 0.1, 1.0]))
    motion = MOTION.replace("[analysis]", '[analysis]\nkinematics = "corotational"')
    held = support_text("x < 1e-9") + support_text("x > 1.0 - 1e-9")
    found = solve(
        tmp_path, sheet_text("A sheet", "It moves.") + held + motion + weight_text(3) + blade
    )
    assert len(openings) >= 4
    for _, (before, after) in openings:
        for one, other in zip(before, after, strict=True):
            np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-12 * np.abs(one).max())
    assert np.ptp(found.ledger["total"]) <= 1e-10 * found.ledger["kinetic"].max()


def test_an_element_opens_when_the_blade_has_passed_all_edges_that_it_crosses(tmp_path):
    """A straight blade at constant speed: the time of a place is its distance along the path."""
    (tmp_path / "rule.toml").write_text(PLANE + MOTION + INCLINED)
    scene = load_scene(tmp_path / "rule.toml")
    mesh = rectangle_mesh((9, 6), (0, 0), (1.0, 0.7))
    start, end = np.array([-0.1, 0.21]), np.array([1.1, 0.52])
    phantom = cut_mesh(mesh, [Polyline([start, end])])
    times = Openings(scene.cuts, [], [0.0]).of_cells(phantom).times[:, 0]
    along, length = (end - start) / np.linalg.norm(end - start), np.linalg.norm(end - start)
    split = np.bincount(phantom.parent) > 1
    assert (np.isnan(times) == ~split).all()
    sub = phantom.sub_cells
    for cell in np.flatnonzero(split):
        corners = sub.points[np.isin(sub.piece, np.flatnonzero(phantom.parent == cell))]
        new = sub.zero_points.positions[np.unique(corners[corners >= len(mesh.points)])]
        expected = -0.05 + 0.3 * (((new - start) @ along) / length).max()
        assert abs(times[cell] - expected) < 1e-12


def test_a_cut_along_element_edges_opens_with_the_blade(tmp_path, openings):
    """Here no element is divided: those on one side let go of the others as the blade passes."""
    along = path_text([[-0.1, 0.35], [1.1, 0.35]], [0.0, 0.25])
    text = PLANE.replace("[[9, 6]]", "[[9, 4]]")
    found = solve(tmp_path, text + MOTION + along + weight_text() + support_text("top", [0, 0]))
    assert len(openings) >= 6
    assert np.isclose(found.times[1], 0.1)

    def gap(x):
        lips = np.flatnonzero(np.linalg.norm(found.points - [x, 0.35], axis=1) < 1e-9)
        return np.ptp(found.displacement[1, lips, 1])

    # at 0.1 s the blade is at x = 0.38
    assert gap(0.0) > 1e-3
    assert gap(1.0) == 0.0
    energy = found.ledger["kinetic"].max()
    assert np.ptp(found.ledger["total"]) <= 1e-10 * energy


def solve_by(folder, name, text, **parameters):
    (folder / "tool.toml").write_text(text)
    scene = load_scene(folder / "tool.toml")
    solver = find_solver(name)
    assert solver.refuses(scene) is None
    return solver.solve(scene, 0, 0, **parameters)


@pytest.mark.parametrize(
    ("body", "method"),
    [("solid", "removal"), ("plane, curved, unstructured, crossed", "removal_refined")],
)
def test_what_is_removed_takes_its_mass_and_energy_with_it_by_name(tmp_path, body, method):
    text, paths, spin, velocity = BODIES[body]
    weight = weight_text(len(velocity.split(",")))
    paths = paths.replace("[-0.05, 0.1, ", "[0.02, 0.1, ")  # else some is never there
    found = solve_by(tmp_path, method, text + MOTION + SPUN % (spin, velocity) + weight + paths)
    ledger, scale = found.ledger, energy_scale(found.ledger)
    assert np.ptp(ledger["total"]) <= 1e-10 * scale
    assert np.ptp(total_energy(ledger, scheme=True)) <= 1e-10 * scale
    assert np.ptp(total_energy(ledger)) > 1e-3 * scale
    gone = ledger["removed_mass"]
    volumes = {one.kind: one.size for one in found.regularisations}
    expected = 1e3 * sum(size for kind, size in volumes.items() if "volume in all" in kind)
    assert gone[-1] == pytest.approx(expected, rel=1e-12)
    assert (np.diff(gone) >= 0.0).all()
    assert gone[0] < 0.5 * gone[-1]


@pytest.mark.parametrize("method", ["subdivision", "snapping"])
def test_a_finished_mesh_is_welded_ahead_of_the_blade_and_open_behind_it(tmp_path, method):
    text = UNSTRUCTURED + MOTION + KINKED + weight_text() + support_text("top", [0, 0])
    found = solve_by(tmp_path, method, text)
    assert np.isclose(found.times[1], 0.1)
    _, place = np.unique(found.points, axis=0, return_inverse=True)
    order = np.argsort(place.ravel(), kind="stable")
    twins = np.flatnonzero(np.diff(place.ravel()[order]) == 0)
    one, other = order[twins], order[twins + 1]
    gap = np.linalg.norm(found.displacement[1, one] - found.displacement[1, other], axis=1)
    x = found.points[one, 0]
    # at 0.1 s the blade is at x = 0.45; a facet opens with its last corner, a step later at most
    assert gap[x > 0.46].max() <= 1e-15
    assert gap[x < 0.2].max() > 1e-4
    last = np.linalg.norm(found.displacement[-1, one] - found.displacement[-1, other], axis=1)
    assert last[x > 0.46].max() > 1e-3


@pytest.mark.parametrize(
    "method", ["virtual_node", "snapping_subdivision", "removal", "mass_spring", "uncut"]
)
def test_a_cut_is_opened_after_an_equilibrium_with_closed_cuts(tmp_path, openings, method):
    """Until it opens nothing moves, whichever mesh it will open; then it does, but for `uncut`."""
    stretched = (
        '[initial]\nkind = "equilibrium"\n'
        + support_text("left", [-0.02, 0.01]) + support_text("right", [0.02, 0.0])
    )  # fmt: skip
    cut = cut_text([0.3, 0.75], [0.42, 0.27]) + "opens_at = 0.1\n"
    found = solve_by(tmp_path, method, UNSTRUCTURED + MOTION + stretched + cut, scheme="newmark")
    rest = found.displacement[1] - found.displacement[0]
    scale = np.abs(found.displacement[0]).max()
    assert np.abs(rest).max() <= 1e-9 * scale
    if method == "uncut":
        assert np.abs(found.displacement[-1] - found.displacement[0]).max() <= 1e-9 * scale
        return
    assert len(openings) == 1
    assert np.abs(found.displacement[-1] - found.displacement[0]).max() > 0.05 * scale


@pytest.mark.parametrize(
    "method", ["virtual_node_arbitrary", "snapping", "removal_refined", "mass_spring"]
)
def test_a_method_is_cut_twice_and_its_parts_fall(tmp_path, method):
    """Two paths that cross; in the end four parts, two of them held by nothing."""
    paths = path_text([[-0.1, 0.3], [1.1, 0.42]], [-0.05, 0.1]) + CROSSING
    text = (
        PLANE + MOTION.replace("0.3", "0.4") + paths + weight_text() + support_text("top", [0, 0])
    )
    found = solve_by(tmp_path, method, text)
    lowest = found.points[:, 1] < 1e-9
    fallen = found.displacement[-1, lowest, 1]
    # from 0.12 s on nothing holds the lower parts; before that they hung for a while
    assert (fallen < -0.5 * 9.8 * 0.25**2).all()
    assert (fallen > -0.5 * 9.8 * 0.4**2 * 1.1).all()


@pytest.mark.parametrize("solver", ["xfem", "virtual_node"])
@pytest.mark.parametrize("mesh", [PLANE, UNSTRUCTURED], ids=["regular", "free"])
def test_a_blade_crosses_a_cut_that_opens_after_it_has_set_out(tmp_path, openings, solver, mesh):
    """Cuts are kept in the order in which they set out; in some elements the later opens first.

    What it leaves whole there is no longer divided by the other one, on whose side it lies.
    """
    slit = cut_text([-0.1, 0.31], [1.1, 0.36]) + 'name = "slit"\nopens_at = 0.07\n'
    blade = path_text([[0.41, 0.8], [0.52, -0.1]], [0.05, 0.2], name="blade")
    text = mesh + MOTION + SPUN % ("3.0", "[0.2, 0.1]") + weight_text() + slit + blade
    found = solve_by(tmp_path, solver, text)
    assert len(openings) >= 4
    for _, (before, after) in openings:
        for one, other in zip(before, after, strict=True):
            np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-12 * np.abs(one).max())
    assert np.ptp(found.ledger["total"]) <= 1e-10 * found.ledger["kinetic"].max()
    assert len(separated_parts(found, 1e3)) == 4
