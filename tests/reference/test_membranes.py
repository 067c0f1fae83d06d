"""Membranes in space by the FEniCSx side: exact stretches, a catenary, the compact solver."""

import meshio
import numpy as np
import pytest
from case_texts import cut_text, sheet_text, support_text, weight_text
from reference_scenes import needs_fenicsx
from scipy.optimize import brentq

from reference.meshing import imprint_surface, open_cut
from verify.scene import load_scene
from verify.solvers import find_solver
from verify.xfem.structured_meshes import rectangle_mesh

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
    flat = {
        "title": "sheet",
        "requirement": "none",
        "geometry": {"kind": "rectangle", "lower": [0, 0], "upper": [1, 1]},
        "mesh": {"cells": [[3, 3]]},
        "material": {"young": YOUNG, "poisson": 0.3, "plane": "stress"},
        "analysis": {"kinematics": "corotational"},
        "supports": [
            {"where": "boundary", "displacement": [0, 0]},
            {"where": "x > 0.999999", "displacement": [0.1, 0]},
        ],
    }
    from verify.scene import Scene

    plane = find_solver("conforming").solve(Scene.model_validate(flat), 0, repetitions=0)
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


@pytest.mark.parametrize("span", [1.0, 0.9])
def test_a_strip_hangs_as_the_elastic_catenary(tmp_path, span):
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


def bowl(x, y):
    return x, y, -3.0 * x * (1 - x) * y * (1 - y)


@pytest.mark.parametrize("n", [8, 24])
def test_linear_elements_are_those_of_the_compact_solver_where_a_cut_runs_along_edges(tmp_path, n):
    """A hanging bowl, cut halfway in; the two have no code in common."""
    cut = cut_text((0.5, 0.25, -2), (0.5, 0.75, -2), (0.5, 0.75, 1), (0.5, 0.25, 1))
    text = support_text("boundary") + weight_text(3) + cut
    ours = solve(tmp_path, [n, n], bowl, text, poisson=0.3)
    other = solve(tmp_path, [n, n], bowl, text, poisson=0.3, name="xfem")
    assert ours.ledger["strain"][0] == pytest.approx(other.ledger["strain"][0], rel=1e-8)


def test_each_crossing_of_cuts_in_a_surface_opens_into_its_sectors():
    grid = rectangle_mesh([5, 5])
    points = np.column_stack([*grid.points.T, 0.2 * np.sin(3 * grid.points[:, 0])])
    one = np.array([[0.13, 0.42, -1], [0.87, 0.53, -1], [0.87, 0.53, 1], [0.13, 0.42, 1]])
    two = np.array([[0.48, 0.1, -1], [0.55, 0.9, -1], [0.55, 0.9, 1], [0.48, 0.1, 1]])
    mesh = open_cut(*imprint_surface(points, grid.cells, [one, two]))
    assert np.bincount(mesh.parent).max() == 4
    assert mesh.pieces.max() == 0
    a, b = mesh.realised_cut.swapaxes(0, 1)
    plan = np.linalg.norm((b - a)[:, :2], axis=1).sum()
    assert plan == pytest.approx(np.hypot(0.74, 0.11) + np.hypot(0.07, 0.8), rel=1e-9)
    # no area is lost
    x = mesh.points[mesh.cells]
    area = 0.5 * np.abs(np.linalg.det((x[:, 1:] - x[:, :1])[:, :, :2])).sum()
    assert area == pytest.approx(1.0, rel=1e-12)
