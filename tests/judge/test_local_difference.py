"""Difference of two levels around a place: on its side of the cut only, and without accidents."""

from itertools import pairwise

import numpy as np
import pytest
import scenes

from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from verify.compare.body import body_of
from verify.compare.hooke import hooke
from verify.judge.convergence import extrapolate, place_uncertainty
from verify.judge.quantities import Measured, local_difference
from verify.judge.reference import known_quantity
from verify.solution import Solution

SIZES = [0.4, 0.2, 0.1]
POINT = {"kind": "displacement", "name": "u", "point": [0.31, 0.83], "component": "x"}
OPENING = {"kind": "opening", "name": "open", "at": 0.4}
SCENE = scenes.scene(
    [{"kind": "polyline", "points": [[-0.1, 0.5], [1.1, 0.5]]}],
    quantities=[POINT, OPENING, {**OPENING, "name": "slide", "component": "tangential"}],
)
U, OPEN, SLIDE = SCENE.quantities


def measured(n, above=(0.0, 0.0), below=(0.0, 0.0), field=None):
    """Give a level that is displaced by two vectors beside the cut, or by a field."""
    points, cells = structured_triangles((0.0, 0.0), (1.0, 1.0), (n, n))
    mesh = open_cut(*imprint(points, cells, [np.array([[-0.1, 0.5], [1.1, 0.5]])]))
    u = np.zeros_like(mesh.points)
    middle = mesh.points[mesh.cells].mean(axis=1)
    for side, value in ((middle[:, 1] > 0.5, above), (middle[:, 1] < 0.5, below)):
        u[mesh.cells[side]] = value
    if field is not None:
        u[:, 0] = field(*mesh.points.T)
    solution = Solution(mesh.points, mesh.cells, u[None], cut_facets=mesh.realised_cut)
    return Measured(solution, body_of(SCENE), hooke(SCENE.material), SCENE)


def test_only_the_side_of_the_point_counts():
    coarse, fine = measured(7), measured(14, above=(1e-3, 5.0), below=(7.0, 7.0))
    assert local_difference(U, coarse, fine) == pytest.approx(1e-3, rel=1e-12)


def test_of_a_linear_difference_it_is_the_root_mean_square_over_the_cells_beside():
    """Of a linear f over a triangle the mean square is (Σ f² + (Σ f)²)/12."""
    coarse = measured(7)
    found = local_difference(U, coarse, measured(14, field=lambda x, y: 0.3 * x - 0.7 * y + 0.4))
    points, cells = coarse.solution.points, coarse.solution.cells
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    share = np.linalg.solve(
        edges.swapaxes(1, 2), (np.array([0.31, 0.83]) - points[cells[:, 0]])[..., None]
    )
    (own,) = np.flatnonzero((share.min(axis=(1, 2)) > 0.0) & (share.sum(axis=(1, 2)) < 1.0))
    beside = cells[[bool(set(cell) & set(cells[own])) for cell in cells.tolist()]]
    f = points[beside] @ [0.3, -0.7] + 0.4
    area = np.abs(np.linalg.det(points[beside[:, 1:]] - points[beside[:, :1]]))
    squares = (np.sum(f**2, axis=1) + np.sum(f, axis=1) ** 2) / 12
    assert 9 < len(beside) < 20
    assert found == pytest.approx(np.sqrt(area @ squares / area.sum()), rel=1e-12)


def test_what_both_faces_do_alike_is_no_opening_and_what_they_do_apart_adds():
    coarse = measured(7)
    alike, apart = ((0.02, 0.01), (0.02, 0.01)), ((0.03, 0.01), (-0.01, -0.02))
    assert local_difference(OPEN, coarse, measured(14, *alike)) < 1e-15
    assert local_difference(OPEN, coarse, measured(14, *apart)) == pytest.approx(0.03)
    assert local_difference(SLIDE, coarse, measured(14, *apart)) == pytest.approx(0.04)


def test_where_one_place_has_an_order_by_accident_its_surroundings_have_that_of_the_element():
    def wave(x, y):
        return np.sin(3 * x) * np.cos(2 * y)

    levels = [measured(n, field=wave) for n in (7, 15, 31, 63)]
    steps = [local_difference(U, one, two) for one, two in pairwise(levels)]
    # interpolants: order 2, up to which cells happen to lie around the place
    assert np.log2(np.divide(steps[:-1], steps[1:])) == pytest.approx(2.0, abs=0.5)
    found = place_uncertainty(0.0, steps[1:], [1 / 15, 1 / 31, 1 / 63], 2)
    error = abs(levels[-1].quantity(U) - wave(0.31, 0.83))
    assert error <= found.half_width < 2e-3


@pytest.mark.parametrize("same_sign", [True, False])
def test_errors_at_random_places_are_covered_in_nineteen_of_twenty_and_not_wasted(same_sign):
    # error h² z at a place, z normal: the same z on all levels (smooth errors), or another
    rng = np.random.default_rng(3)
    z = rng.standard_normal((1 if same_sign else 3, 20_000)) * np.square(SIZES)[:, None]
    steps = np.sqrt(np.mean(np.diff(z, axis=0) ** 2, axis=1))
    width = place_uncertainty(0.0, steps, SIZES, 2).half_width
    error = np.abs(z[-1])
    assert np.mean(error <= width) >= 0.95
    # of normal errors a share of .08 u lies below u/10 times their deviation: no bar can be
    # narrower than ten errors for more than 84 % of them and cover 95 %
    assert np.mean(width < 10 * error) >= (0.83 if same_sign else 0.77)


def test_levels_that_are_equal_around_a_place_are_known_to_round_off():
    found = place_uncertainty(3.0, [0.0, 0.0], SIZES, 2)
    assert 0 < found.half_width < 1e-12
    assert "equal" in found.reason


def test_an_energy_may_converge_with_twice_the_order_of_its_element():
    """Linear elements, differences that fall by four: as good as order 2 lets them be."""
    (energy,) = scenes.scene(quantities=[{"kind": "strain_energy"}]).quantities
    levels = [measured(n, field=lambda x, y: x * y) for n in (4, 8, 16)]
    values = [1.0 + size**2 for size in SIZES]
    found = known_quantity(energy, levels, values, SIZES)
    assert found.half_width == pytest.approx(extrapolate(values, SIZES, 2.0).half_width)
    assert found.half_width < 0.75 * extrapolate(values, SIZES, 3.0).half_width
    # where the field allows no order, twice the least that is counted on: ¼ in the energy norm
    rough = known_quantity(energy, levels, values, SIZES, functional=0.0)
    assert rough.half_width == pytest.approx(extrapolate(values, SIZES, 0.5).half_width)
