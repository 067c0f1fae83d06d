"""A dynamic scene through the adapter: what falls, what waits, what is kept, what is accounted."""

import numpy as np
import pytest
from case_texts import body_text, cut_text, support_text, weight_text

from verify.scene import load_scene
from verify.solvers import find_solver
from verify.solvers.xfem import XfemSolver

SQUARE = (
    body_text("A square in motion", "It shall move.", [1.0, 1.0], [[8, 8]], "1e4", density="1000.0")
    + '[analysis]\nkind = "dynamic"\nduration = 0.5\ntime_step = 0.01\noutputs = 6\n'
)
HELD = support_text("top", [0, 0])
WEIGHT = weight_text()
CUT = cut_text([-0.1, 0.45], [1.1, 0.41])


def solve(folder, text, *changes, **parameters):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "motion.toml").write_text(text)
    return XfemSolver().solve(load_scene(folder / "motion.toml"), 0, 0, **parameters)


def below(solution, y=0.05):
    return solution.displacement[:, solution.points[:, 1] < y]


@pytest.mark.parametrize(
    "scheme, fallen, kinematics",
    [
        ("newmark", -1.225, "linear"), ("energy_momentum", -1.225, "corotational"),
        ("central_differences", -1.225, "linear"), ("implicit_euler", -1.2495, "corotational"),
        ("symplectic_euler", -1.2495, "corotational"), ("forward_euler", -1.2005, "linear"),
    ],
)  # fmt: skip
def test_a_freed_half_falls_by_the_parabola_of_its_scheme(tmp_path, scheme, fallen, kinematics):
    """Independent of where the cut passes; the discrete parabola is known in closed form."""
    way = ("[analysis]", f'[analysis]\nkinematics = "{kinematics}"')
    found = solve(tmp_path, SQUARE + HELD + WEIGHT + CUT, way, scheme=scheme)
    # Newton stops at 1e-10 of the forces, at 50 steps; forward Euler amplifies round-off
    tolerance = 1e-9
    np.testing.assert_allclose(below(found)[-1][:, 1], fallen, rtol=tolerance)
    np.testing.assert_allclose(below(found)[-1][:, 0], 0.0, atol=tolerance)


@pytest.mark.parametrize("mass, alike", [("sidewise", True), ("consistent", True),
                                         ("thesis", False), ("row_sum", False)])  # fmt: skip
def test_only_a_mass_that_belongs_to_its_side_lets_the_half_fall_freely(tmp_path, mass, alike):
    found = solve(tmp_path, SQUARE + HELD + WEIGHT + CUT, mass=mass)
    fallen = below(found)[-1][:, 1].mean()
    assert (abs(fallen + 1.225) < 1e-6) == alike


def test_the_account_of_a_motion_is_closed_and_names_what_it_holds(tmp_path):
    damped = ("outputs = 6", "outputs = 6\ndamping = [0.5, 1e-3]")
    pulled = '[[loads]]\nkind = "traction"\nwhere = "bottom"\ntraction = [300.0, 0.0]\n'
    found = solve(tmp_path, SQUARE + HELD + WEIGHT + pulled, damped, scheme="implicit_euler")
    ledger = found.ledger
    assert set(ledger) == {
        "kinetic", "strain", "gravity", "work_of_loads", "work_of_supports", "damping",
        "algorithmic", "unbalanced", "total", "linear_momentum_x", "linear_momentum_y",
        "angular_momentum_z",
    }  # fmt: skip
    assert {len(column) for column in ledger.values()} == {6}
    scale = max(np.abs(ledger[name]).max() for name in ("kinetic", "strain", "gravity"))
    assert np.ptp(ledger["total"]) <= 1e-8 * scale  # Newton's residual, 1e-10 of the forces
    assert ledger["damping"][-1] > 0.01 * scale
    assert ledger["algorithmic"][-1] > 0.01 * scale
    assert ledger["work_of_loads"][-1] > 0.0


def test_before_a_cut_opens_its_two_sides_move_together(tmp_path):
    text = SQUARE + HELD + WEIGHT + CUT
    waits = solve(tmp_path, text, ("[1.1, 0.41]]", "[1.1, 0.41]]\nopens_at = 0.2"))
    never = solve(tmp_path, SQUARE + HELD + WEIGHT)
    # outputs at 0, 0.1 and 0.2 are those of the uncut body, on the mesh of the cut one
    assert len(waits.points) > len(never.points)
    low = (waits.points[:, 1] < 1e-9) & (waits.points[:, 0] < 1e-9)
    corner = (never.points[:, 1] < 1e-9) & (never.points[:, 0] < 1e-9)
    np.testing.assert_allclose(
        waits.displacement[:3, low][:, 0], never.displacement[:3, corner][:, 0]
    )
    assert not np.allclose(waits.displacement[-1, low], never.displacement[-1, corner])
    # points of the cut are there twice, once on each side
    _, first, twin = np.unique(
        np.round(waits.points, 9), axis=0, return_index=True, return_inverse=True
    )
    apart = waits.displacement - waits.displacement[:, first[twin.ravel()]]
    gaps = np.linalg.norm(apart, axis=2).max(axis=1)
    assert gaps[:3].max() <= 1e-12
    assert (gaps[3:] > 1e-3).all()


@pytest.mark.parametrize(  # of the duration
    "name, off",
    [("xfem", -8e-10), ("xfem", 3e-12), ("conforming", 8e-10), ("subdivision", 1e-10)],
)
def test_a_cut_that_opens_just_beside_an_output_opens_at_it(tmp_path, name, off):
    """Though a load jumps at the output: nothing is late by a step, or put out twice."""
    pulled = '[[loads]]\nkind = "traction"\nwhere = "bottom"\ntraction = [300.0, 0.0]\n'
    load, found = WEIGHT + pulled + "history = [[0.2, 1.0], [0.2, 0.9]]\n", []
    for time in (0.2, 0.2 + 0.5 * off):
        cut = CUT.replace("[1.1, 0.41]]", f"[1.1, 0.41]]\nopens_at = {time!r}")
        (tmp_path / "motion.toml").write_text(SQUARE + HELD + cut + load)
        found.append(find_solver(name).solve(load_scene(tmp_path / "motion.toml"), 0, 0))
    at, beside = found
    np.testing.assert_allclose(beside.displacement, at.displacement, atol=1e-8)
    np.testing.assert_allclose(beside.velocity, at.velocity, atol=1e-7)
    for name, column in at.ledger.items():
        np.testing.assert_allclose(beside.ledger[name], column, atol=1e-6 * 9800.0)


def test_a_cut_that_opens_at_once_releases_the_equilibrium_of_the_uncut_body(tmp_path):
    """A prestrained bar: either face moves at c_d ε0 until the wave is back from the far end."""
    bar = SQUARE.replace("upper = [1.0, 1.0]", "upper = [1.0, 0.1]").replace(
        "[[8, 8]]", "[[80, 8]]"
    )
    bar = bar.replace("duration = 0.5", "duration = 0.2").replace("0.01", "0.001")
    text = (
        bar
        + """
[initial]
kind = "equilibrium"
[[supports]]
where = "left"
displacement = [-0.005]
components = ["x"]
[[supports]]
where = "right"
displacement = [0.005]
components = ["x"]
[[supports]]
where = "top"
displacement = [0.0]
components = ["y"]
[[supports]]
where = "bottom"
displacement = [0.0]
components = ["y"]
[[cuts]]
kind = "polyline"
points = [[0.503, -0.1], [0.503, 0.2]]
"""
    )
    found = solve(tmp_path, text, scheme="central_differences")
    speed = np.sqrt((1e4 * 0.7 / (1.3 * 0.4)) / 1000.0) * 0.01
    face = np.abs(found.points[:, 0] - 0.503) < 1e-9
    moved = found.displacement[-1, face, 0] - found.displacement[0, face, 0]
    assert found.ledger["strain"][0] == pytest.approx(0.5 * 1e4 * 0.7 / 0.52 * 1e-4 * 0.1)
    # half of the nodes on either side; the P1 front is spread over a few elements of 12.5 mm
    np.testing.assert_allclose(np.abs(moved), speed * 0.2, rtol=0.03)
    assert sorted(np.sign(moved).tolist()) == [-1.0] * (len(moved) // 2) + [1.0] * (len(moved) // 2)


def test_a_cut_body_that_spins_freely_keeps_its_momenta_and_its_energy(tmp_path):
    """Its halves part, so only the sums are constant; of an energy-momentum scheme all three."""
    centre = [0.0, 0.0]
    spinning = f'[initial]\nkind = "moving"\nspin = 2.0\ncentre = {centre}\nvelocity = [1.0, 0.0]\n'
    turning = ("[analysis]", '[analysis]\nkinematics = "finite_rotation"')
    found = solve(tmp_path, SQUARE + spinning + CUT, turning, scheme="energy_momentum")
    ledger, mass = found.ledger, 1000.0
    # v = (1, 0) + 2 × arm: of the centroid, and about it with the inertia m/6 of a unit square,
    # to which lumping at the nodes adds O(h²)
    arm = np.array([0.5, 0.5]) - centre
    speed = np.array([1.0, 0.0]) + 2.0 * np.array([-arm[1], arm[0]])
    energy = 0.5 * mass * speed @ speed + 0.5 * mass / 6 * 4.0
    assert ledger["kinetic"][0] == pytest.approx(energy, rel=0.02)
    np.testing.assert_allclose(ledger["linear_momentum_x"], mass * speed[0], atol=1e-6 * mass)
    np.testing.assert_allclose(ledger["linear_momentum_y"], mass * speed[1], atol=1e-6 * mass)
    turn = ledger["angular_momentum_z"]
    assert np.ptp(turn) <= 1e-8 * mass
    assert np.ptp(ledger["kinetic"] + ledger["strain"]) <= 1e-8 * energy


def test_a_support_follows_its_history_and_a_load_jumps(tmp_path):
    text = (
        SQUARE
        + """
[[supports]]
where = "boundary"
displacement = [0.1, 0.2]
rotation = { angle = 90.0, centre = [0.0, 0.0] }
history = [[0.1, 0.0], [0.3, 1.0]]
"""
    )
    turning = ("[analysis]", '[analysis]\nkinematics = "corotational"')
    found = solve(tmp_path, text, turning)
    on = (found.points[:, 0] < 1e-9) | (found.points[:, 1] < 1e-9)
    for k, share in enumerate((0.0, 0.0, 0.5, 1.0, 1.0, 1.0)):
        angle = np.pi / 2 * share
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        wanted = found.points[on] @ (turn - np.eye(2)).T + share * np.array([0.1, 0.2])
        np.testing.assert_allclose(found.displacement[k, on], wanted, atol=1e-12)


def test_an_explicit_scheme_takes_no_more_than_its_share_of_the_critical_step(tmp_path):
    asked = solve(tmp_path, SQUARE + HELD + WEIGHT, scheme="central_differences")
    coarse = ("time_step = 0.01\n", "")
    free = solve(tmp_path, SQUARE + HELD + WEIGHT, coarse, scheme="central_differences")
    half = solve(
        tmp_path, SQUARE + HELD + WEIGHT, coarse, scheme="central_differences", step_factor=0.45
    )
    assert asked.iterations["steps"] == 50
    # five intervals between outputs, each in equal steps that do not exceed the largest
    assert free.iterations["steps"] == 5 * 6
    assert half.iterations["steps"] == 5 * 11
    # so Δ/4.95 ≤ h < Δ/4.5 of the interval Δ, and damping of β = Δ/4.95 leaves h (1 + ξ²)^½ − h ξ
    # with ξ = β/h from 0.91 to 1: 11.3 to 13.3 steps of 0.9 of it
    damped = ("time_step = 0.01\n", "damping = [0.0, 0.0202]\n")
    slow = solve(tmp_path, SQUARE + HELD + WEIGHT, damped, scheme="central_differences")
    assert 12 <= slow.iterations["steps"] / 5 <= 14


@pytest.mark.parametrize(
    "height, scheme", [(0.99, "newmark"), (0.95, "central_differences"), (0.876, "newmark")]
)
def test_what_a_cut_frees_beside_its_support_falls_too(tmp_path, height, scheme):
    """The cut passes within the elements that hang on the support: their nodes there are held."""
    close = ("[[-0.1, 0.45], [1.1, 0.41]]", f"[[-0.1, {height}], [1.1, {height}]]")
    found = solve(tmp_path, SQUARE + HELD + WEIGHT + CUT, close, scheme=scheme)
    np.testing.assert_allclose(below(found)[-1][:, 1], -1.225, rtol=1e-8)


SECOND = '[[cuts]]\nname = "second"\nkind = "polyline"\npoints = [[0.47, -0.1], [0.52, 1.1]]\n'


@pytest.mark.parametrize(
    "times, slivers",
    [
        ((0.0, 0.2), "keep"), ((0.3, 0.1), "keep"), ((0.23, 0.23), "keep"), ((0.5, 0.0), "merge"),
        ((0.3, 0.1), "merge"), ((0.0, 0.2), "drop"), ((0.3, 0.1), "penalise"),
    ],
)  # fmt: skip
def test_cuts_that_cross_open_in_any_order_and_no_energy_is_lost(tmp_path, times, slivers):
    """The cut that opens last comes last for the solver, whichever comes first in the file."""
    first, second = times
    text = (
        SQUARE + HELD + WEIGHT + CUT + f"opens_at = {first}\n" + SECOND + f"opens_at = {second}\n"
    )
    found = solve(tmp_path, text, scheme="energy_momentum", slivers=slivers)
    ledger = found.ledger
    # what a policy changes where a cut opens is an entry of its own
    scale = max(np.abs(ledger["gravity"]).max(), ledger["kinetic"].max())
    assert np.ptp(ledger["total"]) <= 1e-8 * scale
    assert slivers != "keep" or np.abs(ledger["algorithmic"]).max() <= 1e-8 * scale
    assert np.abs(ledger["algorithmic"]).max() <= 1e-2 * scale
    assert len(np.unique(found.cell_sides)) >= 4


@pytest.mark.parametrize(
    ("mass", "slivers"),
    [("sidewise", "keep"), ("consistent", "keep"), ("gevs", "keep"), ("consistent", "merge")],
)
def test_accelerations_of_supports_move_what_they_are_coupled_to(tmp_path, mass, slivers):
    """Outputs of every step: accelerations are the differences of velocities around them."""
    moved = '[[supports]]\nwhere = "top"\ndisplacement = ["4 * t * t * t", "-3 * t * t * t"]\n'
    often = ("duration = 0.5\ntime_step = 0.01\noutputs = 6",
             "duration = 0.05\ntime_step = 0.0005\noutputs = 101")  # fmt: skip
    near = ("[1.1, 0.41]", "[1.1, 0.502]")  # its parts of cells are slivers on the right
    found = solve(tmp_path, SQUARE + moved + CUT, often, near, mass=mass, slivers=slivers)
    differences = (found.velocity[2:] - found.velocity[:-2]) / 1e-3
    held = found.points[:, 1] > 1 - 1e-9
    at = 24 * found.times[1:-1, None] * np.array([1.0, -0.75])
    at_held = found.acceleration[1:-1, held]
    np.testing.assert_allclose(at_held, np.broadcast_to(at[:, None], at_held.shape), rtol=1e-6)
    # they are good to (ω h)²/6, 4e-4 for the fastest mode of this mesh, 100/s
    off = np.abs(found.acceleration[1:-1] - differences)[50:]
    assert off.max() < 2e-3 * np.abs(differences).max()


@pytest.mark.parametrize("name", ["xfem", "virtual_node", "subdivision"])
def test_implicit_schemes_have_the_consistent_mass_and_explicit_ones_a_diagonal(tmp_path, name):
    (tmp_path / "motion.toml").write_text(SQUARE + HELD + WEIGHT + CUT)
    scene = load_scene(tmp_path / "motion.toml")
    implicit, explicit = (
        find_solver(name).solve(scene, 0, 0, scheme=scheme)
        for scheme in ("newmark", "central_differences")
    )
    assert implicit.mass == implicit.notes["mass"] == "consistent"
    assert explicit.notes["mass"] == "sidewise"
    for found, fallen in ((implicit, -1.225), (explicit, -1.225)):
        np.testing.assert_allclose(below(found)[-1][:, 1], fallen, rtol=1e-9)
