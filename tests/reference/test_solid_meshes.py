"""Conforming meshes in space: what a cut must do to a mesh, made anew and imprinted."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx
from solid_scenes import CURVED, SHAPES, area, cube, cylinder, disc, polygon, volumes

from reference.meshing import (
    Grading,
    conforming_mesh,
    imprint_polygons,
    open_cut,
    structured_tetrahedra,
    structured_triangles,
)
from reference.meshing.edge_splitting import split_edges
from reference.meshing.opening import cell_facets
from verify.errors import InputError, UnsupportedSceneError
from verify.geometry.simplices import mesh_edges, refine_uniformly

UNIFORM = Grading(0.15, np.zeros((0, 3)))


def check(mesh, expected_area, pieces, tolerance):
    volume = volumes(mesh)
    assert volume.min() > 0
    assert volume.sum() == pytest.approx(1.0, rel=1e-12)
    assert area(mesh.realised_cut) == pytest.approx(expected_area, rel=tolerance)
    assert mesh.pieces.max() + 1 == pieces
    facets = np.unique(cell_facets(mesh.cells), axis=0, return_counts=True)[1]
    assert facets.max() <= 2
    assert (facets == 1).sum() == len(mesh.boundary) + 2 * len(mesh.cut_facets)


class TestMadeAnew:
    pytestmark = needs_fenicsx

    @pytest.mark.parametrize("name", [*SHAPES, *CURVED])
    def test_every_cut_opens_with_its_area_and_leaves_the_volume(self, name):
        cuts, expected, pieces = (SHAPES | CURVED)[name]
        # plane facets are exact; a circle of chords h loses h²/24R² of its length, and a disc
        # h²/6R² of its area
        radius = {"half a disc": 0.4, "disc": 0.25, "ellipse": 0.15}.get(name, 2 * 0.3)
        tolerance = 1e-12 if name in SHAPES else 1.2 * 0.15**2 / (6 * radius**2)
        check(conforming_mesh(cube(cuts), UNIFORM), expected, pieces, tolerance)

    def test_a_finer_mesh_facets_a_curved_cut_with_an_error_of_order_two(self):
        errors = []
        for size in (0.1, 0.05):
            mesh = conforming_mesh(cube(CURVED["cylinder"][0]), Grading(size, np.zeros((0, 3))))
            errors.append(1 - area(mesh.realised_cut) / CURVED["cylinder"][1])
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.4)

    def test_the_same_scene_gives_the_same_mesh_twice(self):
        grading = Grading(0.2, np.zeros((0, 3)), 0.5, 2 / 3, curves=True)
        one, two = (conforming_mesh(cube([disc()]), grading) for _ in "ab")
        assert np.array_equal(one.points, two.points)
        assert np.array_equal(one.cells, two.cells)

    def test_grading_refines_fronts_and_ends_of_supports_and_nothing_else(self):
        grading = Grading(0.15, np.zeros((0, 3)), 0.5, 2 / 3, curves=True)
        part = [{"where": "z < 1e-9 and x < 0.4", "displacement": [0, 0, 0]}]
        mesh = conforming_mesh(cube([disc(0.2, (0.5, 0.5, 0.6))], supports=part), grading)
        middle = mesh.points[mesh.cells].mean(axis=1)
        edge = (6 * np.sqrt(2) * volumes(mesh)) ** (1 / 3)

        def size_near(point):
            return np.median(edge[np.argsort(np.linalg.norm(middle - point, axis=1))[:8]])

        for singular in ([0.7, 0.5, 0.6], [0.5, 0.3, 0.6], [0.4, 0.5, 0.0], [0.0, 0.5, 0.0]):
            assert size_near(singular) < 0.06
        for smooth in ([1.0, 0.5, 0.0], [0.9, 0.9, 0.9], [0.0, 0.5, 1.0]):
            assert size_near(smooth) > 0.1

    def test_a_part_that_ends_along_an_oblique_line_is_refused(self):
        part = [{"where": "x + y < 0.3", "displacement": [0, 0, 0]}]
        with pytest.raises(UnsupportedSceneError, match="curved or oblique"):
            conforming_mesh(cube(supports=part), UNIFORM)


class TestImprinted:
    @pytest.mark.parametrize("name", [name for name in SHAPES if name != "swept"])
    @pytest.mark.parametrize("n", [3, 4])
    def test_every_plane_cut_opens_with_its_area_and_leaves_the_volume(self, name, n):
        cuts, expected, pieces = SHAPES[name]
        grid = structured_tetrahedra((0, 0, 0), (1, 1, 1), (n, n, n))
        polygons = [np.array(cut["points"]) for cut in cuts]
        check(open_cut(*imprint_polygons(*grid, polygons)), expected, pieces, 1e-4)

    # seeds whose polygons surround their centre
    @pytest.mark.parametrize("seed", [1, 2, 3, 4, 5, 7])
    def test_random_polygons_are_imprinted_exactly(self, seed):
        rng = np.random.default_rng(seed)
        normal = rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        one = np.cross(normal, rng.normal(size=3))
        one /= np.linalg.norm(one)
        angle = np.sort(rng.uniform(0, 2 * np.pi, 6))
        radius = rng.uniform(0.15, 0.35, 6)  # not convex in general
        corners = 0.5 + radius[:, None] * (
            np.outer(np.cos(angle), one) + np.outer(np.sin(angle), np.cross(normal, one))
        )
        fan = 0.5 * np.roll(radius, -1) * radius * np.sin(np.roll(angle, -1) - angle)
        assert (np.diff(angle, append=angle[0] + 2 * np.pi) < 3.0).all()
        grid = structured_tetrahedra((0, 0, 0), (1, 1, 1), (4, 4, 4))
        check(open_cut(*imprint_polygons(*grid, [corners])), fan.sum(), 1, 1e-4)

    @pytest.mark.parametrize("off", [0.0, 1e-16, 1e-12, 1e-8, 1e-5, 1e-3])
    def test_a_plane_at_any_distance_from_the_nodes_leaves_two_pieces(self, off):
        z = 0.5 + off
        plane = np.array([[-1, -1, z], [2, -1, z], [2, 2, z], [-1, 2, z]])
        grid = structured_tetrahedra((0, 0, 0), (1, 1, 1), (4, 4, 4))
        check(open_cut(*imprint_polygons(*grid, [plane])), 1.0, 2, 1e-4)

    def test_a_polygon_outside_the_mesh_is_refused(self):
        grid = structured_tetrahedra((0, 0, 0), (1, 1, 1), (2, 2, 2))
        far = np.array([[2, 2, 2], [3, 2, 2], [3, 3, 2.0]])
        with pytest.raises(InputError, match="inside"):
            imprint_polygons(*grid, [far])

    def test_only_cells_near_the_polygon_are_touched(self):
        grid = structured_tetrahedra((0, 0, 0), (1, 1, 1), (8, 8, 8))
        small = np.array([[0.4, 0.4, 0.52], [0.6, 0.4, 0.52], [0.5, 0.6, 0.52]])
        points, cells, _ = imprint_polygons(*grid, [small])
        before = {tuple(sorted(c)) for c in grid[1].tolist()}
        new = np.array([c for c in cells.tolist() if tuple(sorted(c)) not in before])
        assert np.abs(points[new].mean(axis=1) - [0.5, 0.5, 0.52]).max() < 0.35


@pytest.mark.parametrize("d", [2, 3])
def test_splitting_any_edges_keeps_a_mesh_conforming(d):
    make = structured_triangles if d == 2 else structured_tetrahedra
    points, cells = make((0,) * d, (1,) * d, (3,) * d)
    edges = mesh_edges(cells)
    chosen = edges[np.random.default_rng(0).random(len(edges)) < 0.5]
    facets = np.unique(cell_facets(cells), axis=0)[::3]
    points, cells, facets = split_edges(points, cells, facets, chosen, points[chosen].mean(axis=1))
    volume = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]])
    assert volume.min() > 0
    assert volume.sum() == pytest.approx(2.0 if d == 2 else 6.0, rel=1e-12)
    known, times = np.unique(cell_facets(cells), axis=0, return_counts=True)
    assert times.max() == 2  # no hanging node: interior facets have two cells
    assert {tuple(f) for f in np.sort(facets, axis=1).tolist()} <= {
        tuple(f) for f in known.tolist()
    }


def test_uniform_refinement_keeps_volume_cut_and_shapes():
    grid = structured_tetrahedra((0, 0, 0), (1, 1, 1), (2, 2, 2))
    cut = np.array(SHAPES["inner"][0][0]["points"])
    mesh = imprint_polygons(*grid, [cut])
    before = open_cut(*mesh)
    worst = []
    for times in range(3):
        fine = open_cut(*refine_uniformly(*mesh, times=times))
        check(fine, 0.3, 1, 1e-4)
        edges = fine.points[fine.cells[:, 1:]] - fine.points[fine.cells[:, :1]]
        worst.append((volumes(fine) / np.linalg.norm(edges, axis=2).max(axis=1) ** 3).min())
    assert len(fine.cells) == 64 * len(before.cells)
    # a tetrahedron and its descendants have three shapes: no decay from the second level on
    assert worst[2] == pytest.approx(worst[1], rel=1e-6)


class TestBadGeometry:
    """Surfaces that almost touch: told apart, or refused by name."""

    pytestmark = needs_fenicsx

    def mesh(self, cuts, size=0.1):
        return conforming_mesh(cube(cuts), Grading(size, np.zeros((0, 3))))

    def discs(self, apart):
        return [disc(0.2, (0.5, 0.5, 0.5 + z), name=f"at {z}") for z in (0.0, apart)]

    @pytest.mark.parametrize("apart", [1e-8, 1e-7])
    def test_two_discs_that_would_be_merged_are_refused_by_name(self, apart):
        with pytest.raises(InputError, match="close"):
            self.mesh(self.discs(apart))

    @pytest.mark.parametrize("apart", [1e-2, 1e-3])
    def test_two_discs_a_small_gap_apart_are_both_cut(self, apart):
        # a circle of chords h loses h²/6R² of its area
        check(self.mesh(self.discs(apart)), 2 * np.pi * 0.04, 1, 1.2 * 0.1**2 / (6 * 0.2**2))

    def test_a_rim_that_touches_the_surface_of_the_body_keeps_its_area(self):
        rim = disc(0.2, (0.5, 0.5, 0.2), (1.0, 0.0, 0.0))
        check(self.mesh([rim]), np.pi * 0.04, 1, 1.2 * 0.1**2 / (6 * 0.2**2))

    def test_a_tube_that_touches_the_surface_along_a_line_frees_its_core(self):
        tube = cylinder((0.5, 0.2, -0.1), 1.2, 0.2)
        check(self.mesh([tube]), 0.4 * np.pi, 2, 1.2 * 0.1**2 / (6 * 0.2**2))

    def test_a_cut_through_a_support_opens_it(self):
        plane = polygon("p", (0.5, -0.1, -0.1), (0.5, 1.1, -0.1), (0.5, 1.1, 0.5), (0.5, -0.1, 0.5))
        check(self.mesh([plane]), 0.5, 1, 1e-12)
