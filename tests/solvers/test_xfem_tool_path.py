"""A body that moves while a blade goes through it: when elements open, and what stays then."""

import meshio
import numpy as np
import pytest
from case_texts import sheet_text, support_text, weight_text
from tool_path_scenes import (
    BODIES,
    INCLINED,
    KINKED,
    MOTION,
    PLANE,
    SPUN,
    UNSTRUCTURED,
    path_text,
)

from verify.scene import load_scene
from verify.solvers.openings_of_scene import opening_times
from verify.solvers.xfem import XfemSolver
from verify.solvers.xfem_steps import SCHEMES
from verify.xfem.cuts import Polyline
from verify.xfem.phantom import cut_mesh
from verify.xfem.structured_meshes import rectangle_mesh


def solve(folder, text, **parameters):
    (folder / "tool.toml").write_text(text)
    return XfemSolver().solve(load_scene(folder / "tool.toml"), 0, 0, **parameters)


@pytest.mark.parametrize("kinematics", ["linear", "corotational"])
@pytest.mark.parametrize("mass", ["sidewise", "consistent"])
@pytest.mark.parametrize("body", BODIES)
def test_energies_and_momenta_stay_at_every_opening(tmp_path, openings, body, mass, kinematics):
    """The inherited field is the field: the same to round-off, whatever is opened and how.

    The balance of the run is closed as far as Newton's method is converged: 1e-10 of the forces.
    """
    text, paths, spin, velocity = BODIES[body]
    motion = MOTION.replace("[analysis]", f'[analysis]\nkinematics = "{kinematics}"')
    weight = weight_text(len(velocity.split(",")))
    found = solve(tmp_path, text + motion + SPUN % (spin, velocity) + weight + paths, mass=mass)
    assert len(openings) >= 4
    for _, (before, after) in openings:
        for one, other in zip(before, after, strict=True):
            scale = np.abs(one).max()
            np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-12 * scale)
    energy = max(np.abs(found.ledger[name]).max() for name in ("kinetic", "strain"))
    assert np.ptp(found.ledger["total"]) <= 1e-10 * energy
    assert np.abs(found.ledger["unbalanced"]).max() <= 1e-10 * energy


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("kinematics", ["linear", "corotational"])
def test_every_scheme_cuts_in_motion_with_a_closed_balance(tmp_path, openings, scheme, kinematics):
    motion = MOTION.replace("[analysis]", f'[analysis]\nkinematics = "{kinematics}"')
    if scheme == "forward_euler":  # unstable without damping: short
        motion = motion.replace("0.02", "0.0005")
    text = UNSTRUCTURED + support_text("top", [0, 0]) + weight_text() + KINKED + motion
    found = solve(tmp_path, text, scheme=scheme)
    assert len(openings) >= 6
    energy = max(np.abs(found.ledger[name]).max() for name in ("kinetic", "strain", "gravity"))
    assert np.ptp(found.ledger["total"]) <= 1e-10 * energy
    assert np.abs(found.ledger["unbalanced"]).max() <= 1e-10 * energy
    held = found.points[:, 1] > 0.699
    assert np.abs(found.displacement[-1][~held]).max() > 0.01


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
    times = opening_times(scene.cuts, phantom, [0.0])[:, 0]
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


@pytest.mark.parametrize("slivers", ["merge", "drop", "penalise"])
def test_sliver_policies_go_with_a_blade(tmp_path, slivers):
    """What a policy changes at an opening is in the account, under the scheme's name."""
    text = PLANE + MOTION + INCLINED + weight_text() + support_text("top", [0, 0])
    found = solve(tmp_path, text, slivers=slivers)
    energy = found.ledger["kinetic"].max()
    assert np.ptp(found.ledger["total"]) <= 1e-10 * energy
    kept = solve(tmp_path, text)
    top = np.abs(kept.displacement[-1]).max()
    assert abs(np.abs(found.displacement[-1]).max() - top) < 0.1 * top
