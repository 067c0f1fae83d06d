"""Two materials: exact fields, free turns, weights and masses, for every solver alike."""

import numpy as np
import pytest
from fourth_order import difference
from reference_scenes import square

from reference.exact import exact_solution
from verify.compare.hooke import law_of, strain_energy
from verify.compare.mass import density_of, kinetic
from verify.scene import Scene, load_scene
from verify.solvers import find_solver

SOLVERS = ("reference", "xfem", "conforming", "virtual_node", "subdivision")
LAYERS = [{"where": "y > 0.4", "young": 6.0, "poisson": 0.0, "density": 5.0}]
SOFT = {"young": 1.0, "poisson": 0.0, "plane": "strain", "density": 2.0, "regions": LAYERS}
CUT = {"kind": "polyline", "points": [[0.33, -0.1], [0.52, 1.1]]}


def scene(**changes) -> Scene:
    given = {
        "mesh": {"cells": [[5, 5]]},
        "material": SOFT,
        "supports": [{"where": "bottom", "displacement": [0.0, 0.0]}],
        "loads": [],
        "reference": {"size": 0.3},
    }
    return square(**given | changes)


def test_the_layered_field_is_in_equilibrium_with_each_material() -> None:
    """Stress by Hooke's law of each point's own material, against the tension that is stated."""
    case = load_scene("material/layers_patch")
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    points = np.random.default_rng(3).uniform(0.0, 1.0, (200, 2))
    law, gradient = law_of(case).at(points), exact.gradient(points)
    strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
    trace = np.trace(strain, axis1=1, axis2=2)
    stress = 2 * law.shear[:, None, None] * strain
    stress += (law.lame * trace)[:, None, None] * np.eye(2)
    assert np.abs(stress - exact.stress(points)).max() < 1e-14
    assert np.abs(difference(exact.displacement, points, 1e-4) - gradient).max() < 1e-8


@pytest.mark.parametrize("name", SOLVERS)
def test_a_column_of_two_materials_sinks_under_its_weight(name: str) -> None:
    """With ν = 0 it is a column of bars: u(1) = −ρ₂gh₂²/2E₂ − (ρ₁h₁/2 + ρ₂h₂) g h₁/E₁.

    Quadratic in each bar: exact for P2. The energy ½∫σ²/E of linear elements is below, by no more
    than that of the interpolation error of a column, ½ ∫ (ρg)²/E · h²/12 (the best approximation
    in energy is at least as good), as long as interface and rows of nodes coincide.
    """
    upright = {"kind": "polyline", "points": [[0.47, -0.1], [0.47, 1.1]]}
    weight = {"kind": "gravity", "acceleration": [0.0, -1.0]}
    standing = scene(loads=[weight], cuts=[upright])
    found = find_solver(name).solve(standing, 0, 0)
    if name == "reference":
        expected = -5 * 0.36 / 12 - (2 * 0.2 + 5 * 0.6) * 0.4
        top = found.points[:, 1] > 1 - 1e-12
        assert found.displacement[0][top, 1] == pytest.approx(expected, rel=1e-10)
    energy = 0.5 * ((3.8**3 - 3.0**3) / 6 + 5**2 * 0.6**3 / 3 / 6)
    lost = 0.5 * (2**2 * 0.4 + 5**2 * 0.6 / 6) / 25 / 12
    assert energy - lost <= strain_energy(found, law_of(standing)) <= energy * (1 + 1e-12)


@pytest.mark.parametrize("name", SOLVERS)
def test_free_parts_of_two_densities_fall_together(name: str) -> None:
    """Nothing strains: v = g t, and the momentum is that of the masses of both materials."""
    falling = scene(
        supports=[],
        loads=[{"kind": "gravity", "acceleration": [0.6, -2.0]}],
        analysis={"kind": "dynamic", "duration": 0.1, "outputs": 2, "time_step": 0.05},
        cuts=[CUT],
    )
    found = find_solver(name).solve(falling, 0, 0)
    assert found.velocity is not None
    # the forces are in balance to 1e-10 of themselves; the residue of two solves is left
    assert np.abs(found.velocity[-1] - [0.06, -0.2]).max() < 2e-11
    mass = 2 * 0.4 + 5 * 0.6
    momentum = kinetic(found, density_of(falling, found)).linear[-1]
    assert momentum == pytest.approx(mass * np.array([0.06, -0.2]), rel=1e-11)
    if "kinetic" in found.ledger:
        expected = 0.5 * mass * (0.06**2 + 0.2**2)
        assert found.ledger["kinetic"][-1] == pytest.approx(expected, rel=1e-11)
