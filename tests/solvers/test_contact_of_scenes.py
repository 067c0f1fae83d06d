"""Faces of cuts that touch, in every solver that offers contact."""

import numpy as np
import pytest
import scenes

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
