"""Finite rotation at loads far below round-off of the deformation gradient: the linear answer.

At strains of ε the two differ by terms of order ε. A residual made of F and R, which are of size 1,
knows stresses only to 1e-16 of the stiffness, which is 1e-4 of a load of 1e-12.
"""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline, square
from solid_scenes import cube, polygon

from verify.solvers import conforming, find_solver

pytestmark = needs_fenicsx

MOTION = {"kind": "dynamic", "duration": 0.4, "time_step": 0.1, "outputs": 2}


def scene(dimension, kinematics, tension, analysis, poisson):
    """Give a body clamped below and pulled above, with a cut that ends inside, thus graded."""
    changes = {
        "supports": [{"where": "bottom", "displacement": [0] * dimension}],
        "loads": [{"kind": "traction", "where": "top", "traction": [0.3 * tension, tension]}],
        "analysis": {"kinematics": kinematics, **analysis},
        "material": {"young": 1.0, "poisson": poisson, "density": 1.0},
    }
    if dimension == 2:
        changes["material"]["plane"] = "strain"
        return square([polyline("cut", (0.3, 0.5), (0.7, 0.5))], **changes)
    changes["loads"][0]["traction"].insert(1, 0.0)
    half = polygon("cut", (0.5, -0.1, 0.5), (1.1, -0.1, 0.5), (1.1, 1.1, 0.5), (0.5, 1.1, 0.5))
    return cube([half], reference={"size": 0.5}, **changes)


def per_load(*arguments, solver="reference", **parameters):
    """Last displacement per unit of tension."""
    asked = scene(*arguments)
    field = find_solver(solver).solve(asked, 0, repetitions=0, **parameters)
    return field.displacement[-1] / max(arguments[2], 1e-300)


CONSERVING = {"solver": "conforming", "scheme": "energy_momentum"}
CASES = {
    "plane, with a pressure": (2, {}, 0.49, {}),
    "space": (3, {}, 0.3, {}),
    "motion in the plane": (2, MOTION, 0.3, {}),
    "energy and momentum kept in space": (3, MOTION, 0.3, CONSERVING),
}


@pytest.mark.parametrize("name", CASES)
def test_a_load_however_small_is_solved_as_exactly_as_the_linear_problem(name, monkeypatch):
    # generalised-α of the spectral radius 1 is the trapezoidal rule, as energy–momentum is here
    monkeypatch.setattr(conforming, "_RADIUS", 1.0)
    dimension, analysis, poisson, parameters = CASES[name]
    linear = per_load(dimension, "linear", 1.0, analysis, poisson, **parameters)
    largest = np.abs(linear).max()
    found = per_load(dimension, "finite_rotation", 1e-12, analysis, poisson, **parameters)
    # rotations, of some times the load, turn the stretch that goes with them
    assert np.abs(found - linear).max() < 2e-9 * largest


@pytest.mark.parametrize(("dimension", "analysis"), [(2, MOTION), (3, {})])
def test_without_any_load_nothing_moves(dimension, analysis):
    assert not per_load(dimension, "finite_rotation", 0.0, analysis, 0.3).any()
