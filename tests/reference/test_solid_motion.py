"""Motion at finite rotation in space: what is conserved, and what a cut sets free."""

import numpy as np
import pytest
from large_bodies import space_of
from reference_scenes import needs_fenicsx
from solid_scenes import cube, polygon

from reference import dynamics_body, nodal_algebra
from reference.law import law_of
from verify.scene import Material
from verify.solvers import find_solver

pytestmark = needs_fenicsx

TISSUE = Material(young=1e4, poisson=0.3, density=1000.0)
MIDDLE = polygon("middle", (-1, -1, 0.5), (2, -1, 0.5), (2, 2, 0.5), (-1, 2, 0.5))
SPIN = {
    "kind": "moving",
    "spin": [1.0, 3.0, -2.0],
    "centre": [0.5, 0.5, 0.5],
    "velocity": [0.3, -0.1, 0.2],
}


def moving(cuts=(), duration=0.3, **changes):
    """Give a free unit cube of tissue."""
    analysis = {"kind": "dynamic", "kinematics": "corotational", "duration": duration,
                "time_step": 0.01, "outputs": 6}  # fmt: skip
    tissue = {"young": 1e4, "poisson": 0.3, "density": 1000.0}
    free = {"mesh": {"cells": [[2, 2, 2]]}, "supports": [], "loads": []}
    return cube(cuts, **{"material": tissue, "analysis": analysis, **free} | changes)


def solved(scene, **parameters):
    return find_solver("conforming").solve(scene, 0, repetitions=0, **parameters)


def test_the_mean_force_of_a_step_is_a_discrete_gradient_and_turns_nothing():
    space = space_of(2, (1, 1, 1))
    mechanics, x = law_of(TISSUE, space, "corotational"), space.node_points
    random = np.random.default_rng(1)
    for size in (1e-3, 0.1, 0.5):  # the last turns some cells inside out
        u, later = size * random.standard_normal((2, *x.shape))
        force = mechanics.averaged(u.ravel(), later.ravel())
        reach = np.abs(force) @ np.abs(later - u).ravel()
        gained = mechanics.energy(later.ravel()) - mechanics.energy(u.ravel())
        scale = reach + mechanics.energy(later.ravel())
        assert force @ (later - u).ravel() == pytest.approx(gained, abs=1e-12 * scale)
        force, place = force.reshape(-1, 3), x + 0.5 * (u + later)
        moment = np.cross(place, force).sum(axis=0)
        assert np.abs(moment).max() < 1e-12 * np.abs(place).max() * np.abs(force).sum()
        assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).sum()


def test_a_cut_body_that_tumbles_keeps_energy_and_momenta():
    """Spun about no axis of symmetry, its halves stretched by centrifugal forces."""
    ledger = solved(moving([MIDDLE], initial=SPIN), scheme="energy_momentum").ledger
    total = ledger["kinetic"] + ledger["strain"]
    assert ledger["strain"].max() > 1e-3 * total[0]
    # Newton's residual is 1e-11 of the forces; fifty steps
    assert np.ptp(total) < 1e-10 * total[0]
    for axis in "xyz":
        assert np.ptp(ledger[f"angular_momentum_{axis}"]) < 1e-10 * total[0]
        assert np.ptp(ledger[f"linear_momentum_{axis}"]) < 1e-10 * 1000


def test_cuts_that_open_one_after_the_other_set_one_piece_after_the_other_free():
    """What hangs below the lower cut falls from 0, what is between both from 0.2 s on."""
    lower = polygon("lower", (-1, -1, 0.25), (2, -1, 0.25), (2, 2, 0.25), (-1, 2, 0.25))
    upper = {**MIDDLE, "points": [[x, y, 0.75] for x, y, _ in MIDDLE["points"]], "opens_at": 0.2}
    scene = moving(
        [upper, lower],
        supports=[{"where": "top", "displacement": [0, 0, 0]}],
        loads=[{"kind": "gravity", "acceleration": [0, 0, -0.98]}],
        initial={"kind": "equilibrium", "cuts": "closed"},
        duration=0.5,
    )
    found = solved(scene, scheme="energy_momentum")
    height = found.points[found.cells, 2].mean(axis=1)
    cells = {"lowest": height < 0.25, "middle": (height > 0.25) & (height < 0.75)}
    fallen = {}
    for name, mine in cells.items():
        # a moving linear element's mean is that of its nodes
        corners = found.points[found.cells[mine]]
        volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
        means = found.displacement[:, found.cells[mine], 2].mean(axis=2)
        fallen[name] = means @ volume / volume.sum()
    assert found.times[2] == pytest.approx(0.2)
    t = found.times
    # a centre of mass that nothing holds falls by ½ g t², whatever the piece does around it
    free = fallen["lowest"] - fallen["lowest"][0]
    assert free == pytest.approx(-0.49 * t**2, abs=1e-9)
    # the second cut opens when the middle moves already: from there on with constant acceleration
    later = fallen["middle"][2:]
    assert np.diff(later, 2) == pytest.approx(np.full(2, -0.98 * 0.01), abs=1e-9)
    assert np.abs(np.diff(fallen["middle"][:3], 2) + 0.98 * 0.01).max() > 1e-4
    assert np.ptp(found.ledger["total"]) < 1e-10 * found.ledger["kinetic"].max()


BLADE = {
    "kind": "tool_path",
    "name": "blade",
    "points": [[-0.2, 0.5, 1.2], [1.2, 0.5, 1.2]],
    "depth": 0.7,
    "direction": [0, 0, -1],
    "times": [0.015, 0.055],
}


def test_steps_by_conjugate_gradients_are_those_of_factorisations_while_facets_open(monkeypatch):
    """Also where one takes over at once, since it is said to cost nothing."""
    analysis = {"kind": "dynamic", "kinematics": "corotational", "duration": 0.08, "outputs": 3}
    scene = moving(
        [BLADE],
        mesh={"cells": [[4, 4, 4]]},
        supports=[{"where": "left", "displacement": [0, 0, 0]}],
        loads=[{"kind": "gravity", "acceleration": [0.3, -0.5, -2.0]}],
        analysis={**analysis, "time_step": 0.01},
    )
    wanted = solved(scene)
    turned = []
    factorise = nodal_algebra.NodalSolver._factorise
    monkeypatch.setattr(
        nodal_algebra.NodalSolver,
        "_factorise",
        lambda self: (turned.append(self.iterates), factorise(self)),
    )
    monkeypatch.setattr(dynamics_body, "_SMALL", 0)
    monkeypatch.setattr(nodal_algebra, "_FACTORISATION", 1e9)
    found = solved(scene)
    assert int(found.notes["openings"]) >= 3
    assert len(turned) == 0
    size = np.abs(wanted.displacement).max()
    # steps are solved to 1e-11 of their forces
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-9 * size)
    ledger = found.ledger
    energy = max(np.ptp(ledger[name]) for name in ("kinetic", "strain", "gravity"))
    assert np.ptp(ledger["total"]) < 1e-10 * energy
    monkeypatch.setattr(nodal_algebra, "_FACTORISATION", 1e-9)
    again = solved(scene)
    assert len(turned) > 0
    assert again.displacement == pytest.approx(wanted.displacement, abs=1e-9 * size)
