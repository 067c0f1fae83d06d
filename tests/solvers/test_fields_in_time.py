"""Supports, loads and initial states by formulas in time, and from an exact solution that moves."""

import numpy as np
import pytest
import scenes

from reference.exact import exact_solution
from verify.solvers import find_solver

SOLVERS = ("xfem", "conforming", "virtual_node")
# a travelling pressure wave in plane strain: λ + 2μ = 3, ρ = 3, c = 1
WAVE = "0.01*sin(2*(x - {t}))"
SPEED = "-0.02*cos(2*(x - {t}))"


def _solved(content, solver, level=0, **parameters):
    if solver == "conforming":
        pytest.importorskip("dolfinx_solver")
    return find_solver(solver).solve(scenes.scene(**content), level, 0, **parameters)


def _wave(**changes):
    content = {
        "geometry": scenes.box([1, 0.5]),
        "supports": [],
        "mesh": {"cells": [[6, 3], [12, 6]]},
        "material": {"young": 2.5, "poisson": 0.25, "plane": "strain", "density": 3.0},
        "analysis": {"kind": "dynamic", "duration": 1.0, "time_step": 0.02, "outputs": 3},
        "initial": {
            "kind": "field",
            "displacement": [WAVE.format(t=0), 0.0],
            "velocity": [SPEED.format(t=0), 0.0],
        },
    }
    return content | changes


def _wave_error(found):
    x = found.points[:, 0]
    expected = 0.01 * np.sin(2 * (x - found.times[:, None]))
    return np.abs(found.displacement[..., 0] - expected).max() / 0.01


@pytest.mark.parametrize(
    "solver, driven",
    [("xfem", "traction"), ("conforming", "displacement"), ("virtual_node", "displacement")],
)
def test_a_travelling_wave_by_formulas_converges_with_second_order(solver, driven):
    """Its left end is moved, or pulled: λ + 2μ times the strain."""
    sides = [{"where": w, "displacement": [0.0], "components": ["y"]} for w in ("bottom", "top")]
    supports = [*sides, {"where": "right", "displacement": [WAVE.format(t="t"), 0.0]}]
    loads = []
    if driven == "displacement":
        supports.append({"where": "left", "displacement": [WAVE.format(t="t"), 0.0]})
    else:
        pull = "-3*0.02*cos(2*(x - t))"
        loads = [{"kind": "traction", "where": "left", "traction": [pull, 0.0]}]
    errors = [
        _wave_error(_solved(_wave(supports=supports, loads=loads), solver, level))
        for level in (0, 1)
    ]
    # dispersion: (kh)²/24 of the phase that has passed, of which a free end shows the double, and
    # its stress is one order less accurate within a wave length; 2 % is a tenth of a cell's phase
    assert errors[1] < 0.02
    assert errors[0] / errors[1] > 3.0


@pytest.mark.parametrize(
    "solver, chosen",
    [*((name, {}) for name in SOLVERS), ("conforming", {"scheme": "energy_momentum"})],
)
def test_a_body_force_in_time_moves_a_free_body_by_its_second_integral(solver, chosen):
    """ρ a = 3 · 6 t: u = t³, up to the scheme's own error of Δt²/4 · 6 t/12 at most."""
    loads = [{"kind": "body_force", "force": ["18*t", "-18*t"]}]
    changes = {"loads": loads, "initial": {"kind": "field", "velocity": [0.5, 0.0]}}
    found = _solved(_wave(**changes), solver, **chosen)
    expected = found.times[:, None] ** 3 * np.array([1.0, -1.0]) + found.times[:, None] * [0.5, 0]
    np.testing.assert_allclose(found.displacement, expected[:, None] + 0 * found.displacement,
                               atol=0.5 * 0.02**2)  # fmt: skip


def _strip(cuts, **changes):
    """Part of the strip of `blade_strip`, turned by 25°, λ = μ = ρ = 1."""
    content = {
        "geometry": scenes.box([0.5, 0.4, 0.1], [-0.5, -0.4, 0.0]),
        "mesh": {"cells": [[8, 6, 1], [16, 12, 1]]},
        "material": {"young": 2.5, "poisson": 0.25, "density": 1.0},
        "supports": [
            {"where": w, "displacement": [0.0, 0.0], "components": ["x", "y"]}
            for w in ("bottom", "top")
        ]
        + [{"where": w, "displacement": "exact"} for w in ("left", "right", "front", "back")],
        "exact": {
            "solution": "blade_strip",
            "parameters": {
                "half_width": 1.5, "grip": 0.1, "speed": 0.5, "tip": [-1.0, -0.3], "angle": 25.0,
            },
        },
        "analysis": {"kind": "dynamic", "duration": 0.8, "time_step": 0.04, "outputs": 3},
        "initial": {"kind": "field", "displacement": "exact", "velocity": "exact"},
        "cuts": cuts,
    }  # fmt: skip
    return content | changes


def _strip_error(found, scene):
    exact = exact_solution("blade_strip", scene["exact"]["parameters"],
                           scenes.scene(**scene).material)  # fmt: skip
    middles = found.points[found.cells[:, :4]].mean(axis=1)
    worst = 0.0
    for time, u in zip(found.times, found.displacement, strict=True):
        mean = u[found.cells[:, :4]].mean(axis=1)
        true = exact.at(time).displacement(middles)
        worst = max(worst, np.abs(mean - true).max())
    return worst / np.abs(true).max()


@pytest.mark.parametrize("solver", ["conforming", "virtual_node"])
def test_two_halves_behind_the_blade_move_each_as_its_own_side(solver):
    """Cut through from the start, inclined to the mesh: both sides of the field, one-sided."""
    c, s = np.cos(np.deg2rad(25.0)), np.sin(np.deg2rad(25.0))
    ends = [np.array([0.55, 0.0]) + r * np.array([c, s]) for r in (-2.0, 2.0)]
    corners = [[*ends[i].tolist(), z] for i, z in ((0, -0.1), (1, -0.1), (1, 0.2), (0, 0.2))]
    scene = _strip([{"kind": "polygon", "points": corners}])
    scene["exact"]["parameters"] |= {"tip": ends[1].tolist(), "half_width": 1.2}
    errors = [_strip_error(_solved(scene, solver, level), scene) for level in (0, 1)]
    assert errors[1] < 1e-2
    assert errors[0] / errors[1] > 2.5
