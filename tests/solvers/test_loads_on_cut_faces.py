"""Pressure and tractions on the faces of a cut, in every solver that opens one."""

import numpy as np
import pytest
import scenes

from reference.exact import exact_solution
from verify.solvers import find_solver

STRESS = np.array([[0.3, 0.2, -0.1], [0.2, -0.5, 0.4], [-0.1, 0.4, 0.1]])


def body(dimension, cuts, loads, **changes):
    content = {
        "mesh": {"cells": [[5] * dimension]},
        "material": scenes.soft(dimension, density=2.0),
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "loads": loads,
        "reference": {"size": 0.35 if dimension == 2 else 0.6},
    }
    return scenes.scene(cuts, dimension, **content | changes)


def uniform(dimension):
    """Uniform stress: what it exerts on a face of normal n is σ n, linear elements have it."""
    d, e, nu = dimension, 1.0, 0.3
    shear, lame = e / (2 * (1 + nu)), e * nu / ((1 + nu) * (1 - 2 * nu))
    stress = STRESS[:d, :d]
    trace = np.trace(stress) / (d * lame + 2 * shear)
    matrix = (stress - lame * trace * np.eye(d)) / (2 * shear)
    return {"solution": "linear", "parameters": {"matrix": matrix.tolist()}}


def crossing():
    """Two cuts that cross inside an element, one of them to a point inside the plate."""
    lines = {"long": [[-0.1, 0.31], [1.1, 0.67]], "short": [[0.63, 1.1], [0.41, 0.2]]}
    cuts = [{"kind": "polyline", "name": name, "points": ends} for name, ends in lines.items()]
    loads = []
    for name, (a, b) in lines.items():
        along = np.subtract(b, a) / np.linalg.norm(np.subtract(b, a))
        normal = np.array([-along[1], along[0]])  # the positive side is on the left
        traction = -STRESS[:2, :2] @ normal  # its material ends with the outward normal −n
        loads.append({"kind": "cut_faces", "cut": name, "traction": traction.tolist()})
    return body(2, cuts, loads, exact=uniform(2))


def in_space():
    normal = np.array([-0.3, 0.2, 1.0])
    ring = [(-0.1, -0.1), (0.7, -0.1), (0.7, 1.1), (-0.1, 1.1)]  # ends inside
    corners = [[x, y, 0.47 + 0.3 * (x - 0.5) - 0.2 * (y - 0.5)] for x, y in ring]
    traction = -STRESS @ normal / np.linalg.norm(normal)
    load = {"kind": "cut_faces", "traction": traction.tolist()}
    return body(3, [{"kind": "polygon", "points": corners}], [load], exact=uniform(3))


def pressed_arc():
    """Under the same pressure everywhere, whichever way the faces look."""
    arc = {"kind": "arc", "centre": [0.52, 0.2], "radius": 0.4, "start": 30.0, "sweep": 95.0}
    matrix = (-0.7 / (2 * (1 / 2.6 + 0.3 / 0.52)) * np.eye(2)).tolist()
    exact = {"solution": "linear", "parameters": {"matrix": matrix}}
    return body(2, [arc], [{"kind": "cut_faces", "pressure": 0.7}], exact=exact)


FENICSX = (("reference", crossing), ("conforming", in_space), ("conforming", pressed_arc))


@pytest.mark.parametrize(
    "solver, scene",
    [*(pytest.param(*one, marks=pytest.mark.fenicsx) for one in FENICSX), ("xfem", crossing),
     ("xfem", in_space), ("xfem", pressed_arc), ("virtual_node_arbitrary", crossing),
     ("subdivision", in_space)],
)  # fmt: skip
def test_a_uniform_stress_goes_through_a_cut_whose_faces_bear_it(scene, solver):
    """A patch test: exact in linear elements; 1e-10 is round-off times the condition number."""
    scene = scene()
    found = find_solver(solver).solve(scene, 0, repetitions=0)
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    expected = exact.displacement(found.points)
    scale = np.abs(expected).max()
    assert found.displacement[0] == pytest.approx(expected, abs=1e-10 * scale)
    without = scene.model_copy(update={"loads": []})
    opened = find_solver(solver).solve(without, 0, repetitions=0)
    assert np.abs(opened.displacement[0] - exact.displacement(opened.points)).max() > 0.05 * scale


@pytest.mark.fenicsx
def test_the_energy_of_a_pressed_crack_is_that_of_its_closed_form():
    """Half the work on the outline and on the faces, against tip-graded quadratic elements."""
    c, s = np.cos(np.deg2rad(20)), np.sin(np.deg2rad(20))
    cut = {"kind": "polyline", "points": [[-c, -s], [c, s]]}
    scene = body(
        2, [cut], [{"kind": "cut_faces", "pressure": 1.0}],
        geometry={"kind": "rectangle", "lower": [-2.0, -2.0], "upper": [2.0, 2.0]},
        exact={"solution": "griffith", "parameters": {
            "a": 1.0, "angle": 20.0, "stress": [0.3, 0.0, 0.0], "pressure": 1.0,
        }},
        reference={},
    )  # fmt: skip
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    found = find_solver("reference").solve(scene, 1, repetitions=0)
    # measured order 4 of the energy: 6e-5 on level 0, 3e-6 on level 1
    assert found.ledger["strain"][0] == pytest.approx(exact.strain_energy(scene), rel=1e-5)


@pytest.mark.parametrize(
    "solver, choice",
    [("xfem", {"mass": "consistent"}), pytest.param("conforming", {}, marks=pytest.mark.fenicsx)],
)
def test_a_pressure_drives_two_halves_apart_from_the_opening_of_the_cut_on(solver, choice):
    """Force times time is the momentum of each half; a closed cut bears nothing."""
    scene = body(
        2,
        [{"kind": "polyline", "points": [[-0.1, 0.33], [1.1, 0.73]], "opens_at": 0.1}],
        [{"kind": "cut_faces", "pressure": "0.5 + x"}],
        supports=[],
        analysis={"kind": "dynamic", "duration": 0.3, "time_step": 0.01, "outputs": 4},
    )
    found = find_solver(solver).solve(scene, 0, repetitions=0, **choice)
    assert np.abs(found.displacement[1]).max() < 1e-20  # round-off of forces that cancel
    corners = found.points[found.cells]
    mass = 2.0 * 0.5 * np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    middle = corners.mean(axis=1)
    above = middle[:, 1] > 0.53 + (middle[:, 0] - 0.5) / 3
    speed = found.velocity[-1][found.cells].mean(axis=1)
    # ∫ p n over the face: n times its length, √(1 + 1/9) over dx, is (−1/3, 1) dx
    force = np.array([-1 / 3, 1.0]) * (0.5 + 0.5)
    assert (mass[above] @ speed[above]) == pytest.approx(0.2 * force, abs=1e-11)
    assert (mass[~above] @ speed[~above]) == pytest.approx(-0.2 * force, abs=1e-11)
