"""Places where the reference refines, and the law by which it does."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline, square

from reference.meshing.grading import Grading, clear_radii, singular_points

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
        from reference.meshing import conforming_mesh

        scene = square([polyline("a", (0.3, 0.43), (0.7, 0.61))])
        # few cells, but as small at the tips as those of level 5
        grading = Grading(0.1, singular_points(scene), 4.0, 0.86)
        assert 5e-12 < grading.smallest < 0.1 * grading.meshed
        mesh = conforming_mesh(scene, grading)
        for tip in ([0.3, 0.43], [0.7, 0.61]):
            away = np.sort(np.linalg.norm(mesh.points - tip, axis=1))
            assert away[0] < 1e-15
            assert away[1] < 4 * grading.smallest
        a, b, c = (mesh.points[mesh.cells[:, k]] for k in range(3))
        area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
        assert area.sum() == pytest.approx(1.0, rel=1e-12)
        # and the tips stay closed: a cut of F facets between two tips doubles F − 1 nodes
        assert len(mesh.parent) - len(np.unique(mesh.parent)) == len(mesh.cut_facets) - 1


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
@pytest.mark.parametrize("level", [0, 1])
class TestAroundShortBranches:
    pytestmark = needs_fenicsx

    def test_domains_fit_around_every_tip_on_the_coarsest_level_too(self, cuts, level):
        from reference.fracture import tips
        from reference.fracture.domain import ring
        from verify.solution import Solution
        from verify.solvers.conforming_meshes import reference_mesh

        scene = square(cuts, **WIDE, quantities=factors_of(cuts))
        mesh, _ = reference_mesh(scene, level)
        field = Solution(mesh.points, mesh.cells, np.zeros((1, *mesh.points.shape)))
        found = tips(scene)
        assert len(found) == (3 if len(cuts) == 3 else 4)
        for tip in found:
            for radius in tip.radii():
                around = ring(field, tip.point, float(radius))
                # elements of a third of the smallest radius, halved with every level: a ring of
                # them has 2π 3 2^level of at least two triangles each
                assert len(around.cells) > 30 * 2**level


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
