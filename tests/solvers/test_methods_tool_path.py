"""The other ways to cut on a tool path: what opens when, and what goes where."""

import numpy as np
import pytest
from case_texts import cut_text, support_text, weight_text
from tool_path_scenes import (
    BODIES,
    CROSSING,
    KINKED,
    MOTION,
    PLANE,
    SPUN,
    UNSTRUCTURED,
    path_text,
)

from verify.compare.ledger import energy_scale, total_energy
from verify.scene import load_scene
from verify.solvers.interface import find_solver

METHODS = ("virtual_node", "virtual_node_arbitrary", "subdivision", "snapping",
           "snapping_subdivision", "removal", "removal_refined", "mass_spring")  # fmt: skip
KEEPING = [name for name in METHODS if not name.startswith("removal")]


def solve(folder, name, text, **parameters):
    (folder / "tool.toml").write_text(text)
    scene = load_scene(folder / "tool.toml")
    solver = find_solver(name)
    assert solver.refuses(scene) is None
    return solver.solve(scene, 0, 0, **parameters)


@pytest.mark.parametrize("method", KEEPING)
@pytest.mark.parametrize(
    "body", ["plane, curved, unstructured, crossed", "plane, with a cut at a time", "solid"]
)
def test_energies_and_momenta_stay_at_every_opening(tmp_path, openings, body, method):
    text, paths, spin, velocity = BODIES[body]
    motion = MOTION.replace("[analysis]", '[analysis]\nkinematics = "corotational"')
    weight = weight_text(len(velocity.split(",")))
    found = solve(tmp_path, method, text + motion + SPUN % (spin, velocity) + weight + paths)
    assert len(openings) >= 2
    # a part without a node is left with a sibling: if that is across a cut that was open before,
    # this method takes material from one part to another, and the account says what it costs
    moves = method == "virtual_node" and body == "plane, with a cut at a time"
    share = 1e-4 if moves else 1e-12
    for _, (before, after) in openings:
        for one, other in zip(before, after, strict=True):
            np.testing.assert_allclose(other, one, rtol=0.0, atol=share * np.abs(one).max())
    assert np.ptp(found.ledger["total"]) <= 1e-10 * energy_scale(found.ledger)


@pytest.mark.parametrize("method", ["removal", "removal_refined"])
@pytest.mark.parametrize("body", ["plane, curved, unstructured, crossed", "solid"])
def test_what_is_removed_takes_its_mass_and_energy_with_it_by_name(tmp_path, body, method):
    text, paths, spin, velocity = BODIES[body]
    weight = weight_text(len(velocity.split(",")))
    paths = paths.replace("[-0.05, 0.1, ", "[0.02, 0.1, ")  # else some is never there
    found = solve(tmp_path, method, text + MOTION + SPUN % (spin, velocity) + weight + paths)
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


@pytest.mark.parametrize("body", ["plane, curved, unstructured, crossed", "solid"])
def test_virtual_nodes_with_shares_are_xfem_on_a_path_too(tmp_path, body):
    text, paths, spin, velocity = BODIES[body]
    asked = text + MOTION + SPUN % (spin, velocity) + paths
    ours, theirs = (solve(tmp_path, name, asked) for name in ("xfem", "virtual_node_arbitrary"))
    np.testing.assert_array_equal(ours.points, theirs.points)
    np.testing.assert_allclose(
        ours.displacement, theirs.displacement, atol=1e-12 * np.abs(ours.displacement).max()
    )


@pytest.mark.parametrize("method", ["subdivision", "snapping", "snapping_subdivision"])
def test_a_finished_mesh_is_welded_ahead_of_the_blade_and_open_behind_it(tmp_path, method):
    text = UNSTRUCTURED + MOTION + KINKED + weight_text() + support_text("top", [0, 0])
    found = solve(tmp_path, method, text)
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


@pytest.mark.parametrize("method", [*METHODS, "uncut"])
def test_a_cut_is_opened_after_an_equilibrium_with_closed_cuts(tmp_path, openings, method):
    """Until it opens nothing moves, whichever mesh it will open; then it does, but for `uncut`."""
    stretched = (
        '[initial]\nkind = "equilibrium"\n'
        + support_text("left", [-0.02, 0.01]) + support_text("right", [0.02, 0.0])
    )  # fmt: skip
    cut = cut_text([0.3, 0.75], [0.42, 0.27]) + "opens_at = 0.1\n"
    found = solve(tmp_path, method, UNSTRUCTURED + MOTION + stretched + cut, scheme="newmark")
    rest = found.displacement[1] - found.displacement[0]
    scale = np.abs(found.displacement[0]).max()
    assert np.abs(rest).max() <= 1e-9 * scale
    if method == "uncut":
        assert np.abs(found.displacement[-1] - found.displacement[0]).max() <= 1e-9 * scale
        return
    assert len(openings) == 1
    assert np.abs(found.displacement[-1] - found.displacement[0]).max() > 0.05 * scale


@pytest.mark.parametrize("method", METHODS)
def test_every_method_is_cut_twice_and_its_parts_fall(tmp_path, method):
    """Two paths that cross; in the end four parts, two of them held by nothing."""
    paths = path_text([[-0.1, 0.3], [1.1, 0.42]], [-0.05, 0.1]) + CROSSING
    text = (
        PLANE + MOTION.replace("0.3", "0.4") + paths + weight_text() + support_text("top", [0, 0])
    )
    found = solve(tmp_path, method, text)
    lowest = found.points[:, 1] < 1e-9
    fallen = found.displacement[-1, lowest, 1]
    # from 0.12 s on nothing holds the lower parts; before that they hung for a while
    assert (fallen < -0.5 * 9.8 * 0.25**2).all()
    assert (fallen > -0.5 * 9.8 * 0.4**2 * 1.1).all()
