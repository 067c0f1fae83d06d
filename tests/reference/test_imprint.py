"""Imprinting a cut on a given mesh: nothing but the touched cells changes, whatever the cut."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from reference_scenes import areas, exterior_facets, needs_fenicsx

from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut

UNIT = ((0.0, 0.0), (1.0, 1.0), (8, 8))


def cut_square(*polylines, mesh=None):
    points, cells = mesh or structured_triangles(*UNIT)
    return open_cut(*imprint(points, cells, [np.array(p, dtype=float) for p in polylines]))


def check(mesh, length, pieces):
    """Area, faces and length of the cut are kept."""
    assert areas(mesh).sum() == pytest.approx(1.0, rel=1e-12)
    assert exterior_facets(mesh) == len(mesh.boundary) + 2 * len(mesh.cut_facets)
    first = np.unique(mesh.parent, return_index=True)[1]
    ends = mesh.points[first[mesh.cut_facets]]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(length, rel=1e-9)
    assert mesh.pieces.max() + 1 == pieces


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


@pytest.mark.parametrize("name", CUTS)
def test_a_cut_in_any_place_keeps_area_and_length_and_opens_two_faces(name):
    polylines, pieces = CUTS[name]
    length = sum(length_in_square(np.array(polyline)) for polyline in polylines)
    check(cut_square(*polylines), length, pieces)


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

    @pytest.mark.parametrize("name", CUTS)
    def test_a_cut_in_any_place_keeps_area_and_pieces(self, name):
        from reference.meshing import background_mesh

        polylines, pieces = CUTS[name]
        outline = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
        mesh = cut_square(*polylines, mesh=background_mesh(outline, 0.15))
        assert areas(mesh).sum() == pytest.approx(1.0, rel=1e-12)
        assert exterior_facets(mesh) == len(mesh.boundary) + 2 * len(mesh.cut_facets)
        assert mesh.pieces.max() + 1 == pieces

    def test_a_background_mesh_is_uniform_deterministic_and_ignores_cuts(self):
        from reference.meshing import background_mesh

        outline = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 2.0], [0, 2.0]])
        points, cells = background_mesh(outline, 0.1)
        again, _ = background_mesh(outline, 0.1)
        assert np.array_equal(points, again)
        corners = points[cells]
        u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        area = 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
        assert area.sum() == pytest.approx(4.0, rel=1e-12)
        # equilateral triangles of side 0.1 on average; none much larger or smaller
        assert area.mean() == pytest.approx(np.sqrt(3) / 4 * 0.01, rel=0.15)
        assert area.max() < 5 * area.min()
