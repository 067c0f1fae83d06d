"""Energies without a ledger, and separated parts: mass, inertia, momenta, against exact motions."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from cut_meshes import layered, scene
from solid_meshes import height, inclined, solid_scene, stacked

from verify.compare.body import body_of
from verify.compare.hooke import law_of
from verify.compare.mass import separated_parts
from verify.compare.motion_account import motion_account
from verify.compare.part_account import ACCOUNT as ACCOUNT_METRICS
from verify.compare.part_account import account_metrics, part_metrics, part_records
from verify.compare.simplices import points_in
from verify.judge.quantities import Measured, unit_of
from verify.scene import PartQuantity, Scene
from verify.solution import Solution
from verify.solvers import find_solver

# what a blade releases is measured elsewhere
ACCOUNT = [name for name in ACCOUNT_METRICS if not name.startswith("released")]
TIMES = np.linspace(0.0, 0.6, 7)
DENSITY = 3.0
MOVING = {"kind": "moving", "spin": 1.0}
DYNAMIC = {"kind": "dynamic", "kinematics": "corotational", "duration": 0.6, "outputs": 7}
PLANE = {"young": 1.0, "poisson": 0.3, "density": DENSITY, "plane": "strain"}
SOLID = {"young": 1.0, "poisson": 0.3, "density": DENSITY}
LINE = {"kind": "polyline", "points": [[-0.1, 0.3], [1.1, 0.7]]}


def turn(axis, angle):
    """Rotation matrix about a vector."""
    n = np.cross(np.eye(3), np.asarray(axis) / np.linalg.norm(axis))
    return np.eye(3) + np.sin(angle) * n + (1 - np.cos(angle)) * n @ n


def rigid(points, cells, centres, spins, velocities):
    """Every node turns about the centre of its part, which flies on at its velocity."""
    d, u, v = points.shape[1], [], []
    for t in TIMES:
        moved, speed = np.zeros_like(points), np.zeros_like(points)
        for i, (x, c, w, push) in enumerate(zip(points, centres, spins, velocities, strict=True)):
            axis = np.array([0.0, 0.0, w]) if d == 2 else w
            arm = turn(axis, np.linalg.norm(axis) * t)[:d, :d] @ (x - c)
            moved[i] = c + arm + push * t - x
            speed[i] = push + np.cross(axis, np.append(arm, np.zeros(3 - d)))[:d]
        u.append(moved)
        v.append(speed)
    return Solution(
        points=points, cells=cells.astype(np.int64), displacement=np.array(u), times=TIMES,
        velocity=np.array(v),
    )  # fmt: skip


def accounted(case, one):
    law = law_of(case)
    account = motion_account(case, one, law)
    parts = part_records(case, one, account)
    metrics, notes = account_metrics(case, account)
    more, why = part_metrics(parts, account)
    return account, parts, {m.name: m for m in metrics + more}, notes | why


def turning(**more):
    """A square cut along a line; each half turns about its own centre, and flies on."""
    points, cells, layer = layered(4, [lambda x: 0.3 + (x + 0.1) / 3])
    case = scene([LINE], material=PLANE, supports=[], analysis=DYNAMIC, initial=MOVING, **more)
    low = separated_parts(Solution(points, cells, np.zeros((1, *points.shape))), 1.0)
    centres = np.where(layer[:, None] == 1, low[0].centre, low[1].centre)
    spins = np.where(layer == 1, 2.0, -0.7)
    pushes = np.where(layer[:, None] == 1, [0.3, 0.2], [-0.1, -0.4])
    return case, rigid(points, cells, centres, spins, pushes)


def test_two_halves_that_spin_have_their_own_momenta_and_keep_them():
    case, one = turning()
    _, parts, found, notes = accounted(case, one)
    upper, lower = parts
    # the line crosses the square at heights 1/3 and 2/3: two trapezoids of area 1/2
    assert [upper.mass, lower.mass] == pytest.approx([DENSITY / 2] * 2, rel=1e-13)
    assert upper.centre[1] > lower.centre[1]
    assert upper.inertia == pytest.approx(lower.inertia, rel=1e-12)  # alike, turned by π
    # trapezoid of parallel sides a = 1/3, b = 2/3 along y, 1 apart; about its centre
    own = trapezoid_inertia()
    assert upper.inertia == pytest.approx([DENSITY * own], rel=1e-12)
    for part, spin, push in ((upper, 2.0, (0.3, 0.2)), (lower, -0.7, (-0.1, -0.4))):
        assert part.free_from == 0.0
        for k, axis in enumerate("xy"):
            got = part.series[f"linear_momentum_{axis}"]
            assert got == pytest.approx([DENSITY / 2 * push[k]] * 7, rel=1e-11)
        got = part.series["angular_momentum_z"]
        assert got == pytest.approx([part.inertia[0] * spin] * 7, rel=1e-11)
        energy = 0.5 * part.mass * np.dot(push, push) + 0.5 * part.inertia[0] * spin**2
        assert part.series["kinetic"] == pytest.approx([energy] * 7, rel=1e-11)
        assert max(part.series["strain"]) < 1e-14  # turned, not strained
        assert max(part.drift.values()) < 1e-13
    assert found["energy_drift"].value < 1e-13
    assert "no mass is declared" in found["energy_drift"].source
    assert found["part_angular_momentum_drift"].value < 1e-13
    assert notes["ledger_mismatch"] == "the solution has no ledger of its own"
    assert set(found) | set(notes) == set(ACCOUNT)


def trapezoid_inertia():
    """Polar moment of area about the centre of 0 < x < 1, 0 < y < 1/3 + x/3, by Gauss points."""
    x, w = np.polynomial.legendre.leggauss(6)
    x, w = (x + 1) / 2, w / 2
    top = 1 / 3 + x / 3
    area, mx, my = w @ top, w @ (x * top), w @ top**2 / 2
    second = w @ (x**2 * top) + w @ top**3 / 3
    return second - (mx**2 + my**2) / area


@pytest.mark.parametrize("share", [1.0, 0.9])
def test_free_fall_is_kept_and_a_fall_with_less_is_not(share):
    gravity = [{"kind": "gravity", "acceleration": [0.0, -9.8]}]
    case, one = turning(loads=gravity)
    t = TIMES[:, None, None]
    fall = np.array([0.0, -9.8 * share])
    still = np.zeros_like(one.displacement)
    falling = Solution(
        one.points, one.cells, still + 0.5 * fall * t**2, TIMES, velocity=still + fall * t
    )
    _, _, found, _ = accounted(case, falling)
    end = falling.velocity[-1, 0, 1]
    lost = 1 - share
    assert found["part_linear_momentum_drift"].value == pytest.approx(
        lost * 9.8 * 0.6 / abs(end), abs=1e-13
    )
    # ½ m v² − m g s of it, over the larger of the two
    gained, given = 0.5 * end**2, 9.8 * (0.5 * 9.8 * share * 0.36)
    assert found["energy_drift"].value == pytest.approx(
        abs(gained - given) / max(gained, given), abs=1e-13
    )
    assert found["part_angular_momentum_drift"].value < 1e-13


def test_a_spinning_cube_cut_by_an_inclined_plane_has_parts_of_closed_form():
    points, cells, _ = stacked(3, [height])
    spin, centre = np.array([0.5, -1.0, 2.0]), np.full(3, 0.5)
    case = solid_scene(
        [inclined()], material=SOLID, supports=[], analysis=DYNAMIC,
        initial={"kind": "moving", "spin": spin.tolist(), "centre": [0.5] * 3},
    )  # fmt: skip
    n = len(points)
    one = rigid(points, cells, np.tile(centre, (n, 1)), np.tile(spin, (n, 1)), np.zeros((n, 3)))
    _, (upper, lower), found, _ = accounted(case, one)
    mass, at, tensor = below_the_plane()
    assert lower.mass == pytest.approx(mass, rel=1e-12)
    assert lower.centre == pytest.approx(at, rel=1e-12)
    assert lower.inertia == pytest.approx(np.diag(tensor), rel=1e-11)
    assert upper.inertia == pytest.approx(np.diag(tensor), rel=1e-11)  # mirrored at the centre
    got = [lower.series[f"angular_momentum_{a}"][0] for a in "xyz"]
    assert got == pytest.approx(tensor @ spin, rel=1e-11)
    push = np.cross(spin, at - centre)
    assert [lower.series[f"linear_momentum_{a}"][0] for a in "xyz"] == pytest.approx(mass * push)
    assert found["angular_momentum_drift"].value < 1e-13  # of both: they turn as one
    asked = {"kind": "part", "name": "p", "point": [0.5, 0.5, 0.2]}
    body, law = body_of(case), law_of(case)
    measured = Measured(one, body, law, case)
    for what, component, value, unit in (
        ("mass", None, mass, "kg"), ("inertia", "y", tensor[1, 1], "kg m²"),
        ("angular_momentum", "x", (tensor @ spin)[0], "N m s"),
        ("linear_momentum", "z", mass * push[2], "N s"),
        ("kinetic_energy", None, 0.5 * mass * push @ push + 0.5 * spin @ tensor @ spin, "J"),
        ("strain_energy", None, 0.0, "J"),
    ):  # fmt: skip
        time = {"time": 0.0} if "moment" in what else {}
        part = PartQuantity.model_validate(
            {**asked, "of": what, **({"component": component} if component else {}), **time}
        )
        assert measured.quantity(part) == pytest.approx(value, rel=1e-11, abs=1e-14)
        assert unit_of(part, 3) == unit
    whole = PartQuantity.model_validate({"kind": "part", "name": "m", "of": "mass"})
    assert measured.quantity(whole) == pytest.approx(DENSITY, rel=1e-12)


def below_the_plane():
    """Mass, centre and inertia tensor of the cube below its plane, exact: polynomials in x, y."""
    x, w = np.polynomial.legendre.leggauss(6)
    x, w = (x + 1) / 2, w / 2
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), -1).reshape(-1, 3)
    top = height(grid)
    weight = DENSITY * np.einsum("i,j,k->ijk", w, w, w).ravel() * top
    grid[:, 2] *= top
    mass = weight.sum()
    away = grid - weight @ grid / mass
    second = np.einsum("q,qi,qj->ij", weight, away, away)
    return mass, weight @ grid / mass, np.trace(second) * np.eye(3) - second


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"loads": [{"kind": "cut_faces", "pressure": 1.0}]}, "work of a load (cut faces)"),
        ({"loads": [{"kind": "body_force", "force": ["t", 0.0]}]}, "work of a load (body force)"),
        ({"supports": [{"where": "top", "displacement": [0.1, 0.0],
                        "history": [[0.0, 0.0], [0.5, 1.0]]}]}, "work of supports that move"),
    ],
)  # fmt: skip
def test_energy_that_enters_unseen_is_not_guessed(change, said):
    """The solver may state it: then its word is the interval."""
    case, one = turning()
    case = Scene.model_validate(case.model_dump(mode="json", by_alias=True) | change)
    _, _, found, notes = accounted(case, one)
    assert "energy_drift" not in found
    assert said in notes["energy_drift"]
    name = "work_of_loads" if "load" in said else "work_of_supports"
    stated = replace(one, mass="consistent", ledger={name: np.linspace(0.0, 0.2, 7)})
    account, _, found, notes = accounted(case, stated)
    assert notes[name].endswith("is the solver's word")
    scale = account.energies.parts["kinetic"].max()
    assert found["energy_drift"].value == pytest.approx(0.2 / scale, rel=1e-9)
    assert found["energy_drift"].uncertainty > 0.2 / scale


def test_what_loads_and_damping_do_is_measured():
    """Constant and growing loads on a square that spins, against the work on its known path."""
    loads = [
        {"kind": "traction", "where": "top", "traction": [2.0, "3 * x"]},
        {"kind": "body_force", "force": ["x", -1.0], "history": [[0.0, 0.5], [0.45, 2.0]]},
    ]
    case, one = turning(loads=loads)
    content = case.model_dump(mode="json", by_alias=True)
    content["analysis"] = {**DYNAMIC, "damping": [0.1, 0.0]}
    case = Scene.model_validate(content)
    account, _, _, _ = accounted(case, replace(one, mass="consistent"))
    parts, widths = account.energies.parts, account.energies.widths
    # both halves keep their speed: 2 α T t
    kinetic = parts["kinetic"][0]
    assert parts["damping"] == pytest.approx(0.2 * kinetic * TIMES, rel=1e-12)
    # the same on the path itself, in a thousand steps: each part turns about its own centre
    upper, lower = separated_parts(one, DENSITY)
    fine = np.linspace(0.0, TIMES[-1], 1201)
    edge, weight = gauss(12)
    top = np.column_stack([edge, np.ones(12)])
    force = np.column_stack([np.full(12, 2.0), 3 * edge])
    pulled = path(top, upper.centre, 2.0, (0.3, 0.2), fine)
    work = np.einsum("q,qa,tqa->t", weight, force, pulled)
    factor = np.interp(fine, [0.0, 0.45], [0.5, 2.0])
    for part, spin, push in ((upper, 2.0, (0.3, 0.2)), (lower, -0.7, (-0.1, -0.4))):
        points, w = points_in(one.points[one.cells[part.cells]], 4)
        field = np.column_stack([points[:, 0], -np.ones(len(points))])
        place = np.einsum("q,qa,tqa->t", w, field, path(points, part.centre, spin, push, fine))
        steps = 0.5 * (factor[1:] + factor[:-1]) * np.diff(place)
        work[1:] += np.cumsum(steps)
    exact = np.interp(TIMES, fine, work)
    assert np.abs(parts["work_of_loads"] - exact).max() < 1e-4 * np.abs(exact).max()
    assert (np.abs(parts["work_of_loads"] - exact) <= widths["work_of_loads"] + 1e-6).all()
    assert widths["work_of_loads"].max() < 0.02 * np.abs(exact).max()


def gauss(count):
    """Points and weights on the unit interval."""
    x, w = np.polynomial.legendre.leggauss(count)
    return (x + 1) / 2, w / 2


def path(points, centre, spin, push, times):
    """Displacement (t, n, 2) of points of a part that turns about its centre and flies on."""
    turned = np.stack([turn([0.0, 0.0, spin], spin * t)[:2, :2] for t in np.abs(times)])
    if spin < 0:
        turned = np.swapaxes(turned, 1, 2)
    arm = points - centre
    moved = np.einsum("tij,nj->tni", turned, arm) - arm
    return moved + np.multiply.outer(times, push)[:, None]


def test_a_part_that_a_support_holds_is_not_free():
    case, one = turning(loads=[])
    held = [{"where": "top", "displacement": [0.0, 0.0]}]
    content = case.model_dump(mode="json", by_alias=True) | {"supports": held}
    _, (upper, lower), _, _ = accounted(Scene.model_validate(content), one)
    assert upper.free_from is None
    assert not upper.drift
    assert lower.free_from == 0.0
    assert lower.drift


@pytest.mark.parametrize("acting", ["support", "traction"])
def test_a_part_is_not_free_though_what_acts_on_it_ends_inside_a_facet(acting):
    """No node lies on a part of the boundary that is shorter than a facet, here 0.25 m."""
    case, one = turning(loads=[])
    narrow = "y > 1 - 1e-9 and x > 0.3 and x < 0.4"
    change = {
        "support": {"supports": [{"where": narrow, "displacement": [0.0, 0.0]}]},
        "traction": {"loads": [{"kind": "traction", "where": narrow, "traction": [1.0, 2.0]}]},
    }
    content = case.model_dump(mode="json", by_alias=True) | change[acting]
    _, (upper, lower), _, _ = accounted(Scene.model_validate(content), one)
    assert upper.free_from is None
    assert lower.drift["linear_momentum"] < 1e-13


def test_momenta_that_damping_takes_are_no_drift():
    """Of a free part that the drag α v slows: p' = m g − α p, and its spin falls off as fast."""
    drag, g = 1.7, np.array([0.4, -9.8])
    case, one = turning(loads=[{"kind": "gravity", "acceleration": g.tolist()}])
    content = case.model_dump(mode="json", by_alias=True)
    content["analysis"] = {**DYNAMIC, "kinematics": "linear", "damping": [drag, 0.0]}
    centre, way = np.array([0.3, 0.2]), one.points - [0.3, 0.2]
    turned = np.column_stack([-way[:, 1], way[:, 0]])
    left = np.exp(-drag * TIMES)[:, None, None]
    slowed = Solution(
        one.points, one.cells, np.zeros_like(one.displacement), TIMES,
        velocity=left * (turned + centre) + (1.0 - left) / drag * g,
    )  # fmt: skip
    _, _, found, _ = accounted(Scene.model_validate(content), slowed)
    for kind in ("linear", "angular"):
        assert found[f"part_{kind}_momentum_drift"].value < 1e-13


def test_parts_whose_faces_may_press_on_each_other_are_not_free():
    """Halves that rebound have other momenta afterwards, and lose none."""
    case, one = turning()
    content = case.model_dump(mode="json", by_alias=True) | {"contact": {"expected": "closed"}}
    content["analysis"] |= {"kinematics": "linear"}
    _, parts, found, notes = accounted(Scene.model_validate(content), one)
    assert [part.drift for part in parts] == [{}, {}]
    assert "linear_momentum_drift" in found
    assert "contact" in notes["part_linear_momentum_drift"]


def test_parts_that_touch_in_a_point_are_two():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 2.0]])
    cells = np.array([[0, 1, 2], [2, 3, 4]])
    found = separated_parts(Solution(points, cells, np.zeros((1, 5, 2))), 2.0)
    assert [part.mass for part in found] == [1.0, 1.0]
    assert found[0].centre[1] > found[1].centre[1]


def test_the_interval_of_what_damping_took_holds_what_a_solver_took_step_by_step():
    """Motions that few output times tell: a plate let go by a cut, and one that is pulled at once.

    The solver's own sum over its steps of 0.005 s is the truth, but for their error of order 2.
    """
    content = {
        "geometry": {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 0.7]},
        "mesh": {"cells": [[9, 6]]},
        "material": {"young": 1e4, "poisson": 0.3, "density": 1000.0, "plane": "strain"},
        "analysis": {"kind": "dynamic", "duration": 0.3, "time_step": 0.005, "outputs": 7,
                     "damping": [1.0, 0.004]},
        "initial": {"kind": "equilibrium"},
    }  # fmt: skip
    left = {"where": "left", "displacement": [0.0, 0.0]}
    right = {"where": "right", "displacement": [0.06, 0.03]}
    pulled = right | {"history": [[0.0, 0.0], [0.12, 1.0], [0.3, 0.4]]}
    cut = {"kind": "polyline", "points": [[0.45, -0.1], [0.55, 0.4]], "opens_at": 0.13}
    for supports, cuts in (([left, right], [cut]), ([left, pulled], []), ([left, pulled], [cut])):
        case = scenes.scene(cuts, **content | {"supports": supports})
        one = find_solver("xfem").solve(case, 0, 0)
        energies = motion_account(case, one, law_of(case)).energies
        off = np.abs(energies.parts["damping"] - one.ledger["damping"])
        assert (off <= energies.widths["damping"] + 1e-9).all()
        assert off.max() > 0.01 * one.ledger["damping"][-1]
