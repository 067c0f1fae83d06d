"""Parts of a cut body that supports turn: no false equilibrium at any angle, on any mesh."""

import numpy as np
import pytest
from cut_bodies import isotropic, rotation
from turned_bodies import YOUNG, turn, turned_body, turned_sheet

from verify.xfem import equilibrium
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.internal_force import InternalForce
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.rigid_motion import RigidMotions, nearest_rotation
from verify.xfem.statics import NotInEquilibriumError

ANGLES = range(15, 346, 15)
# E L^d, with the longest side 1.3 m: what round-off and the tolerance of forces leave is far below
LEAST = 1e-9 * YOUNG * 1.3


def made(kind, seed):
    if kind == "membrane":
        return turned_sheet(seed, 7)
    return turned_body(seed, 2 if kind == "plane" else 3, 7 if kind == "plane" else 4)


@pytest.mark.parametrize("kind", ["plane", "space", "membrane"])
@pytest.mark.parametrize("seed", [0, 1])
def test_a_part_that_is_turned_rigidly_stores_nothing(kind, seed) -> None:
    body = made(kind, seed)
    for degrees in (105, 125, 180, 255, 345):
        found = static_equilibrium(body.force, body.fixed, turn(body, degrees))
        assert found.energy < LEAST
        assert found.iterations == (1,)
        # a membrane at rest has no stiffness across itself
        assert found.check.stable is (None if kind == "membrane" else True)


@pytest.mark.heavy
@pytest.mark.parametrize("kind", ["plane", "space", "membrane"])
def test_a_part_that_is_turned_rigidly_stores_nothing_on_ten_meshes_at_every_angle(kind) -> None:
    """None is refused either: 690 turns."""
    for seed in range(10):
        body = made(kind, seed)
        for degrees in ANGLES:
            found = static_equilibrium(body.force, body.fixed, turn(body, degrees))
            assert found.energy < LEAST


def without_rigid_motions(monkeypatch) -> None:
    """Let supports move bodies as the linear response to the whole of a step."""
    monkeypatch.setattr(RigidMotions, "follow", lambda self, displacement, change: displacement)
    monkeypatch.setattr(RigidMotions, "strain", lambda self, displacement, change: 0.0)


@pytest.mark.parametrize("seed, degrees", [(0, 255), (1, 165), (2, 150)])
def test_a_false_equilibrium_is_left_for_the_right_one(monkeypatch, seed, degrees) -> None:
    """Newton's method ends in 363, 10 and 547 J, twice without a piece inside out."""
    without_rigid_motions(monkeypatch)
    body = turned_body(seed, 2, 7)
    found = static_equilibrium(body.force, body.fixed, turn(body, degrees))
    assert found.energy < LEAST
    assert found.check.stable
    assert found.check.compared >= 1
    assert min(found.check.dismissed) > 1.0


def test_a_false_equilibrium_is_refused_with_both_energies_where_no_other_path_is_left(
    monkeypatch,
) -> None:
    without_rigid_motions(monkeypatch)
    monkeypatch.setattr(equilibrium, "_HALVINGS", 0)
    body = turned_body(0, 2, 7)
    with pytest.raises(NotInEquilibriumError, match=r"stores 362\.\d+ J, but .* account for"):
        static_equilibrium(body.force, body.fixed, turn(body, 255))


@pytest.mark.parametrize("kind, strip", [("plane", False), ("plane", True), ("space", True)])
def test_a_part_that_is_turned_and_stretched_stores_what_stretching_it_stores(kind, strip) -> None:
    """By three tenths; the energy does not see the turn, in one step or in sixteen."""
    dim, across = (2, 7) if kind == "plane" else (3, 4)
    body = turned_body(3, dim, across, strip)
    path = turn(body, 0.0, stretch=0.3)
    stretched = static_equilibrium(body.force, body.fixed, path, load_steps=16)
    assert stretched.energy > 1.0
    for degrees in (75, 179, 181, 300):
        found = static_equilibrium(body.force, body.fixed, turn(body, degrees, stretch=0.3))
        # residuals of 1e-10 of the forces
        assert found.energy == pytest.approx(stretched.energy, rel=1e-8)


def twisted_bar(degrees, load_steps=1):
    """A bar of 3 x 1 x 1 whose ends are turned against one another about its axis."""
    v = cut_mesh(box_mesh((9, 3, 3), (0.0, 0.0, 0.0), (3.0, 1.0, 1.0)), [])
    points = v.node_points
    fixed = np.repeat((points[:, :1] == 0.0) | (points[:, :1] == 3.0), 3, axis=1)

    def path(share):
        Q = rotation(3, np.radians(degrees) * share, (1.0, 0.0, 0.0))
        turned = (points - 0.5) @ Q.T + 0.5 - points
        return np.where(points[:, :1] == 3.0, turned, 0.0)

    force = InternalForce(v, isotropic(YOUNG, 0.3, "solid"))
    return static_equilibrium(force, fixed, path, load_steps=load_steps)


def test_ends_of_a_bar_that_turn_against_one_another_are_followed_the_way_they_turn() -> None:
    """270° one way leave its ends as 90° the other way do, with less energy."""
    found, slowly = twisted_bar(270.0), twisted_bar(270.0, 16)
    assert len(found.iterations) > 1
    assert found.energy == pytest.approx(slowly.energy, rel=1e-8)
    assert found.energy > 3.0 * twisted_bar(-90.0).energy


def test_a_straight_column_beyond_its_critical_load_is_left_for_the_buckled_one() -> None:
    """Without anything across, Newton's method stays in the unstable equilibrium."""
    mesh = rectangle_mesh((64, 4), (0.0, 0.0), (1.0, 0.05), "crossed")
    v = cut_mesh(mesh, [])
    points = v.node_points
    fixed = np.repeat(points[:, :1] == 0.0, 2, axis=1)
    end = points[:, 0] == 1.0
    critical = np.pi**2 / 4.0 * YOUNG * 0.05**3 / 12.0
    energies = []
    for across in (0.0, 1e-4):
        load = np.zeros_like(points)
        load[end] = 2.0 * critical * np.array([-1.0, across]) / end.sum()
        force = InternalForce(v, isotropic(YOUNG, 0.0, "plane strain"))
        found = static_equilibrium(force, fixed, None, load)
        assert found.check.stable
        energies.append(found.energy)
        if across == 0.0:  # F² L / 2 E A of the straight one
            straight = (2.0 * critical) ** 2 / (2.0 * YOUNG * 0.05)
            assert min(found.check.dismissed) == pytest.approx(straight, rel=0.02)
    # 1e-4 of the load across stores about that share more or less
    assert energies[0] == pytest.approx(energies[1], rel=1e-3)


def test_the_nearest_rotation_is_the_one_made_and_the_smallest_where_points_leave_it_open() -> None:
    random = np.random.default_rng(4)
    for dim in (2, 3):
        for degrees in (1e-7, 30.0, 179.999, 180.0, 300.0):
            Q = rotation(dim, np.radians(degrees))
            points = random.normal(size=(7, dim))
            points -= points.mean(axis=0)
            assert nearest_rotation(points, points @ Q.T) == pytest.approx(Q, abs=1e-14)
    line = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    Q = rotation(3, 2.0, (0.0, 0.0, 1.0))
    assert nearest_rotation(line, line @ Q.T) == pytest.approx(Q, abs=1e-8)
    nothing = np.zeros((1, 3))
    np.testing.assert_array_equal(nearest_rotation(nothing, nothing), np.eye(3))
