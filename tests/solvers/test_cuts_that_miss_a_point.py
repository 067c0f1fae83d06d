"""Three straight cuts that almost meet: the part between them is counted, not an error."""

import numpy as np
import pytest

from verify.scene import Scene
from verify.solvers import find_solver

_MIDDLE = np.array([0.53, 0.47])


def _three_cuts(gap, kinematics="linear"):
    """A square with three inclined cuts, each `gap` off a common point; all sides are held."""
    cuts = []
    for k, angle in enumerate((0.3, 1.4, 2.5)):
        normal = np.array([np.cos(angle), np.sin(angle)])
        along = np.array([-normal[1], normal[0]])
        ends = _MIDDLE + gap * normal + np.array([[-2.0], [2.0]]) * along
        cuts.append({"kind": "polyline", "name": f"cut {k}", "points": ends.tolist()})
    content = {
        "title": "three cuts",
        "requirement": "they are solved",
        "geometry": {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0]},
        "mesh": {"cells": [[5, 4]]},
        "material": {"young": 1.0, "poisson": 0.3, "plane": "strain"},
        "analysis": {"kinematics": kinematics},
        "supports": [{"where": "boundary", "displacement": [0.0, 0.0]}],
        "loads": [{"kind": "body_force", "force": [0.0, -0.01]}],
        "cuts": cuts,
    }
    return Scene.model_validate(content)


def _speck(solution):
    kind = "loose part of round-off size joined to its neighbour"
    return [entry for entry in solution.regularisations if entry.kind == kind]


@pytest.mark.parametrize("kinematics", ["linear", "finite_rotation"])
def test_a_part_of_round_off_size_moves_with_its_neighbour_and_is_counted(kinematics):
    solver = find_solver("xfem")
    met = solver.solve(_three_cuts(0.0, kinematics), 0)
    assert not _speck(met)
    for share in (1e-13, 1e-10, 1e-7, 1e-4):
        missed = solver.solve(_three_cuts(0.2 * share, kinematics), 0)
        (entry,) = _speck(missed)
        # a triangle whose sides are some gaps long, of elements with legs of 0.2 and 0.25
        assert entry.count == 1
        assert 0.0 < entry.size < 10 * share**2
        # the cuts moved by the gap, and what is between them moves as its neighbour does
        assert np.abs(missed.displacement).max() == pytest.approx(
            np.abs(met.displacement).max(), rel=1e-2 * max(share / 1e-4, 1e-6)
        )


@pytest.mark.fenicsx
@pytest.mark.parametrize(
    "solver, shares", [("conforming", (1e-13, 1e-10, 1e-7, 1e-4)), ("reference", (1e-10, 1e-4))]
)
def test_conforming_meshes_join_and_count_it_too(solver, shares):
    asked = find_solver(solver)
    met = asked.solve(_three_cuts(0.0), 0, repetitions=0)
    assert not _speck(met)
    joined = 0
    for share in shares:
        missed = asked.solve(_three_cuts(0.2 * share), 0, repetitions=0)
        joined += sum(entry.count for entry in _speck(missed))
        # cuts that moved by a ten-thousandth of an element change the energy by about as much
        assert missed.ledger["strain"][0] == pytest.approx(met.ledger["strain"][0], rel=1e-4)
    # gmsh and the imprint take what is closer than 1e-9 of the body for one point
    assert joined >= 1
    assert _speck(missed)
