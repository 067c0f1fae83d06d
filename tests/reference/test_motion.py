"""Motion on conforming elements: schemes, ledgers, openings, vibrations, several ranks."""

import numpy as np
import pytest
from large_bodies import space_of
from reference_scenes import needs_fenicsx, polyline, square
from scipy.sparse.linalg import eigsh

from reference.dynamics_body import inherit
from reference.elasticity import linear_system
from reference.meshing import Grading, conforming_mesh, singular_points
from reference.space import conforming_space
from verify.errors import InputError
from verify.scene import Scene, load_scene
from verify.solvers import find_solver
from verify.solvers.conforming import ConformingSolver
from verify.solvers.xfem import XfemSolver

pytestmark = needs_fenicsx


MIDDLE = polyline("middle", [-0.1, 0.5], [1.1, 0.5])


def moving(cuts=(), kinematics="linear", duration=0.5, outputs=6, time_step=0.01, **changes):
    """Give a free unit square of tissue."""
    analysis = {"kind": "dynamic", "kinematics": kinematics, "duration": duration,
                "time_step": time_step, "outputs": outputs}  # fmt: skip
    tissue = {"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0}
    free = {"mesh": {"cells": [[4, 4]]}, "supports": [], "loads": []}
    return square(cuts, **{"material": tissue, "analysis": analysis, **free} | changes)


def solved(scene, solver="conforming", level=0, **parameters):
    return find_solver(solver).solve(scene, level, repetitions=0, **parameters)


def spread(column):
    """How much a column of the ledger varies over its largest value."""
    return np.ptp(column) / np.abs(column).max()


SPIN = {"kind": "moving", "spin": 4.0, "centre": [0.5, 0.5], "velocity": [0.3, -0.1]}


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


def test_a_freed_half_falls_by_g_at_finite_rotation_on_the_reference():
    scene = moving(
        [MIDDLE],
        "corotational",
        supports=[{"where": "top", "displacement": [0, 0]}],
        loads=[{"kind": "gravity", "acceleration": [0, -0.98]}],
        reference={"size": 0.5},
        duration=0.2,
    )
    found = solved(scene, "reference")
    lower = np.unique(found.cells[found.points[found.cells, 1].mean(axis=1) < 0.5])
    fall = np.tile([0.0, -0.49 * 0.2**2], (len(lower), 1))
    assert found.displacement[-1][lower] == pytest.approx(fall, abs=1e-9)
    assert spread(found.ledger["total"] + found.ledger["kinetic"].max()) < 1e-10


def test_small_elements_are_not_turned_inside_out_when_a_load_is_let_go_at_once():
    """Graded to the loaded corner, they have accelerations of many times their size per Δt²."""
    case = load_scene("dynamics/cantilever_release").model_dump(mode="json", by_alias=True)
    case["analysis"] |= {"kinematics": "corotational", "duration": 0.2}
    case |= {"acceptance": [], "quantities": [{"kind": "strain_energy"}]}
    ledger = solved(Scene.model_validate(case), "reference").ledger
    total = ledger["kinetic"] + ledger["strain"]
    assert np.ptp(total) < 1e-9 * total[0]


CUTS = {
    "split": ([polyline("a", (-0.1, 0.1), (1.1, 0.1))], [0.33435932, 0.33435932]),
    "half split": ([polyline("a", (0.5, 0.1), (1.1, 0.1))], [0.603212]),
}


def frequencies(cuts, count):
    """Lowest angular frequencies, rad/s, of a beam of length 1 and depth 0.2."""
    scene = square(
        cuts,
        geometry={"kind": "rectangle", "lower": [0, 0], "upper": [1, 0.2]},
        material={"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0},
        supports=[{"where": "left", "displacement": [0, 0]}],
    )
    grading = Grading(0.02, singular_points(scene), 0.2)
    space = conforming_space(conforming_mesh(scene, grading), 2)
    stiffness, mass, held = linear_system(scene, space, None)
    free = np.flatnonzero(~held)
    stiffness, mass = (one[free][:, free] for one in (stiffness, mass))
    squares = eigsh(stiffness, count, mass, sigma=0.0, return_eigenvectors=False)
    return np.sqrt(np.sort(squares))


@pytest.mark.parametrize("name", CUTS)
def test_cantilevers_swing_at_the_known_frequencies(name):
    cuts, known = CUTS[name]
    assert frequencies(cuts, len(known)) == pytest.approx(known, rel=1e-5)


def test_a_state_is_not_carried_over_to_another_mesh():
    closed, other = space_of(1, (4, 4)), space_of(1, (6, 4))
    with pytest.raises(InputError, match="does not have the cells"):
        inherit(closed, other, closed.node_points)


@pytest.mark.parametrize("kinematics, rho", [("linear", 0.3), ("corotational", 0.6)])
def test_both_solvers_find_the_same_motion(kinematics, rho):
    scene = square(
        supports=[{"where": "left", "displacement": [0, 0]}],
        material={"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0},
        loads=[{"kind": "gravity", "acceleration": [0, -9.8]}],
        analysis={
            "kind": "dynamic", "kinematics": kinematics, "duration": 0.3, "time_step": 0.01,
            "outputs": 4,
        },
    )  # fmt: skip
    given = {"scheme": "generalised_alpha", "spectral_radius": rho}
    ours = XfemSolver().solve(scene, 0, 0, mass="consistent", **given)
    theirs = ConformingSolver().solve(scene, 0, 0, **given)
    pairs = np.linalg.norm(ours.points[:, None] - theirs.points[None], axis=2).argmin(axis=1)
    found, wanted = ours.displacement, theirs.displacement[:, pairs]
    size = np.abs(wanted).max()
    assert size > 0.2
    # the reference ends a step at 1e-11 of its forces, ours at 1e-10 of its accelerations
    assert np.abs(found - wanted).max() < 1e-8 * size
    lost = [one.ledger["algorithmic"][-1] for one in (ours, theirs)]
    assert lost[0] == pytest.approx(lost[1], rel=1e-5)
    assert lost[0] > 0.0


def pressed(by, time_step, cells=16):
    """Tissue with ln J, whose top is pressed down within the first step."""
    tissue = {"young": 1e4, "poisson": 0.3, "plane": "strain", "density": 1000.0}
    supports = [
        {"where": "bottom", "displacement": [0.0, 0.0]},
        {"where": "top", "displacement": [0.0, -by], "history": [(0.0, 0.0), (time_step, 1.0)]},
    ]
    return moving(
        kinematics="corotational", duration=time_step, outputs=2, time_step=time_step,
        material=tissue | {"model": "neo_hookean"}, supports=supports,
        mesh={"cells": [[cells, cells]]},
    )  # fmt: skip


def test_supports_may_move_by_more_than_an_element_in_a_step():
    """A wave goes through a third of the body in it: by the step's end the strain is there."""
    found = solved(pressed(0.1, 0.1))
    height = found.points[:, 1] + found.displacement[-1][:, 1]
    beside = np.abs(found.points[:, 0] - 0.5) < 1e-9
    order = np.argsort(found.points[beside, 1])
    assert np.diff(height[beside][order]).min() > 0.5 / 16


def test_a_body_that_its_supports_press_inside_out_is_an_error_that_names_place_and_time():
    """The step is taken in halves, while they are solved: the body is pressed flat at 0.09 s."""
    told = r"step from 0\.0[0-9]+ s by .* s .* det F = -.* at \(.*inside"
    with pytest.raises(RuntimeError, match=told):
        solved(pressed(1.1, 0.1, 4))


@pytest.mark.parametrize("cuts", [[], [polyline("inclined", [-0.1, 0.31], [0.62, 0.54])]])
def test_a_body_that_flies_through_itself_is_an_error_that_names_place_and_time(cuts):
    """Without stiffness det F = 1 − 20 t: the corotated energy has no barrier at zero."""
    tissue = {"young": 1e-3, "poisson": 0.3, "plane": "strain", "density": 1000.0}
    thrown = {"kind": "field", "velocity": ["-20 * x", 0.0]}

    def flying(duration):
        return moving(cuts, "corotational", duration, 3, material=tissue, initial=thrown)

    until = solved(flying(0.048))
    np.testing.assert_allclose(
        until.displacement[-1], until.points * [-0.96, 0.0], rtol=0.0, atol=1e-5
    )
    with pytest.raises(RuntimeError, match=r"at 0\.06 s det F is -0\.2 at \(.*inside out"):
        solved(flying(0.06))


def test_a_corner_of_a_millionth_of_an_element_that_is_cut_off_on_the_way_is_solved():
    """The compliance of ties beside it is lost in round-off: then each opening factorises anew."""
    scene = load_scene("benchmark/c8_slivers_corner[epsilon=1e-06]")
    ledger = solved(scene).ledger
    assert np.ptp(ledger["total"]) <= 1e-9 * np.abs(ledger["gravity"]).max()
