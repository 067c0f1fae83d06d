"""Membranes by the FEniCSx side: stretches, a catenary, motion, the compact solver beside it."""

import meshio
import numpy as np
import pytest
from case_texts import cut_text, sheet_text, support_text, weight_text
from reference_scenes import needs_fenicsx, square
from scipy.optimize import brentq

from reference.law import law_of as law_of_material
from reference.meshing import imprint_polygons, open_cut
from reference.space import conforming_space
from verify.compare.body import body_of
from verify.compare.hooke import law_of
from verify.compare.mass import kinetic
from verify.judge.quantities import Measured
from verify.scene import Material, load_scene
from verify.solvers import find_solver
from verify.xfem.mesh import rectangle_mesh

pytestmark = needs_fenicsx


YOUNG, THICKNESS, TILT = 1e4, 0.002, 0.6


def solve(folder, counts, shape, text, poisson=0.0, name="conforming", level=0, **parameters):
    mesh = rectangle_mesh(counts)
    points = np.column_stack(shape(*mesh.points.T))
    meshio.Mesh(points, [("triangle", mesh.cells)]).write(folder / "sheet.vtu")
    body = sheet_text("A sheet in space", "It shall carry loads by its tension.", poisson)
    turning = '[analysis]\nkinematics = "corotational"\n'
    (folder / "case.toml").write_text(body + turning + text)
    scene = load_scene(folder / "case.toml")
    return find_solver(name).solve(scene, level, repetitions=0, **parameters)


def test_plane_stress_stretches_the_sheet_as_in_the_plane(tmp_path):
    """A clamped square, one side of which is drawn away, against plane elements."""
    sides = support_text("boundary") + support_text("x > 0.999999", (0.1, 0, 0))
    two = solve(tmp_path, [3, 3], lambda x, y: (x, y, 0 * x), sides, poisson=0.3)
    assert two.displacement[0][:, 2] == pytest.approx(0.0, abs=1e-12)
    drawn = [
        {"where": "boundary", "displacement": [0, 0]},
        {"where": "x > 0.999999", "displacement": [0.1, 0]},
    ]
    flat = square(
        mesh={"cells": [[3, 3]]},
        material={"young": YOUNG, "poisson": 0.3, "plane": "stress"},
        analysis={"kinematics": "corotational"},
        supports=drawn,
        loads=[],
    )
    plane = find_solver("conforming").solve(flat, 0, repetitions=0)
    energy = THICKNESS * plane.ledger["strain"][0]
    assert two.ledger["strain"][0] == pytest.approx(energy, rel=1e-10)


def catenary(span):
    """Horizontal force, sag and energy of an elastic cable of length 1 between equal heights."""
    stiffness, weight = YOUNG * THICKNESS, 1000.0 * 9.8 * THICKNESS

    def reach(h):
        return h / stiffness + 2 * h / weight * np.arcsinh(0.5 * weight / h) - span

    h = brentq(reach, 1e-6 * weight, stiffness)
    s = np.linspace(0.0, 1.0, 20001)
    tension = np.hypot(h, weight * (0.5 - s))
    slope = weight * (0.5 - s) / tension  # times the stretched element
    sag = np.trapezoid(np.where(s <= 0.5, slope * (1 + tension / stiffness), 0.0), s)
    return sag, np.trapezoid(tension**2, s) / (2 * stiffness)


def test_a_strip_hangs_as_the_elastic_catenary(tmp_path):
    span = 0.9
    ends = support_text("x < 1e-9") + support_text("x > 0.999999", (span - 1.0, 0, 0))
    sag, energy = catenary(span)
    errors = []
    for n in (8, 16):
        found = solve(tmp_path, [n, 1], strip, ends + weight_text(3), degree=2)
        middle = np.abs(found.points[:, 0] - 0.5) < 1e-9
        assert -found.displacement[0][middle, 2] == pytest.approx(sag, rel=2e-3)
        errors.append(abs(found.ledger["strain"][0] / (0.1 * energy) - 1))
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] > 8  # quadratic elements: h⁴ in the energy of smooth fields


def strip(x, y):
    return x, 0.1 * y, 0 * x


def bowl_shape(x, y):
    return x, y, -3.0 * x * (1 - x) * y * (1 - y)


def test_each_crossing_of_cuts_in_a_surface_opens_into_its_sectors():
    grid = rectangle_mesh([5, 5])
    points = np.column_stack([*grid.points.T, 0.2 * np.sin(3 * grid.points[:, 0])])
    one = np.array([[0.13, 0.42, -1], [0.87, 0.53, -1], [0.87, 0.53, 1], [0.13, 0.42, 1]])
    two = np.array([[0.48, 0.1, -1], [0.55, 0.9, -1], [0.55, 0.9, 1], [0.48, 0.1, 1]])
    mesh = open_cut(*imprint_polygons(points, grid.cells, [one, two]))
    assert np.bincount(mesh.parent).max() == 4
    assert mesh.pieces.max() == 0
    a, b = mesh.realised_cut.swapaxes(0, 1)
    plan = np.linalg.norm((b - a)[:, :2], axis=1).sum()
    assert plan == pytest.approx(np.hypot(0.74, 0.11) + np.hypot(0.07, 0.8), rel=1e-9)
    # no area is lost
    x = mesh.points[mesh.cells]
    area = 0.5 * np.abs(np.linalg.det((x[:, 1:] - x[:, :1])[:, :, :2])).sum()
    assert area == pytest.approx(1.0, rel=1e-12)


SKIN = Material(young=1e4, poisson=0.3, density=1000.0, thickness=0.002)
NONE = np.zeros((0, 2), dtype=np.int64)
HANGING = support_text("boundary") + weight_text(3)
SPINNING = """
[initial]
kind = "moving"
spin = [1.0, 3.0, -2.0]
centre = [0.5, 0.5, -0.2]
velocity = [0.3, -0.1, 0.2]
"""


def bowl(n):
    mesh = rectangle_mesh([n, n])
    return np.column_stack(bowl_shape(*mesh.points.T)), mesh.cells


def bowl_scene(folder, n, text, duration=0.2, step=0.01, outputs=5, opens=0.0, at=0.5, cut=None):
    points, cells = bowl(n)
    meshio.Mesh(points, [("triangle", cells)]).write(folder / "sheet.vtu")
    analysis = (
        '[analysis]\nkind = "dynamic"\nkinematics = "corotational"\n'
        f"duration = {duration}\ntime_step = {step}\noutputs = {outputs}\n"
    )
    corners = [(at, 0.25, -2), (at, 0.75, -2), (at, 0.75, 1), (at, 0.25, 1)]
    cut = cut or f"{cut_text(*corners)}opens_at = {opens}\n"
    body = sheet_text("A bowl of skin", "It shall move as membranes do.")
    (folder / "case.toml").write_text(body + analysis + cut + text)
    return load_scene(folder / "case.toml")


def moved(scene, name="conforming", level=0, **parameters):
    return find_solver(name).solve(scene, level, repetitions=0, **parameters)


def test_the_mean_force_on_a_membrane_is_a_discrete_gradient_and_turns_nothing():
    space = conforming_space(open_cut(*bowl(2), NONE), 2)
    mechanics, x = law_of_material(SKIN, space, "corotational"), space.node_points
    random = np.random.default_rng(1)
    for size in (1e-3, 0.05, 0.2):
        u, later = size * random.standard_normal((2, *x.shape))
        force = mechanics.averaged(u.ravel(), later.ravel())
        gained = mechanics.energy(later.ravel()) - mechanics.energy(u.ravel())
        scale = np.abs(force) @ np.abs(later - u).ravel() + mechanics.energy(later.ravel())
        # rel: s − 2 of stretches near one loses digits, which the stretch multiplies by Ū⁻¹
        assert force @ (later - u).ravel() == pytest.approx(gained, abs=1e-11 * scale)
        force, place = force.reshape(-1, 3), x + 0.5 * (u + later)
        moment = np.cross(place, force).sum(axis=0)
        assert np.abs(moment).max() < 1e-11 * np.abs(place).max() * np.abs(force).sum()
        assert np.abs(force.sum(axis=0)).max() < 1e-11 * np.abs(force).sum()
    u = 0.1 * random.standard_normal(x.size)
    force = mechanics.force(u)
    assert mechanics.averaged(u, u) == pytest.approx(force, abs=1e-11 * np.abs(force).max())


def test_a_torn_bowl_that_tumbles_keeps_its_energy_and_all_six_momenta(tmp_path):
    scene = bowl_scene(tmp_path, 4, SPINNING, duration=0.5, opens=0.1, outputs=6)
    found = moved(scene, scheme="energy_momentum")
    ledger = found.ledger
    energy = ledger["kinetic"] + ledger["strain"]
    assert np.abs(energy - energy[0]).max() < 1e-10 * energy[0]
    assert ledger["strain"].max() > 1e-3 * energy[0]  # it is stretched by its spin
    for kind in ("linear", "angular"):
        rows = np.array([ledger[f"{kind}_momentum_{axis}"] for axis in "xyz"])
        assert np.abs(rows - rows[:, :1]).max() < 1e-10 * np.linalg.norm(rows[:, 0])
    # the comparison measures the same from the velocities, by a quadrature of its own
    measured = kinetic(found, 1000.0 * 0.002)
    assert measured.energy == pytest.approx(ledger["kinetic"], rel=1e-12)
    for axis, momentum in zip("xyz", measured.angular.T, strict=True):
        assert momentum == pytest.approx(ledger[f"angular_momentum_{axis}"], rel=1e-10)


def test_a_bowl_that_is_let_go_moves_as_that_of_the_compact_solver(tmp_path):
    """Linear elements, a cut along edges, the same scheme: two programs, one motion."""
    scene = bowl_scene(tmp_path, 4, HANGING)
    ours = moved(scene, scheme="newmark")
    other = moved(scene, "xfem", scheme="newmark", mass="consistent")
    for name in ("strain", "kinetic"):
        scale = np.abs(ours.ledger[name]).max()
        assert ours.ledger[name] == pytest.approx(other.ledger[name], abs=1e-7 * scale)
    falls = [f.displacement[:, :, 2].min(axis=1) for f in (ours, other)]
    assert falls[0] == pytest.approx(falls[1], abs=1e-7 * np.abs(falls[0]).max())


@pytest.mark.parametrize("name, off", [("reference", 0.002), ("xfem", 0.03)])
def test_the_lips_of_a_tear_fly_apart_with_the_elastic_wave(name, off):
    """Without lateral contraction the motion is linear along the band at any stretch."""
    scene = load_scene("dynamics/membrane_torn")
    level = 1 if name == "reference" else 0
    found = Measured(moved(scene, name, level), body_of(scene), law_of(scene), scene)
    for asked in scene.quantities:
        wanted = 2 * np.sqrt(1e4 / 1000.0) * 0.1 * asked.time  # d'Alembert
        assert found.quantity(asked) == pytest.approx(wanted, rel=off)
