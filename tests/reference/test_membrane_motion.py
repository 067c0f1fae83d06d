"""Motion of membranes at finite rotation: what is conserved, and the compact solver beside it."""

import meshio
import numpy as np
import pytest
from case_texts import cut_text, sheet_text, support_text, weight_text
from reference_scenes import needs_fenicsx

from reference.meshing import open_cut
from verify.compare.kinetic import kinetic
from verify.scene import Material, load_scene
from verify.solvers import find_solver
from verify.xfem.structured_meshes import rectangle_mesh

pytestmark = needs_fenicsx

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
    x, y = mesh.points.T
    return np.column_stack([x, y, -3.0 * x * (1 - x) * y * (1 - y)]), mesh.cells


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


@pytest.mark.parametrize("degree", [1, 2])
def test_the_mean_force_on_a_membrane_is_a_discrete_gradient_and_turns_nothing(degree):
    from reference.dynamics_law import CorotatedLaw
    from reference.space import conforming_space

    space = conforming_space(open_cut(*bowl(2), NONE), degree)
    mechanics, x = CorotatedLaw(SKIN, space), space.node_points
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
    from verify.assess.quantities import Measured
    from verify.compare.body import body_of
    from verify.compare.hooke import law_of

    scene = load_scene("dynamics/membrane_torn")
    level = 1 if name == "reference" else 0
    found = Measured(moved(scene, name, level), body_of(scene), law_of(scene), scene)
    for asked in scene.quantities:
        wanted = 2 * np.sqrt(1e4 / 1000.0) * 0.1 * asked.time  # d'Alembert
        assert found.quantity(asked) == pytest.approx(wanted, rel=off)
