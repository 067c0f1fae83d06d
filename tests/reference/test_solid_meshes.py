"""Conforming meshes in space: what a cut must do to a mesh, made anew and imprinted."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx
from solid_scenes import CURVED, SHAPES, area, cube, cylinder, disc, volumes

from reference.meshing import (
    Grading,
    conforming_mesh,
    imprint_polygons,
    open_cut,
    structured_tetrahedra,
)
from verify.errors import InputError, UnsupportedSceneError
from verify.geometry.simplices import cell_facets, refine_uniformly

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

    @pytest.mark.parametrize(
        "name", ["edge", "branching", "quartered", "swept", "half a disc", *list(CURVED)[2:]]
    )
    def test_every_cut_opens_with_its_area_and_leaves_the_volume(self, name):
        cuts, expected, pieces = (SHAPES | CURVED)[name]
        # plane facets are exact; a circle of chords h loses h²/24R² of its length, and a disc
        # h²/6R² of its area
        radius = {"half a disc": 0.4, "ellipse": 0.15}.get(name, 2 * 0.3)
        tolerance = 1e-12 if name in SHAPES else 1.2 * 0.15**2 / (6 * radius**2)
        check(conforming_mesh(cube(cuts), UNIFORM), expected, pieces, tolerance)

    def test_a_finer_mesh_facets_a_curved_cut_with_an_error_of_order_two(self):
        errors = []
        for size in (0.16, 0.08):
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
    def test_every_plane_cut_opens_with_its_area_and_leaves_the_volume(self, name):
        cuts, expected, pieces = SHAPES[name]
        grid = structured_tetrahedra((0, 0, 0), (1, 1, 1), (4, 3, 4))
        polygons = [np.array(cut["points"]) for cut in cuts]
        check(open_cut(*imprint_polygons(*grid, polygons)), expected, pieces, 1e-4)

    # seeds whose polygons surround their centre
    @pytest.mark.parametrize("seed", [2, 5, 7])
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

    @pytest.mark.parametrize("off", [0.0, 1e-16, 1e-8, 1e-3])
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
    RIM = disc(0.2, (0.5, 0.5, 0.2), (1.0, 0.0, 0.0))
    GROOVE = cylinder((0.5, 0.2, -0.1), 1.2, 0.2)

    @staticmethod
    def mesh(*cuts):
        return conforming_mesh(cube(cuts), Grading(0.1, np.zeros((0, 3))))

    def test_two_discs_that_would_be_merged_are_refused_by_name(self):
        with pytest.raises(InputError, match="close"):
            self.mesh(disc(0.2, name="a"), disc(0.2, (0.5, 0.5, 0.5 + 1e-7), name="b"))

    @pytest.mark.parametrize(
        ("cuts", "expected", "pieces"),
        [
            ([disc(0.2, name="a"), disc(0.2, (0.5, 0.5, 0.501), name="b")], 0.08 * np.pi, 1),
            ([RIM], 0.04 * np.pi, 1),
            ([GROOVE], 0.4 * np.pi, 2),
        ],
        ids=["a small gap apart", "a rim that touches the surface", "a tube along the surface"],
    )
    def test_surfaces_that_almost_touch_keep_their_area(self, cuts, expected, pieces):
        # a circle of chords h loses h²/6R² of its area
        check(self.mesh(*cuts), expected, pieces, 1.2 * 0.1**2 / (6 * 0.2**2))
