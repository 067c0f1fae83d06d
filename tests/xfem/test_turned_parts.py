"""Parts of a cut body that supports turn: no false equilibrium at any angle, on any mesh."""

import numpy as np
import pytest
from cut_bodies import isotropic, rotation
from turned_bodies import YOUNG, turn, turned_body, turned_sheet

import verify.xfem as xfem
from verify.xfem import equilibrium
from verify.xfem.rigid_motion import RigidMotions
from verify.xfem.statics import NotInEquilibriumError

# E L^d, with the longest side 1.3 m: what round-off and the tolerance of forces leave is far below
LEAST = 1e-9 * YOUNG * 1.3


def made(kind, seed):
    if kind == "membrane":
        return turned_sheet(seed, 7)
    return turned_body(seed, 2 if kind == "plane" else 3, 7 if kind == "plane" else 4)


@pytest.mark.parametrize(
    ("seeds", "angles"),
    [
        (range(1), (125, 180, 255)),
        pytest.param(range(10), range(15, 346, 15), marks=pytest.mark.heavy),  # 690 turns
    ],
    ids=["few", "many"],
)
@pytest.mark.parametrize("kind", ["plane", "space", "membrane"])
def test_a_part_that_is_turned_rigidly_stores_nothing(kind, seeds, angles) -> None:
    for body in (made(kind, seed) for seed in seeds):
        for degrees in angles:
            found = xfem.static_equilibrium(body.force, body.fixed, turn(body, degrees))
            assert found.energy < LEAST
            assert found.iterations == (1,) or len(seeds) > 1
            # a membrane at rest has no stiffness across itself
            assert found.check.stable is (None if kind == "membrane" else True)


def without_rigid_motions(monkeypatch) -> None:
    """Let supports move bodies as the linear response to the whole of a step."""
    monkeypatch.setattr(RigidMotions, "follow", lambda self, displacement, change: displacement)
    monkeypatch.setattr(RigidMotions, "strain", lambda self, displacement, change: 0.0)


@pytest.mark.parametrize(("seed", "degrees"), [(0, 255), (1, 165)])
def test_a_false_equilibrium_is_left_for_the_right_one(monkeypatch, seed, degrees) -> None:
    """Newton's method ends in 363 and 10 J, once without a piece inside out."""
    without_rigid_motions(monkeypatch)
    body = turned_body(seed, 2, 7)
    found = xfem.static_equilibrium(body.force, body.fixed, turn(body, degrees))
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
        xfem.static_equilibrium(body.force, body.fixed, turn(body, 255))


@pytest.mark.parametrize(("kind", "strip"), [("plane", False), ("space", True)])
def test_a_part_that_is_turned_and_stretched_stores_what_stretching_it_stores(kind, strip) -> None:
    """By three tenths; the energy does not see the turn, in one step or in eight."""
    dim, across = (2, 7) if kind == "plane" else (3, 4)
    body = turned_body(3, dim, across, strip)
    path = turn(body, 0.0, stretch=0.3)
    stretched = xfem.static_equilibrium(body.force, body.fixed, path, load_steps=8)
    assert stretched.energy > 1.0
    for degrees in (75, 181):
        found = xfem.static_equilibrium(body.force, body.fixed, turn(body, degrees, stretch=0.3))
        # residuals of 1e-10 of the forces
        assert found.energy == pytest.approx(stretched.energy, rel=1e-8)


def twisted_bar(degrees, load_steps=1):
    """A bar of 3 x 1 x 1 whose ends are turned against one another about its axis."""
    v = xfem.cut_mesh(xfem.box_mesh((6, 2, 2), (0.0, 0.0, 0.0), (3.0, 1.0, 1.0)), [])
    points = v.node_points
    fixed = np.repeat((points[:, :1] == 0.0) | (points[:, :1] == 3.0), 3, axis=1)

    def path(share):
        Q = rotation(3, np.radians(degrees) * share, (1.0, 0.0, 0.0))
        turned = (points - 0.5) @ Q.T + 0.5 - points
        return np.where(points[:, :1] == 3.0, turned, 0.0)

    force = xfem.InternalForce(v, isotropic(YOUNG, 0.3, "solid"))
    return xfem.static_equilibrium(force, fixed, path, load_steps=load_steps)


def test_ends_of_a_bar_that_turn_against_one_another_are_followed_the_way_they_turn() -> None:
    """270° one way leave its ends as 90° the other way do, with less energy."""
    found, slowly = twisted_bar(270.0), twisted_bar(270.0, 8)
    assert len(found.iterations) > 1
    assert found.energy == pytest.approx(slowly.energy, rel=1e-8)
    assert found.energy > 3.0 * twisted_bar(-90.0).energy
