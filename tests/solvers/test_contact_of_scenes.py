"""Faces of cuts that touch, in every solver that offers contact."""

import meshio
import numpy as np
import pytest
import scenes

import verify.xfem as xfem
from verify.errors import UnsupportedSceneError
from verify.solvers import find_solver

P = 0.02


def body(dimension, cuts, exact, **changes):
    content = {
        "mesh": {"cells": [[5] * dimension]},
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "contact": {"expected": "closed"},
        "exact": exact,
    }
    return scenes.scene(cuts, dimension, **content | changes)


def pressed(dimension, along=0.4):
    """A cut at any angle under pressure across it, and other stress along it: a linear field."""
    d, nu = dimension, 0.3
    normal = np.array([-0.37, 1.0] if d == 2 else [-0.3, 0.2, 1.0])
    normal /= np.linalg.norm(normal)
    across = np.outer(normal, normal)
    stress = -P * across + along * P * (np.eye(d) - across)
    shear, lame = 1.0 / (2 * (1 + nu)), nu / ((1 + nu) * (1 - 2 * nu))
    trace = np.trace(stress) / (d * lame + 2 * shear)
    matrix = (stress - lame * trace * np.eye(d)) / (2 * shear)
    ring = [(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1)]
    cut = {"kind": "polyline", "points": [[-0.1, 0.258], [1.1, 0.702]]}
    if d == 3:
        cut = {"kind": "polygon", "points": [[x, y, 0.42 + 0.3 * x - 0.2 * y] for x, y in ring]}
    return body(d, [cut], {"solution": "linear", "parameters": {"matrix": matrix.tolist()}}), matrix


@pytest.mark.parametrize(
    "name, dimension",
    [("xfem", 2), ("xfem", 3), ("virtual_node", 3), ("virtual_node_arbitrary", 2),
     ("subdivision", 3), ("snapping", 2), ("snapping", 3)],
)  # fmt: skip
def test_a_pressed_cut_is_not_felt(name, dimension):
    # facets of moved nodes lie on the cut in the plane alone
    scene, matrix = pressed(dimension, along=-1.0 if name == "snapping" else 0.4)
    found = find_solver(name).solve(scene, 0)
    exact = found.points @ matrix.T
    assert np.abs(found.displacement[0] - exact).max() < 1e-12
    pressure = found.contact
    assert np.abs(pressure.pressure / P - 1.0).max() < 1e-9
    area = np.hypot(1.0, 0.37) if dimension == 2 else np.linalg.norm([-0.3, 0.2, 1.0])
    rough = name == "snapping" and dimension == 3
    assert pressure.weights.sum() == pytest.approx(area, rel=0.1 if rough else 1e-6)
    assert found.iterations["contact"] == 1


@pytest.mark.parametrize("name", ["uncut", "removal", "mass_spring"])
def test_a_method_without_faces_refuses(name):
    scene, _ = pressed(2)
    assert "contact" in find_solver(name).refuses(scene)


@pytest.mark.parametrize("slivers", ["merge", "penalise"])
def test_slivers_that_follow_others_are_refused_by_name(slivers):
    scene, _ = pressed(2)
    with pytest.raises(UnsupportedSceneError, match="slivers = 'keep'"):
        find_solver("xfem").solve(scene, 0, slivers=slivers)


AXES = np.array([[0.64, -0.48, 0.6], [0.6, 0.8, 0.0], [-0.48, 0.36, 0.8]])  # along, and two across
PLACE, SPEED = np.array([0.3, 0.2, -0.1]), 1e-3


def colliding(folder, n):
    """Halves of a bar at an angle, of length and wave speed 1, that touch and fly at each other.

    n is odd: the cut is in the middle of elements. Without lateral contraction nothing else moves.
    """
    mesh = xfem.box_mesh((n, 2, 2), (-1.0, 0.0, 0.0), (1.0, 0.3, 0.3))
    meshio.Mesh(mesh.points @ AXES + PLACE, [("tetra", mesh.cells)]).write(folder / f"{n}.vtu")
    ring = np.array([[0.0, y, z] for y, z in [(-1, -1), (2, -1), (2, 2), (-1, 2)]]) @ AXES + PLACE
    impact = {"half_length": 1.0, "at": AXES[0] @ PLACE, "axis": AXES[0].tolist(), "speed": SPEED}
    return scenes.scene(
        [{"kind": "polygon", "points": ring.tolist()}], 3,
        geometry={"kind": "file", "file": folder / f"{n}.vtu", "dimension": 3},
        mesh={"pattern": "given"}, material=scenes.soft(3, poisson=0.0, density=1.0), supports=[],
        analysis={"kind": "dynamic", "duration": 2.4, "outputs": 9, "time_step": 2.0 / n},
        initial={"kind": "field", "displacement": "exact", "velocity": "exact"},
        exact={"solution": "impact", "parameters": impact}, contact={"expected": "closed"},
    )  # fmt: skip


def momenta(found, kept):
    """Linear and angular momentum (t, 3) of cells `kept` about `PLACE`; fields are linear."""
    x, v = found.points[found.cells[kept]] - PLACE, found.velocity[:, found.cells[kept]]
    sizes = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / 6.0
    moments = np.cross(x.sum(axis=1), v.sum(axis=2)) + np.cross(x, v).sum(axis=2)
    return np.einsum("c,tcid->td", sizes / 4.0, v), np.einsum("c,tcd->td", sizes / 20.0, moments)


@pytest.mark.parametrize("name, given", [("xfem", {"mass": "consistent"}), ("conforming", {})])
def test_halves_of_an_inclined_bar_in_space_collide_as_d_alembert_has_it(name, given, tmp_path):
    lost, unit = [], 0.09 * SPEED  # momentum of a half
    for n in (15, 31):
        found = find_solver(name).solve(colliding(tmp_path, n), 0, 0, **given)
        energy = found.ledger["kinetic"] + found.ledger["strain"]
        assert energy[0] == pytest.approx(unit * SPEED, rel=1e-12)
        assert energy.max() <= energy[0] * (1.0 + 1e-10)
        lost.append(1.0 - energy[-1] / energy[0])
        upper = (found.points[found.cells].mean(axis=1) - PLACE) @ AXES[0] > 0.0
        ours, theirs = momenta(found, upper), momenta(found, ~upper)
        for own, other in zip(ours, theirs, strict=True):
            assert np.abs(own + other).max() < 1e-9 * unit
        along = ours[0] @ AXES[0] / unit
        assert np.abs(ours[0] / unit - np.outer(along, AXES[0])).max() < 1e-9
        # together for 2L/c under ρ c v; the force sets in and ends over an element
        assert np.abs(along - np.clip(found.times - 1.0, -1.0, 1.0))[:-2].max() < 2.0 / n
        # a front is as wide as (h/L)^(2/3), and half of it is behind
        assert 0.0 <= 1.0 - along[-1] < 0.5 * (2.0 / n) ** (2.0 / 3.0)
    assert lost[1] < 0.02  # as of contact/impact
    assert lost[0] > 1.5 * lost[1] or lost[0] < 1e-12


SPIN = 0.15


def spinning(model="hooke", opens_at=0.0, **changes):
    """Halves of a bar at 25° that are pressed together as they spin, and part."""
    along = np.array([np.cos(np.deg2rad(25.0)), np.sin(np.deg2rad(25.0))])
    across = np.array([-along[1], along[0]])
    corners = [s * along + 0.2 * t * across for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    cut = [0.1 * along + 0.3 * sign * (across - 0.18 * along) for sign in (-1.0, 1.0)]
    speed = [f"{0.02 * a * along[0]}*x + {0.02 * a * along[1]}*y" for a in along]
    content = {
        "geometry": {"kind": "polygon", "corners": [one.tolist() for one in corners]},
        "mesh": {"pattern": "unstructured", "sizes": [0.08]},
        "material": scenes.soft(density=1.0, model=model), "supports": [],
        "contact": {"expected": "closed"},
        "initial": {"kind": "field", "velocity": [f"-{SPIN}*y - ({speed[0]})",
                                                  f"{SPIN}*x - ({speed[1]})"]},
        "analysis": {"kind": "dynamic", "kinematics": "finite_rotation", "duration": 4.0,
                     "outputs": 9, "time_step": 0.05},
    }  # fmt: skip
    content = {key: value for key, value in (content | changes).items() if value is not None}
    line = {"kind": "polyline", "points": [one.tolist() for one in cut], "opens_at": opens_at}
    return scenes.scene([line], **content)


def forces_of_spinning(name, scene, **given):
    """Contact forces at the output times; energy and spin are kept."""
    found = find_solver(name).solve(scene, 0, 0, scheme="energy_momentum", **given)
    energy = found.ledger["kinetic"] + found.ledger["strain"]
    assert energy.max() <= energy[0] * (1.0 + 1e-12)
    assert energy[-1] > 0.99 * energy[0]
    turn = np.array(found.ledger["angular_momentum_z"])
    assert np.abs(turn - turn[0]).max() < 1e-11 * turn[0]
    return found.contact.pressure @ found.contact.weights


def test_methods_agree_on_halves_that_spin_and_keep_their_spin():
    pressures = {}
    for name, given in (("conforming", {"mesh": "remeshed", "degree": 2}), ("xfem", {}),
                        ("virtual_node", {}), ("snapping", {})):  # fmt: skip
        pressures[name] = forces_of_spinning(name, spinning(), **given)
    truth = pressures.pop("conforming")
    assert truth[1:3].min() > 0.001
    for found in pressures.values():
        # h is a fifth of the width; the conforming mesh states a mean of two steps, 5 % of a fall
        assert np.abs(found - truth).max() < 0.2 * truth.max()
        assert (found[-2:] == 0.0).all()


@pytest.mark.parametrize("name, given", [("conforming", {"mesh": "remeshed"}), ("xfem", {})])
def test_other_laws_press_alike_keep_spin_and_gain_nothing_from_a_cut_that_opens(name, given):
    """At strains of 1 % they are Hooke's; a cut that opens at 0.5 s is pressed at once."""
    forces = {}
    for law in ("hooke", "neo_hookean", "stable_neo_hookean"):
        forces[law] = forces_of_spinning(name, spinning(law, opens_at=0.5), **given)
    hooke = forces["hooke"]
    assert hooke[2] > 0.001
    assert all(np.abs(one - hooke).max() < 0.02 * hooke.max() for one in forces.values())


LEAN, PRESS = np.deg2rad(25.0), 0.2


def turn_of(angle):
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    return np.array([[c, -s], [s, c]])


def stack(angle, model, **changes):
    """A stack that leans by 25°, cut across, between plates that turn and press it to 0.8.

    Without lateral contraction F = R (1 − 0.2 a⊗a), and the pressure is −∂W/∂λ, by E = 1 and λ = 0:
    1 − λ of Hooke's law, ½ (1/λ − λ) of the neo-Hookean one.
    """
    along = np.array([np.cos(LEAN), np.sin(LEAN)])
    across = np.array([-along[1], along[0]])
    corners = [s * along + 0.4 * t * across for s, t in ((0, -1), (1, -1), (1, 1), (0, 1))]
    cut = [0.47 * along + sign * 0.6 * across for sign in (-1.0, 1.0)]
    turn = {"angle": angle, "centre": [0.0, 0.0]}
    moved = -PRESS * turn_of(angle) @ along
    content = {
        "geometry": {"kind": "polygon", "corners": [one.tolist() for one in corners]},
        "mesh": {"pattern": "unstructured", "sizes": [0.2]}, "reference": {"size": 0.5},
        "material": scenes.soft(poisson=0.0, model=model), "contact": {"expected": "closed"},
        "analysis": {"kind": "static", "kinematics": "finite_rotation"},
        "supports": [
            {"where": f"{along[0]}*x + {along[1]}*y < 1e-6", "displacement": [0.0, 0.0],
             "rotation": turn},
            {"where": f"{along[0]}*x + {along[1]}*y > 0.999999", "displacement": moved.tolist(),
             "rotation": turn},
        ],
    }  # fmt: skip
    line = {"kind": "polyline", "points": [one.tolist() for one in cut]}
    F = turn_of(angle) @ (np.eye(2) - PRESS * np.outer(along, along))
    left = 1.0 - PRESS
    pressure = PRESS if model == "hooke" else 0.5 * (1.0 / left - left)
    return scenes.scene([line], **content | changes), F, pressure


@pytest.mark.parametrize("model", ["hooke", "neo_hookean"])
@pytest.mark.parametrize(
    "name, given",
    [("xfem", {}), ("virtual_node", {}), ("snapping", {}), ("subdivision", {}),
     ("conforming", {}), ("conforming", {"mesh": "remeshed", "degree": 2}), ("reference", {})],
)  # fmt: skip
def test_a_stack_that_is_pressed_and_turned_has_the_stress_of_one_piece(name, given, model):
    for angle in (30.0, 120.0):
        scene, F, pressure = stack(angle, model)
        solver = find_solver(name)
        assert solver.refuses(scene) is None
        found = solver.solve(scene, 0, 0, **given)
        exact = found.points @ (F - np.eye(2)).T
        assert np.abs(found.displacement[0] - exact).max() < 1e-10
        assert np.abs(found.contact.pressure / pressure - 1.0).max() < 1e-8
        assert found.contact.weights.sum() == pytest.approx(0.8, rel=1e-9)


@pytest.mark.parametrize("name", ["xfem", "conforming"])
def test_a_motion_that_is_pressed_and_turned_begins_in_its_equilibrium(name):
    """The first state is that at rest, and nothing moves from there."""
    analysis = {"kind": "dynamic", "kinematics": "finite_rotation", "duration": 1.0,
                "outputs": 3, "time_step": 0.05}  # fmt: skip
    initial = {"kind": "equilibrium", "cuts": "open"}
    material = scenes.soft(poisson=0.0, density=1.0)
    scene, F, pressure = stack(
        120.0, "hooke", analysis=analysis, initial=initial, material=material
    )
    found = find_solver(name).solve(scene, 0, 0, scheme="energy_momentum")
    exact = found.points @ (F - np.eye(2)).T
    assert np.abs(found.displacement - found.displacement[0]).max() < 1e-8
    # of xfem a penalty holds the faces in motion: they overlap by p/γ, 0.04 p h/E
    assert np.abs(found.displacement - exact).max() < (0.1 * 0.2 * 0.2 if name == "xfem" else 1e-8)
    force = found.contact.pressure @ found.contact.weights
    assert np.abs(force / (0.8 * pressure) - 1.0).max() < (0.02 if name == "xfem" else 1e-6)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_motion_from_an_equilibrium_of_faces_that_touch_and_part_stays_there(dimension):
    """Pressed aslant, so that a part of the cut is open: the body neither moves nor rings."""
    line = {"kind": "polyline", "points": [[-0.1, 0.41], [1.1, 0.57]]}
    ring = [(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1)]
    plane = {"kind": "polygon", "points": [[x, y, 0.42 + 0.13 * x - 0.1 * y] for x, y in ring]}
    low, high = ("bottom", "top") if dimension == 2 else ("z < 1e-6", "z > 0.999999")
    still, moved = [0.0] * dimension, [2e-3, *[0.0] * (dimension - 2), "-4e-3 + 6e-3*x"]
    content = {
        "material": scenes.soft(dimension, density=1.0), "contact": {"expected": "closed"},
        "supports": [{"where": low, "displacement": still}, {"where": high, "displacement": moved}],
    }  # fmt: skip
    cuts = [line if dimension == 2 else plane]
    rest = find_solver("xfem").solve(scenes.scene(cuts, dimension, **content), 0, 0).contact
    assert 0.1 < np.mean(rest.pressure > 0.0) < 0.9
    analysis = {"kind": "dynamic", "duration": 1.0, "outputs": 5, "time_step": 0.05}
    initial = {"kind": "equilibrium", "cuts": "open"}
    scene = scenes.scene(cuts, dimension, analysis=analysis, initial=initial, **content)
    found = find_solver("xfem").solve(scene, 0, 0)
    assert np.abs(found.displacement - found.displacement[0]).max() < 1e-9 * 4e-3
    forces = found.contact.pressure @ found.contact.weights
    # faces overlap by 0.04 p h/E, of a quarter of the body's height
    assert np.abs(forces / (rest.pressure[0] @ rest.weights) - 1.0).max() < 0.04


@pytest.mark.parametrize(
    "kinematics, scheme, within",
    [("linear", "newmark", 3e-3), ("corotational", "energy_momentum", 3e-3),
     ("linear", "implicit_euler", 3e-3)],
)  # fmt: skip
def test_pressures_that_grow_slowly_are_those_at_rest_at_the_same_time(kinematics, scheme, within):
    """Of tiny displacements. Half a step of delay is 2 to 2.5 %; a step is longer than a period."""
    drawn = {"contact": {"expected": "closed"}, "material": scenes.soft(density=1e-6)}
    held = {"where": "bottom", "displacement": [0.0, 0.0]}
    top = {"where": "top", "displacement": [0.0, "-1e-5 * (1 + t*t)"]}
    line = {"kind": "polyline", "points": [[-0.1, 0.31], [1.1, 0.74]]}
    motion = {"kind": "dynamic", "kinematics": kinematics, "duration": 1.0, "time_step": 0.05,
              "outputs": 3}  # fmt: skip
    initial = {"kind": "equilibrium", "cuts": "open"}
    scene = scenes.scene([line], supports=[held, top], analysis=motion, initial=initial, **drawn)
    contact = find_solver("xfem").solve(scene, 0, 0, scheme=scheme).contact
    forces = contact.pressure @ contact.weights
    np.testing.assert_allclose(forces[1:], np.array([1.25, 2.0]) * forces[0], rtol=within)


def test_the_pressure_of_tissue_in_two_principal_directions_is_that_of_each_cut():
    """Two cuts that cross along the principal axes, each under a pressure of its own."""
    turn = turn_of(27.0)
    stress = -P * turn @ np.diag([1.0, 2.5]) @ turn.T
    shear, lame = 1.0 / 2.6, 0.3 / (1.3 * 0.4)
    matrix = (stress - lame * np.trace(stress) / (2 * lame + 2 * shear) * np.eye(2)) / (2 * shear)
    ends = np.array([[-1.0, 1.0]]).T
    lines = [(0.47, 0.52) + ends * axis for axis in turn.T]
    cuts = [{"kind": "polyline", "name": f"cut {k}", "points": line.tolist()}
            for k, line in enumerate(lines)]  # fmt: skip
    exact = {"solution": "linear", "parameters": {"matrix": matrix.tolist()}}
    found = find_solver("xfem").solve(body(2, cuts, exact), 0).contact
    on_first = np.abs((found.points - (0.47, 0.52)) @ turn[:, 1]) < 1e-9
    assert 0.3 < np.mean(on_first) < 0.7
    truth = P * np.where(on_first, 2.5, 1.0)
    assert np.abs(found.pressure[0] / truth - 1.0).max() < 1e-9


@pytest.mark.parametrize("name", ["conforming", "xfem"])
def test_a_motion_that_is_damped_ends_in_the_equilibrium(name):
    """A block turned by 70° and pressed aslant: its cut is shut over a part of its length."""
    turn = {"angle": 70.0, "centre": [0.5, 0.0]}
    R = turn_of(70.0)
    ends = [{"where": "bottom", "displacement": [0.0, 0.0], "rotation": turn},
            {"where": "top", "displacement": (R @ [0.02, -0.05]).tolist(),
             "rotation": turn | {"angle": 76.0}}]  # fmt: skip
    slowly = [one | {"history": [[0.0, 0.0], [200.0, 1.0], [400.0, 1.0]]} for one in ends]
    content = {"material": scenes.soft(density=1.0), "contact": {"expected": "closed"}}
    cut = {"kind": "polyline", "points": [[-0.1, 0.41], [1.1, 0.57]]}
    still = {"kind": "static", "kinematics": "finite_rotation"}
    scene = scenes.scene([cut], analysis=still, supports=ends, **content)
    rest = find_solver(name).solve(scene, 0, 0)
    assert 0.1 < np.mean(rest.contact.pressure > 0.0) < 0.9
    # then implicit Euler divides what swings by ωΔt, 10 at least, in each of 10 steps
    motion = {"kind": "dynamic", "kinematics": "finite_rotation", "duration": 400.0,
              "time_step": 20.0, "outputs": 2}  # fmt: skip
    scene = scenes.scene([cut], analysis=motion, supports=slowly, **content)
    found = find_solver(name).solve(scene, 0, 0, scheme="implicit_euler")
    far = np.abs(found.displacement[-1] - rest.displacement[0]).max()
    force, other = (one.contact.pressure[-1] @ one.contact.weights for one in (found, rest))
    # the motion of xfem has another contact, whose faces overlap by 0.04 p h/E
    assert far < (1e-9 if name == "conforming" else 0.1 * 0.25 * rest.contact.pressure.max())
    assert force == pytest.approx(other, rel=1e-8 if name == "conforming" else 0.05)


@pytest.mark.parametrize("name", ["xfem", "conforming"])
def test_strains_of_a_thousandth_in_space_press_as_in_linear_kinematics(name, tmp_path):
    linear = colliding(tmp_path, 7)
    analysis = linear.analysis.model_copy(update={"kinematics": "corotational"})
    turning = linear.model_copy(update={"analysis": analysis})
    one, other = (
        find_solver(name).solve(scene, 0, 0, scheme="energy_momentum")
        for scene in (linear, turning)
    )
    size = np.abs(one.displacement).max()
    assert np.abs(other.displacement - one.displacement).max() < 5.0 * SPEED * size
    forces = [found.contact.pressure @ found.contact.weights for found in (one, other)]
    assert forces[0].max() > 0.5 * SPEED * 0.09  # ρ c v times the area
    assert np.abs(forces[1] - forces[0]).max() < 0.02 * forces[0].max()


@pytest.mark.parametrize("name", ["conforming", "xfem"])
def test_faces_keep_their_pressure_when_another_cut_opens(name):
    """A pressed body bears the same force across the first cut before, at and after the second."""
    squeezed = [{"where": "bottom", "displacement": [0.0, 0.0]},
                {"where": "top", "displacement": [0.0, -0.02]}]  # fmt: skip
    scene = scenes.scene(
        [{"kind": "polyline", "points": [[-0.1, 0.31], [1.1, 0.33]], "opens_at": 0.05},
         {"kind": "polyline", "points": [[-0.1, 0.71], [1.1, 0.68]], "opens_at": 0.4,
          "name": "second"}],
        supports=squeezed, material=scenes.soft(density=1.0), contact={"expected": "closed"},
        analysis={"kind": "dynamic", "duration": 0.6, "outputs": 4, "time_step": 0.025},
        initial={"kind": "equilibrium"},
    )  # fmt: skip
    contact = find_solver(name).solve(scene, 0, 0).contact
    first = contact.points[:, 1] < 0.5
    forces = contact.pressure[:, first] @ contact.weights[first]
    # between a bar with free sides, E/(1 − ν²), and one whose sides are held, λ + 2μ
    assert forces[1:].min() > 0.02 / (1.0 - 0.3**2) * 0.9
    assert forces[1:].max() < 0.02 * 1.35


@pytest.mark.parametrize(
    "name, given",
    [("xfem", {}), ("conforming", {}), ("conforming", {"mesh": "remeshed", "degree": 2})],
)
def test_a_cut_that_opens_in_a_body_pressed_at_rest_stays_closed(name, given):
    """Equilibrium of the whole body: faces without friction slide by little, and bear it all."""
    squeezed = [{"where": "bottom", "displacement": [0.0, 0.0]},
                {"where": "top", "displacement": [0.0, -0.02]}]  # fmt: skip
    scene = scenes.scene(
        [{"kind": "polyline", "points": [[-0.1, 0.41], [1.1, 0.47]], "opens_at": 0.1}],
        supports=squeezed, material=scenes.soft(density=1.0), contact={"expected": "closed"},
        analysis={"kind": "dynamic", "kinematics": "finite_rotation", "duration": 0.6,
                  "outputs": 4, "time_step": 0.05},
        initial={"kind": "equilibrium"},
    )  # fmt: skip
    found = find_solver(name).solve(scene, 0, 0, scheme="energy_momentum", **given)
    energy = found.ledger["kinetic"] + found.ledger["strain"]
    assert energy.max() <= energy[0] * (1.0 + 1e-12)
    force = found.contact.pressure @ found.contact.weights
    # between a bar with free sides, E/(1 − ν²), and one whose sides are held, λ + 2μ
    assert force[0] < 1e-15
    assert force[1:].min() > 0.02 / (1.0 - 0.3**2) * 0.9
    assert force[1:].max() < 0.02 * 1.35
