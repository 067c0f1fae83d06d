"""Skin made by formulas, from files, and thickened: what a mesh of it must satisfy."""

import meshio
import numpy as np
import pytest

from verify.geometry.simplices import boundary_loops
from verify.scene import Skin
from verify.simulator.skin_mesh import (
    closed_shell,
    plane_mesh,
    procedural_face,
    skin_mesh,
    skin_surface,
    thicken,
)
from verify.xfem.mesh import SimplexMesh

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
HOLE = np.array([[0.4, 0.4], [0.6, 0.4], [0.6, 0.6], [0.4, 0.6]])


def test_the_triangles_of_a_domain_cover_it_and_leave_its_holes() -> None:
    points, triangles, rim = plane_mesh(SQUARE, [HOLE], 0.05)
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert area.min() > 0.0
    # both borders have corners at the resampled points: 80 and 16 of them divide the sides
    np.testing.assert_allclose(area.sum(), 1.0 - 0.04, rtol=1e-12)
    assert rim == 80
    assert len(boundary_loops(triangles)) == 2


def test_the_face_has_openings_for_eyes_and_mouth_and_the_nodes_of_the_thesis() -> None:
    points, triangles, rim = procedural_face().triangulate(7550)
    assert abs(len(points) / 3913 - 1.0) < 0.02
    loops = boundary_loops(triangles)
    assert len(loops) == 4
    middles = [points[loop].mean(axis=0)[:2] for loop in loops if loop.min() >= rim]
    expected = {(0.031, 0.0265), (-0.031, 0.0265), (0.0, -0.045)}
    for x, y in expected:
        assert min(np.hypot(m[0] - x, m[1] - y) for m in middles) < 2e-3
    assert np.ptp(points, axis=0)[1] == pytest.approx(0.204, rel=0.01)


@pytest.mark.parametrize("wanted", [200, 1000])
def test_the_hand_has_the_thesis_numbers_of_tetrahedra(wanted, tmp_path) -> None:
    skin = Skin(kind="skin", shape="hand", elements=wanted, thickness=2e-3)
    mesh = skin_mesh(skin, tmp_path)
    assert abs(len(mesh.cells) / wanted - 1.0) < 0.06
    solid = SimplexMesh(mesh.points, mesh.cells)
    # area times thickness, a few per cent off for the curvature
    area = solid.measures.sum() / 2e-3
    assert 0.008 < area < 0.012
    assert mesh.rim.any()
    assert not mesh.rim.all()


@pytest.mark.parametrize("layers", [1, 3])
def test_a_plane_sheet_thickened_has_its_volume_and_a_closed_shell(layers) -> None:
    plane, triangles, _ = plane_mesh(SQUARE, [HOLE], 0.1)
    sheet = np.pad(plane, ((0, 0), (0, 1)))
    points, tetrahedra = thicken(sheet, triangles, 0.05, layers)
    solid = SimplexMesh(points, tetrahedra)
    np.testing.assert_allclose(solid.measures.sum(), 0.96 * 0.05, rtol=1e-12)
    assert (np.linalg.det(solid.edge_vectors) > 0.0).all()
    # conforming: faces of prisms are split alike on both sides, so the boundary is the shell's
    shell, facets = closed_shell(sheet, triangles, 0.05)
    sides = len(facets) - 2 * len(triangles)
    assert len(solid.boundary_facets) == 2 * len(triangles) + layers * sides
    np.testing.assert_allclose(np.linalg.det(shell[facets]).sum() / 6.0, 0.96 * 0.05, rtol=1e-12)
    assert len(boundary_loops(facets)) == 0


@pytest.mark.parametrize("suffix", ["stl", "vtu"])
def test_a_surface_of_ones_own_becomes_a_membrane_or_a_solid(suffix, tmp_path) -> None:
    plane, triangles, _ = plane_mesh(SQUARE, [HOLE], 0.2)
    sheet = np.pad(plane, ((0, 0), (0, 1)))
    file = tmp_path / f"own.{suffix}"
    meshio.write(file, meshio.Mesh(sheet, [("triangle", triangles)]))
    membrane = skin_mesh(Skin(kind="skin", file=file.name), tmp_path)
    assert membrane.points.shape == sheet.shape  # an STL repeats every point, one is made of them
    assert len(membrane.cells) == len(triangles)
    assert membrane.rim.sum() == 20
    skin = Skin(kind="skin", file=file.name, thickness=0.05, layers=2)
    solid = skin_mesh(skin, tmp_path)
    volume = SimplexMesh(solid.points, solid.cells).measures.sum()
    area = SimplexMesh(membrane.points, membrane.cells).measures.sum()
    np.testing.assert_allclose(volume, area * 0.05, rtol=1e-6)  # STL holds single precision
    _, facets = skin_surface(skin, tmp_path, 4 * len(triangles))
    assert len(facets) >= 4 * len(triangles)
