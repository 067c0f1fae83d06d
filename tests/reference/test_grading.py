"""Singular points, gradings and imprints: area, length and pieces, cuts in any place."""

from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_scenes import areas, exterior_facets, needs_fenicsx, polyline, square

from reference.fracture import tips
from reference.fracture.intensity import ring
from reference.meshing import background_mesh, conforming_mesh
from reference.meshing.edge_splitting import flip_flat_cells
from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from reference.meshing.session import Grading, clear_radii, singular_points
from verify.solution import Solution
from verify.solvers.conforming_meshes import reference_mesh

UNIT = ((0.0, 0.0), (1.0, 1.0), (8, 8))


@cache
def unstructured():
    return background_mesh(np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), 0.15)


def cut_square(*polylines, mesh=None):
    points, cells = mesh or structured_triangles(*UNIT)
    return open_cut(*imprint(points, cells, [np.array(p, dtype=float) for p in polylines]))


# polylines, and the number of pieces that they leave
CUTS = {
    "through cells": ([[(-0.1, 0.43), (1.1, 0.61)]], 2),
    "along edges": ([[(-0.1, 0.5), (1.1, 0.5)]], 2),
    "along diagonals": ([[(-0.1, -0.1), (1.1, 1.1)]], 2),
    "across through vertices": ([[(-0.1, 1.1), (1.1, -0.1)]], 2),
    "tips in cells": ([[(0.21, 0.33), (0.68, 0.47)]], 1),
    "tips at vertices": ([[(0.25, 0.25), (0.75, 0.5)]], 1),
    "tips inside edges": ([[(0.25, 0.3), (0.7, 0.5)]], 1),
    "kinked": ([[(0.2, 0.3), (0.5, 0.62), (0.81, 0.3)]], 1),
    "crossing": ([[(0.2, 0.45), (0.8, 0.52)], [(0.5, 0.2), (0.46, 0.8)]], 1),
    "branching": ([[(0.2, 0.5), (0.8, 0.5)], [(0.5, 0.5), (0.53, 0.8)]], 1),
    "crossing through": ([[(-0.1, 0.45), (1.1, 0.52)], [(0.5, -0.2), (0.46, 1.2)]], 4),
}


@needs_fenicsx[0]
@needs_fenicsx[1]
@pytest.mark.parametrize("name", CUTS)
def test_a_cut_in_any_place_keeps_area_and_length_and_opens_two_faces(name):
    polylines, pieces = CUTS[name]
    length = sum(length_in_square(np.array(polyline)) for polyline in polylines)
    for mesh in (cut_square(*polylines), cut_square(*polylines, mesh=unstructured())):
        assert areas(mesh).sum() == pytest.approx(1.0, rel=1e-12)
        assert exterior_facets(mesh) == len(mesh.boundary) + 2 * len(mesh.cut_facets)
        # beside a mesh line a cut may follow it
        assert length_of_cut(mesh) == pytest.approx(length, rel=1e-9)
        assert mesh.pieces.max() + 1 == pieces


def length_of_cut(mesh):
    first = np.unique(mesh.parent, return_index=True)[1]
    ends = mesh.points[first[mesh.cut_facets]]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()


def length_in_square(polyline):
    """Length of a polyline inside the unit square, each segment clipped on its own."""
    length = 0.0
    for a, b in pairwise(polyline):
        with np.errstate(divide="ignore"):
            stops = np.sort(np.stack([(0 - a) / (b - a), (1 - a) / (b - a)]), axis=0)
        start, end = max(0.0, stops[0].max()), min(1.0, stops[1].min())
        length += max(end - start, 0.0) * float(np.linalg.norm(b - a))
    return length


def test_cells_that_the_cut_does_not_touch_stay_as_they_are():
    points, cells = structured_triangles(*UNIT)
    new_points, new_cells, _ = imprint(points, cells, [np.array([(-0.1, 0.43), (1.1, 0.43)])])
    assert np.array_equal(new_points[: len(points)], points)
    old = {tuple(sorted(c)) for c in cells.tolist()}
    kept = {tuple(sorted(c)) for c in new_cells.tolist()} & old
    row = 16  # one row of squares holds the cut
    assert len(old) - len(kept) == row


@settings(max_examples=60, deadline=None)
@given(
    exponent=st.integers(1, 9),
    sign=st.sampled_from([1, -1]),
    slope=st.sampled_from([0.0, 1.0, -1.0, 0.3]),
)
def test_a_cut_a_sliver_away_from_edges_and_vertices_keeps_area_and_pieces(exponent, sign, slope):
    shift = sign * 10.0**-exponent / 8
    cut = [(-0.1, 0.5 + shift - 0.6 * slope), (1.1, 0.5 + shift + 0.6 * slope)]
    mesh = cut_square(cut)
    assert areas(mesh).sum() == pytest.approx(1.0, rel=1e-12)
    assert areas(mesh).min() > 0
    assert mesh.pieces.max() + 1 == 2
    above = mesh.points[mesh.cells].mean(axis=1) @ [-slope, 1.0] > 0.5 + shift - 0.5 * slope
    sides = [set(mesh.pieces[above]), set(mesh.pieces[~above])]
    assert not sides[0] & sides[1]


class TestOnUnstructuredMeshes:
    pytestmark = needs_fenicsx

    def test_a_background_mesh_is_uniform_deterministic_and_ignores_cuts(self):
        outline = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 2.0], [0, 2.0]])
        points, cells = background_mesh(outline, 0.1)
        again, _ = background_mesh(outline, 0.1)
        assert np.array_equal(points, again)
        area = areas(SimpleNamespace(points=points, cells=cells))
        assert area.sum() == pytest.approx(4.0, rel=1e-12)
        # equilateral triangles of side 0.1 on average; none much larger or smaller
        assert area.mean() == pytest.approx(np.sqrt(3) / 4 * 0.01, rel=0.15)
        assert area.max() < 5 * area.min()


CLAMPED_TOP = {"supports": [{"where": "top", "displacement": [0, 0]}]}


def rounded(points):
    return {tuple(np.round(p, 9).tolist()) for p in points}


def test_tips_and_kinks_inside_the_body_are_singular_and_mouths_are_not():
    exact = {
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "exact": {"solution": "linear", "parameters": {"matrix": [[0, 0], [0, 0]]}},
        "loads": [],
    }
    cut = polyline("a", (-0.1, 0.4), (0.3, 0.4), (0.6, 0.7), (0.7, 0.801))
    # the last kink turns by 0.3°, which matters to nobody
    assert rounded(singular_points(square([cut], **exact))) == {(0.3, 0.4), (0.7, 0.801)}


def test_crossings_and_branchings_are_singular():
    cuts = [
        polyline("a", (0.2, 0.5), (0.8, 0.5)),
        polyline("b", (0.5, 0.2), (0.5, 0.8)),
        {"kind": "arc", "name": "c", "centre": [0.5, 0.5], "radius": 0.2},
    ]
    found = rounded(singular_points(square(cuts)))
    meetings = {(0.5, 0.5), (0.3, 0.5), (0.7, 0.5), (0.5, 0.3), (0.5, 0.7)}
    assert found == meetings | {(0.2, 0.5), (0.8, 0.5), (0.5, 0.2), (0.5, 0.8)}


def test_a_mouth_is_singular_where_the_boundary_is_held_and_not_where_it_is_free():
    cut = polyline("a", (0.4, -0.1), (0.4, 1.1))
    assert rounded(singular_points(square([cut], **CLAMPED_TOP))) == {(0, 1), (1, 1), (0.4, 1)}


def test_a_traction_is_singular_where_no_bounded_stress_fits_it():
    def with_load(where, traction):
        load = {"kind": "traction", "where": where, "traction": traction}
        bottom = [{"where": "bottom", "displacement": [0, 0]}]
        return rounded(singular_points(square(supports=bottom, loads=[load]))) - {(0, 0), (1, 0)}

    assert with_load("top", [0, 1]) == set()
    assert with_load("top", [1, 0]) == {(0, 1), (1, 1)}  # shear against a free side
    assert with_load("y > 0.9999999 and x > 0.5", [0, 1]) == {(0.5, 1)}


class TestNearerThanTheMeshGeneratorCanGo:
    pytestmark = needs_fenicsx

    def test_rings_carry_the_grading_on_to_both_tips(self):
        scene = square([polyline("a", (0.3, 0.43), (0.7, 0.61))])
        # few cells, but as small at the tips as those of level 5
        grading = Grading(0.1, singular_points(scene), 4.0, 0.86)
        assert 5e-12 < grading.smallest < 0.1 * grading.meshed(1.0)
        mesh = conforming_mesh(scene, grading)
        for tip in ([0.3, 0.43], [0.7, 0.61]):
            away = np.sort(np.linalg.norm(mesh.points - tip, axis=1))
            assert away[0] < 1e-15
            assert away[1] < 4 * grading.smallest
        assert areas(mesh).sum() == pytest.approx(1.0, rel=1e-12)
        # and the tips stay closed: a cut of F facets between two tips doubles F − 1 nodes
        assert len(mesh.parent) - len(np.unique(mesh.parent)) == len(mesh.cut_facets) - 1

    # long double cantilevers; gmsh meshes a body of length one, so that its digits end sooner in
    # terms of the height
    @pytest.mark.parametrize(
        "length, mouth, tip",
        [(29.7, -0.067, (24.66, 0.113)), (20.3, 0.236, (4.3, 0))],
    )
    def test_no_facet_is_lost_at_the_tip_in_a_slender_body(self, length, mouth, tip):
        scene = square(
            [polyline("a", (-0.1, mouth), tip)],
            geometry=scenes.box([length, 0.5], [0.0, -0.5]),
        )
        radius = 0.5 * np.sqrt(length)
        grading = Grading(0.11 * radius, singular_points(scene), radius, 0.9)
        assert grading.smallest < 2e-10 * length
        mesh = conforming_mesh(scene, grading)
        assert len(mesh.parent) - len(np.unique(mesh.parent)) == len(mesh.cut_facets)
        assert areas(mesh).sum() == pytest.approx(length, rel=1e-12)


WIDE = {"geometry": {"kind": "rectangle", "lower": [0, 0], "upper": [2000, 2000]}}
SHORT = {
    "a branch of a tenth of an arm": [
        polyline("a", (1000, 1000), (990, 1002)),
        polyline("b", (1000, 1000), (1009, 1001)),
        polyline("c", (1000, 1000), (1000.5, 1000.86)),
    ],
    "a ligament of a tenth of a crack": [
        polyline("a", (990, 1000), (1000, 1000)),
        polyline("b", (1001, 1000.1), (1011, 1000.7)),
    ],
}


def factors_of(cuts):
    """K_I at both ends of every cut: those that are no tips are refused by check alone."""
    return [
        {"kind": "stress_intensity", "name": f"{cut['name']} {end}", "cut": cut["name"], "end": end}
        for cut in cuts
        for end in ("start", "end")
    ]


@pytest.mark.parametrize("cuts", SHORT.values(), ids=SHORT)
@needs_fenicsx[0]
@needs_fenicsx[1]
def test_domains_fit_around_every_tip_on_the_coarsest_level_too(cuts):
    scene = square(cuts, **WIDE, quantities=factors_of(cuts))
    mesh, _ = reference_mesh(scene, 0)
    field = Solution(mesh.points, mesh.cells, np.zeros((1, *mesh.points.shape)))
    found = tips(scene)
    assert len(found) == (3 if len(cuts) == 3 else 4)
    for tip in found:
        for radius in tip.radii():
            around = ring(field, tip.point, float(radius))
            # elements of a third of the smallest radius: a ring of 2π 3 of at least two triangles
            assert len(around.cells) > 30


def test_only_tips_that_are_asked_for_and_lie_close_to_something_are_graded_to_anew():
    def close(cuts, quantities, **changes):
        scene = square(cuts, quantities=quantities, **changes)
        outline = scene.geometry.outline()
        extent = float(np.sqrt(np.prod(np.ptp(outline, axis=0))))
        points = singular_points(scene)
        clear = clear_radii(scene, points)
        grading = Grading(extent / 12, points, extent / 2, clear=clear)
        assert len(grading.halved(3).close_points()) == len(grading.close_points())
        return [place.tolist() for place, _ in grading.close_points()]

    energy = [{"kind": "strain_energy"}]
    ligament = SHORT["a ligament of a tenth of a crack"]
    assert close(ligament, energy, **WIDE) == []
    asked = factors_of(ligament)[1:2]  # the end of a
    assert close(ligament, asked, **WIDE) == [[1000.0, 1000.0]]
    common = [polyline("a", (0.2, 0.5), (0.7, 0.6))]
    assert close(common, factors_of(common)) == []


@settings(max_examples=40, deadline=None)
@given(
    reversed_cell=st.booleans(),
    angle=st.floats(0, 2 * np.pi),
    off=st.floats(-1e-9, 1e-9),
    place=st.floats(0.1, 0.9),
)
def test_a_flat_cell_between_nodes_of_a_cut_is_flipped_into_its_neighbour(
    reversed_cell, angle, off, place
):
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    points = np.array([[0, 0], [place, off], [1, 0], [0.4, 0.7], [0.5, -0.8]]) @ turn.T + 3.0
    flat = [0, 2, 1] if reversed_cell else [0, 1, 2]
    cells, cut = np.array([flat, [0, 2, 3], [0, 4, 1], [1, 4, 2]]), np.array([[0, 1], [1, 2]])
    flipped = flip_flat_cells(points, cells, cut)
    area = areas(SimpleNamespace(points=points, cells=flipped))
    assert area.min() > 0.02
    assert area.sum() == pytest.approx(0.75, rel=1e-8)
    held = {frozenset(pair) for cell in flipped.tolist() for pair in ((*cell[:2],), (*cell[1:],))}
    held |= {frozenset((cell[0], cell[2])) for cell in flipped.tolist()}
    assert {frozenset(pair) for pair in cut.tolist()} <= held
    marked = np.array([[0, 1], [1, 2], [0, 2]])
    assert np.array_equal(flip_flat_cells(points, cells, marked), cells)
