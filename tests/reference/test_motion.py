"""Dynamic scenes on conforming elements: schemes, ledgers, cuts that open on the way."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline

from verify.scene import Scene, load_scene

pytestmark = needs_fenicsx

MIDDLE = polyline("middle", [-0.1, 0.5], [1.1, 0.5])


def moving(cuts=(), kinematics="linear", duration=0.5, outputs=6, **changes):
    """Give a free unit square of tissue."""
    content = {
        "title": "square",
        "requirement": "none",
        "geometry": {"kind": "rectangle", "lower": [0, 0], "upper": [1, 1]},
        "mesh": {"cells": [[4, 4]]},
        "material": {"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0},
        "cuts": list(cuts),
        "analysis": {
            "kind": "dynamic",
            "kinematics": kinematics,
            "duration": duration,
            "time_step": 0.01,
            "outputs": outputs,
        },
    }
    return Scene.model_validate(content | changes)


def solved(scene, solver="conforming", level=0, **parameters):
    from verify.solvers import find_solver

    return find_solver(solver).solve(scene, level, repetitions=0, **parameters)


def spread(column):
    """How much a column of the ledger varies over its largest value."""
    return np.ptp(column) / np.abs(column).max()


SPIN = {"kind": "moving", "spin": 4.0, "centre": [0.5, 0.5], "velocity": [0.3, -0.1]}


def test_a_cut_body_that_spins_keeps_energy_and_momenta_with_the_energy_momentum_scheme():
    """Centrifugal forces stretch it by some per cent: no rigid rotation, and no small one."""
    scene = moving([MIDDLE], "corotational", initial=SPIN)
    found = solved(scene, scheme="energy_momentum")
    ledger = found.ledger
    total = ledger["kinetic"] + ledger["strain"]
    assert ledger["strain"].max() > 1e-3 * total[0]
    # Newton's residual is 1e-11 of the forces; fifty steps
    assert spread(total) < 1e-10
    assert spread(ledger["angular_momentum_z"]) < 1e-10
    for axis in "xy":
        assert np.ptp(ledger[f"linear_momentum_{axis}"]) < 1e-10 * 1000
    # and each half flies on its own, by its own centre: 2 rad in all
    assert np.abs(found.displacement[-1]).max() > 0.5


def test_schemes_that_do_not_conserve_say_what_they_lose_and_their_accounts_close():
    scene = moving([MIDDLE], "corotational", initial=SPIN, duration=0.2)
    lost = {}
    for scheme in ("newmark", "implicit_euler", "generalised_alpha"):
        ledger = solved(scene, scheme=scheme).ledger
        assert spread(ledger["total"]) < 1e-10
        lost[scheme] = ledger["algorithmic"][-1] / ledger["total"][0]
    assert lost["implicit_euler"] > 1e-2  # 1 − 1/(1+(ωΔt)²) per step for spinning alone
    assert abs(lost["newmark"]) < 0.1 * lost["implicit_euler"]
    assert abs(lost["generalised_alpha"]) < 0.1 * lost["implicit_euler"]


def test_nothing_jumps_when_a_cut_opens_on_the_way():
    """A bar between walls that has drawn breath: energy and momentum go on as they were."""
    late = {**MIDDLE, "opens_at": 0.25}
    first = polyline("first", [0.5, 0.8], [0.5, 1.1])
    scene = moving(
        [late, first],
        supports=[{"where": "bottom", "displacement": [0, 0]}],
        loads=[{"kind": "gravity", "acceleration": [0, -9.8]}],
        outputs=5,
        duration=0.5,
    )
    found = solved(scene)
    assert spread(found.ledger["total"] + found.ledger["kinetic"].max()) < 1e-10
    # closed until then, apart after: nodes at equal places move alike, or not
    middle = np.flatnonzero(np.abs(found.points[:, 1] - 0.5) < 1e-9)
    _, pair = np.unique(np.round(found.points[middle, 0], 9), return_inverse=True)
    gaps = [
        max(np.ptp(u[middle[pair == k]], axis=0).max() for k in range(pair.max() + 1))
        for u in found.displacement
    ]
    assert max(gaps[:3]) < 1e-15
    assert min(gaps[3:]) > 1e-3


def test_a_freed_half_falls_by_g_at_finite_rotation_with_every_level_of_the_reference():
    scene = moving(
        [MIDDLE],
        "corotational",
        supports=[{"where": "top", "displacement": [0, 0]}],
        loads=[{"kind": "gravity", "acceleration": [0, -0.98]}],
        reference={"size": 0.5},
    )
    for level in (0, 1):
        found = solved(scene, "reference", level)
        lower = np.unique(found.cells[found.points[found.cells, 1].mean(axis=1) < 0.5])
        fall = np.tile([0.0, -0.1225], (len(lower), 1))
        assert found.displacement[-1][lower] == pytest.approx(fall, abs=1e-9)
        assert spread(found.ledger["total"] + found.ledger["kinetic"].max()) < 1e-10


def test_supports_that_move_do_the_work_that_the_body_takes_up():
    """A slow ramp ends in the energy of the static stretch; what moves is that much or less."""
    walls = [
        {"where": "left", "displacement": [0.0, 0.0]},
        {
            "where": "right",
            "displacement": [0.02, 0.0],
            "history": [[0.0, 0.0], [4.0, 1.0]],
        },
    ]
    ledger = solved(moving(supports=walls, duration=5.0)).ledger
    assert spread(ledger["total"] + ledger["strain"].max()) < 1e-10
    held = moving(supports=[walls[0], {**walls[1], "history": None}])
    still = held.model_copy(update={"analysis": type(held.analysis)()})
    stretched = solved(still).ledger["strain"][0]
    assert ledger["strain"][-1] == pytest.approx(stretched, rel=0.05)
    # the nodes at the wall begin with its velocity: that is the whole energy at the start
    gained = ledger["kinetic"] + ledger["strain"] - ledger["kinetic"][0]
    assert ledger["work_of_supports"] == pytest.approx(gained, abs=1e-10 * stretched)


def test_a_load_that_is_let_go_at_once_starts_from_its_equilibrium():
    scene = moving(
        initial={"kind": "equilibrium"},
        supports=[{"where": "bottom", "displacement": [0, 0]}],
        loads=[
            {
                "kind": "traction",
                "where": "top",
                "traction": [0.0, 100.0],
                "history": [[0.0, 1.0], [0.0, 0.0]],
            }
        ],
    )
    found = solved(scene)
    assert found.displacement[0][:, 1].max() == pytest.approx(0.0091, rel=0.1)
    ledger = found.ledger
    assert ledger["work_of_loads"] == pytest.approx(0.0, abs=1e-12 * ledger["strain"][0])
    assert spread(ledger["kinetic"] + ledger["strain"]) < 1e-10


@pytest.mark.parametrize("level", [0, 1])
def test_small_elements_are_not_turned_inside_out_when_a_load_is_let_go_at_once(level):
    """Graded to the loaded corner, they have accelerations of many times their size per Δt²."""
    case = load_scene("dynamics/cantilever_release").model_dump(mode="json", by_alias=True)
    case["analysis"] |= {"kinematics": "corotational", "duration": 0.2}
    case |= {"acceptance": [], "quantities": [{"kind": "strain_energy"}]}
    ledger = solved(Scene.model_validate(case), "reference", level).ledger
    total = ledger["kinetic"] + ledger["strain"]
    assert np.ptp(total) < 1e-9 * total[0]
