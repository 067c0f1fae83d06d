"""A cut as another solver realised it, taken as the geometry of a conforming mesh in space."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx
from solid_scenes import area, cube, cylinder, polygon, swept, volumes

from reference.meshing import ConformingMesh, imprint_facets, open_cut, structured_tetrahedra
from verify.solvers import find_solver

pytestmark = needs_fenicsx

HELD = [{"where": s, "displacement": [0, 0, 0]} for s in ("bottom", "top", "left", "right")]
WEIGHT = [{"kind": "gravity", "acceleration": [0.3, 0.2, -1.0]}]
CUTS = {
    "tilted": [polygon("a", (-1, -1, 0.31), (2, -1, 0.42), (2, 2, 0.62), (-1, 2, 0.51))],
    "ending inside": [polygon("a", (-1, -1, 0.55), (0.6, -1, 0.55), (0.6, 2, 0.6), (-1, 2, 0.6))],
    "crossing within cells": [
        polygon("a", (-1, -1, 0.43), (2, -1, 0.45), (2, 2, 0.57), (-1, 2, 0.55)),
        polygon("b", (0.41, -1, -1), (0.45, 2, -1), (0.57, 2, 2), (0.53, -1, 2)),
    ],
    "swept": [swept((0.1, 0.0, 2.0), (-0.2, 0.2, 0.0), (0.5, 0.63, 0.0), (1.2, 0.3, 0.0))],
    "cylinder": [cylinder((0.5, 0.48, -0.2), 1.5, 0.33)],
}


def judged(cuts, **changes):
    scene = cube(cuts, mesh={"cells": [[4, 4, 4]]}, supports=HELD, loads=WEIGHT, **changes)
    return scene, find_solver("xfem").solve(scene, 0, repetitions=0)


def piece_volumes(points, cells):
    """Volumes of the parts of a mesh that no node joins, ascending."""
    none = np.zeros((0, 2), dtype=np.int64)
    mesh = ConformingMesh(points, cells, np.arange(len(points)), none, none)
    return np.sort(np.bincount(mesh.pieces, volumes(mesh)))


@pytest.mark.parametrize("name", CUTS)
def test_pieces_and_faces_are_those_of_the_solver_that_realised_the_cut(name):
    _, field = judged(CUTS[name])
    points, cells = structured_tetrahedra((0, 0, 0), (1, 1, 1), (4, 4, 4))
    found = imprint_facets(points, cells, field.cut_facets)
    mesh = open_cut(found.points, found.cells, found.facets)
    assert found.fitted
    assert piece_volumes(mesh.points, mesh.cells) == pytest.approx(
        piece_volumes(field.points, field.cells), abs=1e-12
    )
    assert area(mesh.realised_cut) == pytest.approx(area(field.cut_facets), rel=1e-12)


def test_the_conforming_and_refined_energies_on_the_realised_cut_enclose_that_of_xfem():
    """P1 on the split mesh can do all that XFEM can, and quadratic elements on halves more."""
    scene, field = judged(CUTS["ending inside"])
    triangles = [polygon(f"t{i}", *corners) for i, corners in enumerate(field.cut_facets)]
    realised = cube(
        triangles, mesh={"cells": [[4, 4, 4]]}, supports=HELD, loads=WEIGHT, reference={"degree": 2}
    )
    same = find_solver("conforming").solve(realised, 0, repetitions=0)
    fine = find_solver("reference").solve(realised, 1, repetitions=0)
    energies = [f.ledger["strain"][0] for f in (field, same, fine)]
    # under dead loads the energy is that of the best motion in each space
    assert energies[0] <= energies[1] * (1 + 1e-12)
    assert energies[1] < energies[2]
    assert energies[1] - energies[0] < 0.2 * (energies[2] - energies[0])
    assert scene.mesh.cells == realised.mesh.cells


def test_triangles_that_do_not_fit_the_mesh_are_imprinted_as_polygons():
    points, cells = structured_tetrahedra((0, 0, 0), (1, 1, 1), (3, 3, 3))
    square = np.array([[0.21, 0.22, 0.41], [0.79, 0.2, 0.41], [0.8, 0.77, 0.41], [0.2, 0.8, 0.41]])
    found = imprint_facets(points, cells, square[[[0, 1, 2], [0, 2, 3]]])
    mesh = open_cut(found.points, found.cells, found.facets)
    assert not found.fitted
    assert area(mesh.realised_cut) == pytest.approx(area(square[[[0, 1, 2], [0, 2, 3]]]), rel=1e-12)
    assert volumes(mesh).sum() == pytest.approx(1.0, rel=1e-12)
