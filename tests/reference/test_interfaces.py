"""Interfaces between materials: where the reference's meshes have them, and what it solves."""

import numpy as np
import pytest
from reference_scenes import square
from solid_scenes import cube, polygon

from reference.meshing import Grading, conforming_mesh, singular_points
from verify.compare.hooke import law_of, strain_energy
from verify.scene import Scene, crossed_by_interfaces
from verify.solvers import find_solver

SOFT = {"young": 1.0, "poisson": 0.3, "plane": "strain"}
HELD = [{"where": "bottom", "displacement": [0.0, 0.0]}]


def scene(regions: list[dict], **changes) -> Scene:
    given = {
        "geometry": {"kind": "rectangle", "lower": [0, 0], "upper": [1.0, 0.8]},
        "mesh": {"cells": [[5, 4]]},
        "material": {**SOFT, "regions": regions},
        "supports": HELD,
        "loads": [],
    }
    return square(**given | changes)


def area(one: Scene, mesh, number: int) -> float:
    corners = mesh.points[mesh.cells]
    edges = corners[:, 1:] - corners[:, :1]
    measure = np.abs(np.linalg.det(edges)) / (2 if edges.shape[1] == 2 else 6)
    return float(measure[one.material.number_at(corners.mean(axis=1)) == number].sum())


def mesh_of(one: Scene, size: float = 0.13):
    return conforming_mesh(one, Grading(size, np.zeros((0, one.dimension))))


def test_an_inclined_interface_crosses_no_cell_and_a_cut_through_it_opens_only_itself() -> None:
    cut = {"kind": "polyline", "points": [[-0.1, 0.33], [0.6, 0.41]]}
    one = scene([{"where": "2 * y > x + 0.3", "young": 7.0}], cuts=[cut])
    mesh = mesh_of(one)
    assert not crossed_by_interfaces(one.material, mesh.points, mesh.cells).any()
    # below y = 0.15 + x/2 lies 0.15 + 1/4
    assert area(one, mesh, 1) == pytest.approx(0.8 - 0.4, rel=1e-9)
    length = np.linalg.norm(np.diff(mesh.realised_cut, axis=1)[:, 0], axis=1).sum()
    assert length == pytest.approx(np.hypot(0.6, 0.6 * 0.08 / 0.7), rel=1e-9)


@pytest.mark.parametrize(
    "where", ["hypot(x - 0.47, y - 0.41) < 0.2", "(x - 0.47)**2 + (y - 0.41)**2 < 0.04"]
)
def test_a_round_inclusion_is_meshed_by_chords(where: str) -> None:
    one = scene([{"where": where, "young": 50.0}])
    mesh = mesh_of(one, 0.05)
    # chords of h lose h²/6R² of the area, and nothing is gained
    lost = 1 - area(one, mesh, 1) / (np.pi * 0.04)
    assert 0 < lost < 2 * 0.05**2 / (6 * 0.2**2)
    assert len(singular_points(one)) == 2  # the ends of the support: a circle has none


def test_a_corner_of_a_region_and_an_interface_at_the_outline_are_singular() -> None:
    corner = scene([{"where": "x > 0.31 and y > 0.27", "young": 9.0}])
    found = singular_points(corner)
    for place in ([0.31, 0.27], [0.31, 0.8], [1.0, 0.27]):
        assert np.abs(found - place).max(axis=1).min() < 1e-8
    mesh = mesh_of(corner)
    assert not crossed_by_interfaces(corner.material, mesh.points, mesh.cells).any()
    assert area(corner, mesh, 1) == pytest.approx(0.69 * 0.53, rel=1e-9)


def test_an_inclined_plane_between_two_solids_crosses_no_cell() -> None:
    region = {"where": "z > 0.2 + 0.3 * x - 0.1 * y", "young": 4.0}
    one = cube(
        [polygon("cut", (0.43, -1, -1), (0.43, 2, -1), (0.43, 2, 0.4), (0.43, -1, 0.4))],
        geometry={"kind": "box", "lower": [0, 0, 0], "upper": [1.0, 0.7, 0.6]},
        mesh={"cells": [[2, 2, 2]]},
        material={"young": 1.0, "poisson": 0.3, "regions": [region]},
        loads=[],
    )
    mesh = mesh_of(one, 0.3)
    assert not crossed_by_interfaces(one.material, mesh.points, mesh.cells).any()
    # mean height of the plane: 0.2 + 0.15 - 0.035
    assert area(one, mesh, 1) == pytest.approx(0.42 * (1 - 0.315 / 0.6), rel=1e-9)
    assert len(mesh.realised_cut) > 0


def test_energies_of_solvers_are_those_of_their_fields_by_place() -> None:
    """A cut plate of three layers whose interfaces are mesh lines, sheared by a tenth of a degree.

    The ledger is summed by the solver with its own moduli, the other energy by the comparison
    with those of the scene at each place: equal to round-off only if both have the same.
    """
    one = scene(
        [
            {"where": "y > 0.2", "young": 6.0, "poisson": 0.1},
            {"where": "y > 0.6", "young": 0.2, "poisson": 0.45},
        ],
        cuts=[{"kind": "polyline", "points": [[-0.1, 0.35], [0.52, 0.71]]}],
        supports=[*HELD, {"where": "top", "displacement": [0.03, 0.05]}],
        analysis={"kinematics": "corotational"},
    )
    for name in ("xfem", "conforming", "virtual_node", "subdivision"):
        found = find_solver(name).solve(one, 0, 0)
        stated = float(found.ledger["strain"][0])
        assert strain_energy(found, law_of(one)) == pytest.approx(stated, rel=1e-12)
        assert not [r for r in found.regularisations if "interface" in r.kind]


def test_every_solver_states_the_cells_that_an_interface_crosses() -> None:
    """A material is one per cell: halves of cells of the wrong one are no property of the cut."""
    one = scene(
        [{"where": "2 * y > x + 0.31", "young": 6.0}],
        cuts=[{"kind": "polyline", "points": [[0.31, -0.1], [0.52, 0.9]]}],
        supports=[*HELD, {"where": "top", "displacement": [0.03, 0.05]}],
    )
    for name in ("xfem", "conforming", "virtual_node", "snapping"):
        found = find_solver(name).solve(one, 0, 0)
        (said,) = [r for r in found.regularisations if "interface" in r.kind]
        assert said.count >= 10
        # the line crosses two triangles of each box that it passes through, in one of five rows
        assert said.size is not None
        assert 0.2 < said.size < 0.5
