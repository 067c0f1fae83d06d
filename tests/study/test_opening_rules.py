"""Rules by which a blade opens a cut, on the exact strip: docs/theory/dynamics.md has the tables.

``pytest -m heavy -s tests/study/test_opening_rules.py`` prints them.
"""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from strip_rules import RULES, Strip, solve

from reference.exact import exact_of
from verify.compare.blade import advance
from verify.scene import Scene
from verify.solvers import find_solver

ELEMENTS = (8, 16, 32, 64)
CASES = Path(__file__).parents[2] / "cases"
WINDOW = 0.21  # m: of the strip's height of 0.2; 10 and 18 elements
SETTLED = 0.3  # of the window: the waves of the start have left the tip


def orders(outcomes):
    return -np.diff(np.log2([one.displacement for one in outcomes]))


@pytest.mark.heavy
@pytest.mark.parametrize("lumped", [True, False], ids=["lumped", "consistent"])
@pytest.mark.parametrize("speed", [0.1, 0.3, 0.6, 0.8])
def test_forces_that_fade_have_no_lag_and_take_what_else_stays_as_waves(speed, lumped):
    elements = ELEMENTS if lumped else ELEMENTS[:3]
    strips = [Strip(n, speed) for n in elements]
    found = {rule: [solve(strip, rule, lumped) for strip in strips] for rule in RULES}
    for rule, outcomes in found.items():
        columns = [
            " ".join(f"{getattr(one, name):.4f}" for one in outcomes)
            for name in ("displacement", "velocity", "kinetic", "taken")
        ]
        exact = outcomes[-1].exact_kinetic
        print(f"{speed} {'lumped' if lumped else 'consistent'} | {rule} | ", end="")
        print(" | ".join(columns), f"| exact kinetic {exact:.4f}")
    swept, centroid, late = (found[rule] for rule in ("swept", "centroid", "late"))
    for one, other in zip(swept, centroid, strict=True):
        assert one.displacement < other.displacement
    assert orders(swept).mean() > 1.0
    # a release at once leaves all of G in the mesh, whatever h
    assert late[-1].kinetic > 1.5 * late[-1].exact_kinetic
    assert abs(late[-1].taken) < 1e-12
    if speed <= 0.6:
        assert swept[-1].taken == pytest.approx(1.0, abs=0.08)
        assert swept[-1].velocity < 0.4 * centroid[-1].velocity
    assert swept[-1].kinetic < late[-1].kinetic


def test_the_swept_share_is_better_than_late_on_two_coarse_meshes():
    """What the heavy study shows, at 0.3 c."""
    late, swept = (
        [solve(Strip(n, 0.3), rule, True) for n in (8, 16)] for rule in ("late", "swept")
    )
    assert orders(swept)[0] > 1.0
    for one, other in zip(swept, late, strict=True):
        assert one.displacement < 0.4 * other.displacement
    assert swept[-1].taken == pytest.approx(1.0, abs=0.08)


def strip(case, speed):
    """Give a case of the catalogue another speed of the blade and a window long enough."""
    given = tomllib.loads((CASES / f"{case}.toml").read_text())
    window = WINDOW if case == "benchmark/c5_blade_06" else 0.12
    exact = given["exact"]["parameters"]
    angle = np.deg2rad(exact.get("angle", 0.0))
    tip, way = np.array(exact.get("tip", [0.0, 0.0])), np.array([np.cos(angle), np.sin(angle)])
    ends = [[*(tip + at * way), -0.001] for at in (-0.4, window)]
    blade = {name: given["cuts"][0][name] for name in ("kind", "depth", "direction", "expected")}
    times = {"points": ends, "times": [-0.4 / speed, window / speed]}
    exact["speed"] = speed
    given["analysis"] |= {"duration": window / speed, "time_step": 0.0025, "outputs": 31}
    kept = {name: given[name] for name in given if name not in _JUDGED}
    return Scene.model_validate(kept | {"cuts": [blade | times]})


_JUDGED = ("acceptance", "known_findings", "quantities", "schema")


def measured(scene, solver, level, **parameters):
    """Give errors of displacement and velocity at the end; work over G, in all and settled.

    By the nodal rule; velocities farther than 0.15 half-heights from the tip.
    """
    found, exact = find_solver(solver).solve(scene, level, 0, **parameters), exact_of(scene)
    field, tip = exact.at(float(found.times[-1])), np.array(scene.cuts[0].points[-1])
    corners = found.points[found.cells]
    near = np.empty_like(found.points)
    near[found.cells] = corners.mean(axis=1)[:, None]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
    weight = np.bincount(found.cells.ravel(), np.repeat(volume / 4.0, 4))
    off = weight * (np.linalg.norm((found.points - tip)[:, :2], axis=1) > 0.015)
    errors = []
    for share, values, true in (
        (weight, found.displacement[-1], field.displacement(found.points, near)),
        (off, found.velocity[-1], field.velocity(found.points, near)),
    ):
        true = np.where(share[:, None] > 0.0, true, 0.0)
        wrong = share @ ((values - true) ** 2).sum(axis=1)
        errors.append(float(np.sqrt(wrong / (share @ (true**2).sum(axis=1)))))
    released = advance(scene) * exact.energy_release_rate * found.times / found.times[-1]
    work = found.ledger.get("cut_work", 0.0 * released)
    late = found.times >= SETTLED * found.times[-1]
    slope = np.polyfit(released[late], work[late], 1)[0]
    return (*errors, float(work[-1] / released[-1]), float(slope))


SOLVERS = {
    "conforming": ("conforming", {}),
    "xfem": ("xfem", {}),
    "xfem, consistent mass": ("xfem", {"mass": "consistent"}),
    "subdivision": ("subdivision", {}),
}


@pytest.mark.heavy
@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("speed", [0.1, 0.3, 0.6, 0.8])
@pytest.mark.parametrize("case", ["benchmark/c5_blade_06", "cutting/blade_strip_inclined"])
def test_solvers_on_the_strip(case, speed, name):
    """The swept rule has less than the error of late openings, and takes what it can of G.

    What the lattice radiates depends on the speed and the mass. A part of a strip at 17° to the
    lines of a mesh has 10 and 20 elements of advance.
    """
    solver, parameters = SOLVERS[name]
    if solver == "conforming":
        pytest.importorskip("dolfinx_solver")
    scene = strip(case, speed)
    swept = [measured(scene, solver, level, **parameters) for level in (0, 1)]
    late = [measured(scene, solver, level, opening="late", **parameters) for level in (0, 1)]
    for rule, rows in (("late", late), ("swept", swept)):
        columns = (" ".join(f"{x:.4f}" for x in column) for column in zip(*rows, strict=True))
        print(f"{case} | {speed} | {name} | {rule} |", " | ".join(columns))
    assert swept[1][0] < 0.6 * late[1][0]
    assert swept[1][0] < 0.7 * swept[0][0]
    consistent = solver == "conforming" or parameters.get("mass") == "consistent"
    if consistent and speed in (0.3, 0.6) and case == "benchmark/c5_blade_06":
        assert swept[1][3] == pytest.approx(1.0, abs=0.08)
