"""A spherical cut: the compact solver, the conforming mesh and the comparison against Lamé."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx
from solid_scenes import EXACT, cube

from reference.exact import exact_solution
from verify.solvers import find_solver

CENTRE, RADIUS = np.array([-0.06, -0.03, -0.04]), 0.6


def shell(cells):
    """Cut a part of a ball out of a corner of a cube, so that the supports hold both pieces."""
    parameters = {"centre": list(CENTRE), "radius": RADIUS, "outward": 0.1, "at": 1.0}
    cut = {"kind": "sphere", "centre": list(CENTRE), "radius": RADIUS, "expected": "through"}
    return cube(
        [cut],
        mesh={"cells": [[n, n, n] for n in cells]},
        supports=EXACT,
        loads=[],
        exact={"solution": "spherical_cut", "parameters": parameters},
    )


def energy(scene):
    known = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    return known.strain_energy(scene)


def test_the_compact_solver_has_the_energy_of_the_shell_with_order_two():
    scene = shell([6, 12])
    exact = energy(scene)
    errors = [find_solver("xfem").solve(scene, k).ledger["strain"][0] / exact - 1 for k in (0, 1)]
    # P1: the energy is off by O(h²); from one pair of levels of 3D cells the order is good to 0.4
    assert abs(errors[1]) < 0.01
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize("solver", [pytest.param("reference", marks=needs_fenicsx)])
def test_the_conforming_mesh_has_the_energy_of_the_shell(solver):
    scene = shell([6])
    exact = energy(scene)
    found = [find_solver(solver).solve(scene, k, repetitions=0).ledger["strain"][0] for k in (0, 1)]
    # P2 on plane facets: what is left is the volume between facets and sphere, O(h²)
    assert abs(found[1] / exact - 1) < 0.01
    assert abs(found[1] / exact - 1) < 0.5 * abs(found[0] / exact - 1)
