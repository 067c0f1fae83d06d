"""Equilibria far from where the search begins: buckled, snapped through, or none at all."""

import numpy as np
import pytest
from cut_bodies import material
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import verify.xfem as xfem
from verify.xfem.arrays import SingularStiffnessError
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.statics import Newton, NotInEquilibriumError, collapsed_cells

YOUNG = 1e4


def elastica(ratio):
    """Fall and sway of the tip of a clamped column of length 1 under that many critical loads."""
    modulus = brentq(lambda m: (2.0 / np.pi * ellipk(m)) ** 2 - ratio, 1e-9, 1.0 - 1e-9)
    return 2.0 - 2.0 * ellipe(modulus) / ellipk(modulus), 2.0 * np.sqrt(modulus) / ellipk(modulus)


def press(rows, force, load_steps=1, across=1e-4):
    """Load on the tip of a column, with a share of it across."""
    mesh = xfem.rectangle_mesh((16 * rows, rows), (0.0, 0.0), (1.0, 0.05), "crossed")
    phantom = xfem.cut_mesh(mesh, [])
    X = phantom.node_points
    fixed = np.repeat(X[:, :1] == 0.0, 2, axis=1)
    end = X[:, 0] == 1.0
    load = np.zeros_like(X)
    load[end] = np.array([-force, across * force]) / end.sum()
    internal = xfem.InternalForce(phantom, xfem.isotropic(YOUNG, 0.0, "plane strain"))
    found = xfem.static_equilibrium(internal, fixed, None, load, load_steps)
    return found, found.displacement[end].mean(axis=0)


def test_a_column_buckles_in_one_load_step_as_far_as_the_elastica() -> None:
    """Twice its critical load; halving the residual ended at 80 % of the forces."""
    force = 2.0 * np.pi**2 / 4.0 * YOUNG * 0.05**3 / 12.0
    fall, sway = elastica(2.0)
    errors = []
    for rows in (4, 2):
        found, tip = press(rows, force)
        errors.append(np.abs([-tip[0] / fall - 1.0, tip[1] / sway - 1.0]).max())
    # linear elements are too stiff in bending by O(h²)
    assert errors[0] < 0.08
    assert errors[1] / errors[0] > 3.0
    assert press(2, force, 8)[0].energy == pytest.approx(found.energy, rel=1e-9)
    # with nothing across, Newton's method would stay in the straight column: F² L / 2 E A
    straight, _ = press(2, force, across=0.0)
    assert straight.check.stable
    assert min(straight.check.dismissed) == pytest.approx(force**2 / (2.0 * YOUNG * 0.05), rel=0.02)
    # 1e-4 of the load across stores about that share more or less
    assert straight.energy == pytest.approx(found.energy, rel=1e-3)


def test_an_arch_snaps_through_under_a_dead_load_to_where_pushing_it_through_ends() -> None:
    """Past the limit point Newton's method has no equilibrium nearby to go to."""
    flat = xfem.rectangle_mesh((24, 2), (0.0, 0.0), (1.0, 0.05))
    x, y = flat.points.T
    arch = xfem.cut_mesh(
        xfem.SimplexMesh(np.column_stack([x, y + 0.6 * x * (1.0 - x)]), flat.cells), []
    )
    X = arch.node_points
    ends = (X[:, 0] == 0.0) | (X[:, 0] == 1.0)
    middle = np.flatnonzero(np.abs(X[:, 0] - 0.5) < 0.01)
    load = np.zeros_like(X)
    load[middle, 1] = -15.0 / len(middle)
    fixed = np.repeat(ends[:, None], 2, axis=1)
    force = xfem.InternalForce(arch, material(2))
    for load_steps in (1, 7):
        snapped = xfem.static_equilibrium(force, fixed, None, load, load_steps)
        assert max(snapped.iterations) < 20
        assert snapped.displacement[middle, 1].max() < -0.25
    # push the same nodes there, from the start: the reactions are the load
    held = fixed.copy()
    held[middle] = True
    pushed = xfem.static_equilibrium(
        force, held, lambda s: np.where(held, s * snapped.displacement, 0.0), None, 4
    )
    assert pushed.reactions[middle] == pytest.approx(load[middle], abs=1e-6)


def test_a_cut_cube_is_pressed_to_a_fifth_of_its_height_in_one_load_step() -> None:
    """Most pieces are inside out on the way; no load step was small enough before."""
    v = xfem.cut_mesh(xfem.box_mesh((3, 3, 3)), [xfem.Plane((0.5, 0.5, 0.5), (1.0, 0.1, 0.05))])
    X = v.node_points
    fixed = np.repeat((X[:, 2:] == 0.0) | (X[:, 2:] == 1.0), 3, axis=1)

    def pressed(share):
        return np.where(X[:, 2:] == 1.0, [0.0, 0.0, -0.8 * share], 0.0)

    found = xfem.static_equilibrium(xfem.InternalForce(v, material(3)), fixed, pressed)
    assert np.abs(found.reactions.sum(axis=0)).max() < 1e-6 * np.abs(found.reactions).max()


@pytest.mark.parametrize("stretch", [4.2, 4.5])
def test_a_strip_is_as_wide_as_hooke_says_until_nothing_is_left_of_its_width(stretch) -> None:
    """Stress is linear in the stretch s: the width is 1 − ν (s − 1), nothing at s = 1 + 1/ν."""
    flat = xfem.rectangle_mesh((3, 2))
    v = xfem.cut_mesh(xfem.SimplexMesh(np.pad(flat.points, ((0, 0), (0, 1))), flat.cells), [])
    X = v.node_points
    fixed = np.zeros(X.shape, dtype=bool)
    fixed[:, 2], fixed[:, 0] = True, (X[:, 0] == 0.0) | (X[:, 0] == 1.0)
    fixed[0] = True

    def pulled(share):
        return share * (stretch - 1.0) * X[:, :1] * np.array([1.0, 0.0, 0.0])

    stuff = xfem.isotropic(YOUNG, 0.3, "plane stress")
    force = xfem.InternalForce(v, stuff)
    found = xfem.static_equilibrium(force, fixed, pulled)
    left = max(1.0 - 0.3 * (stretch - 1.0), 0.0)
    strains = np.array([stretch - 1.0, left - 1.0])
    energy = stuff.mu * (strains**2).sum() + 0.5 * stuff.lam * strains.sum() ** 2
    assert found.energy == pytest.approx(float(energy), rel=1e-9)
    assert np.ptp(found.displacement[:, 1] + X[:, 1]) == pytest.approx(left, abs=1e-6)
    assert len(collapsed_cells(force, found.displacement, 1e-3)) == (0 if left else len(v.cells))


def test_a_ghost_penalty_is_part_of_the_equilibrium() -> None:
    """Inclined cut with slivers: the linear answer under a tiny load, balance under a large one."""
    mesh = xfem.box_mesh((4, 3, 3))
    phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.4, 0.4999, 0.5], [0.13, 1.0, 0.07])])
    stuff = xfem.isotropic(1.0, 0.3, "solid")
    ghost = GhostPenalty(phantom, stuff)
    fixed = np.repeat(phantom.node_points[:, :1] == 0.0, 3, axis=1)
    held = xfem.Supports.none(phantom).prescribe(phantom, mesh.points[:, 0] == 0.0)
    force = xfem.InternalForce(phantom, stuff, ghost=ghost)
    load = xfem.body_force(phantom, [0.3, -1.0, 0.2])
    tiny = xfem.static_equilibrium(force, fixed, load=1e-9 * load).displacement
    linear = xfem.solve_static(phantom, stuff, held, 1e-9 * load, ghost=ghost).displacement
    assert tiny == pytest.approx(linear, abs=1e-6 * np.abs(linear).max())
    far = xfem.static_equilibrium(force, fixed, load=0.05 * load).displacement
    internal, _ = force.evaluate(far)
    assert np.abs(far).max() > 0.1
    assert np.abs(internal - 0.05 * load)[~fixed].max() < 1e-9 * np.abs(internal).max()


def test_a_place_from_which_no_correction_leads_is_left_at_once(monkeypatch) -> None:
    """It was solved for 60 times over, five tangents each."""
    phantom = xfem.cut_mesh(xfem.rectangle_mesh((2, 2)), [])
    fixed = phantom.node_points[:, :1] == [0.0, 0.0]
    newton, tried = Newton(xfem.InternalForce(phantom, material(2)), fixed), []

    def solve(place, change, rotational, least=0.0):
        tried.append(rotational)
        if change is None and rotational == 1.0:
            raise SingularStiffnessError(None)
        return np.zeros_like(place.displacement)

    monkeypatch.setattr(newton, "_solve", solve)
    monkeypatch.setattr(newton, "_share_downhill", lambda *_: 0.0)
    still = np.zeros_like(phantom.node_points)
    with pytest.raises(NotInEquilibriumError, match="where no correction lowers the potential"):
        newton.solve(still, still, np.ones_like(still))
    assert len(tried) <= 6
