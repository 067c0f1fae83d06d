"""Fields are read on the side of the cut as asked, at every place, against winding numbers."""

import numpy as np
import pytest
from cut_meshes import scene as plane_scene
from parted_bodies import moved_parts, parted_cube, parted_square, parts_of, random_square

from reference.exact import exact_of
from verify.compare.body import body_of
from verify.compare.body_rule import rules
from verify.compare.cut_rule import cut_rule_of
from verify.compare.errors import displacement_jump, jump_error, nodal_error
from verify.compare.motion import ExactMotion
from verify.compare.realised import cut_deviation, field_of
from verify.compare.sides import distance_to_segments
from verify.scene import load_scene
from verify.solvers import find_solver

_MOVED = 1e-9  # parts are moved by whole numbers


def _places_read_wrong(parted, seed, n, volume):
    """How many places are read from another part than they lie in, and how many were read."""
    scene, body, solution, there = parted(np.random.default_rng(seed), n)
    field = field_of(solution, body)
    cut = cut_rule_of(body, 1.0 / n)
    asked = [(cut.points, cut.positive), (cut.points, cut.negative)]
    if volume:
        points = rules(body, 1.0 / n, 1)[0].points
        asked.append((points, points))
    wrong = count = 0
    for points, near in asked:
        part = parts_of(scene, near)
        read = field.displacement(points, near)[:, 0]
        # a part smaller than the elements that no cell holds cannot be read
        known = np.isin(part, list(there))
        wrong += int((np.abs(read - part)[known] > _MOVED).sum())
        count += int(known.sum())
    return wrong, count


def _read_wrong(parted, seeds, n, volume):
    found = [_places_read_wrong(parted, seed, n, volume) for seed in seeds]
    wrong, count = np.sum(found, axis=0)
    assert count >= 10_000
    return wrong


def test_every_place_on_arcs_and_s_curves_that_cross_is_read_on_its_side():
    assert _read_wrong(parted_square, range(6), 10, volume=False) == 0


def test_every_place_on_cylinders_and_swept_curves_that_cross_is_read_on_its_side():
    assert _read_wrong(parted_cube, (0, 3), 5, volume=False) == 0


def test_points_of_the_quadrature_lie_in_the_part_in_which_they_are_read():
    assert _read_wrong(parted_square, (9,), 6, volume=True) == 0
    assert _read_wrong(parted_cube, (1,), 4, volume=True) == 0


def test_the_error_map_of_parts_that_moved_alike_is_zero_at_every_node():
    for seed in (0, 7):
        random = np.random.default_rng(seed)
        scene, body, own, there = parted_square(random, 12)
        other, also = moved_parts(scene, random_square(17, random), 1 / 17)
        assert there == also
        truth = field_of(other, body, deviation=cut_deviation(own, body))
        assert nodal_error(own, truth, body).max() < _MOVED


def test_quadrature_points_are_off_the_cut_by_more_than_round_off():
    # the second rule had points of weight 1e-19 at 1e-16 from this cut
    body = body_of(load_scene("statics/griffith_inside"))
    for rule in rules(body, 1 / 8):
        foot, _ = body.nearest_on_cuts(rule.points)
        assert np.linalg.norm(rule.points - foot, axis=1).min() > 1e-14 * body.size
        assert rule.weights.sum() == pytest.approx(body.measure, rel=1e-12)


def test_the_ends_of_a_cut_have_no_sides_beyond_them():
    # an arc that ends in the square: a body that moves as a whole behind it has one value there
    arc = {"kind": "arc", "centre": [0.5, 0.2], "radius": 0.35, "start": 60.0, "sweep": 50.0}
    scene = plane_scene([arc])
    body = body_of(scene)
    random = np.random.default_rng(5)
    solution, _ = moved_parts(scene, random_square(12, random), 1 / 12)
    field = field_of(solution, body)
    assert np.abs(displacement_jump(field, cut_rule_of(body, 1 / 12))).max() < _MOVED


@pytest.mark.parametrize("d", [2, 3])
def test_distances_to_segments_hold_within_a_reach_and_beyond_it_are_no_smaller(d):
    """Segments of lengths from 0 to 2, points on both sides of the reach; dense sampling."""
    random = np.random.default_rng(d)
    starts = random.uniform(-1, 1, (9, d))
    lengths = np.linspace(0.0, 1.0, 9)[:, None]
    segments = np.stack([starts, starts + lengths * random.uniform(-1, 1, (9, d))], axis=1)
    points = random.uniform(-1.5, 1.5, (400, d))
    t = np.linspace(0.0, 1.0, 2001)[:, None, None]
    along = (1 - t) * segments[:, 0] + t * segments[:, 1]
    true = np.array([np.linalg.norm(along - x, axis=2).min() for x in points])
    found = distance_to_segments(points, segments, 0.5)
    near = true < 0.5 - 1e-3
    assert near.sum() > 20
    assert np.abs(found - true)[near].max() < 1e-3  # of the sampling
    assert found[~near].min() > 0.5 - 2e-3
    assert np.isinf(distance_to_segments(points, segments[:0], 0.5)).all()


@pytest.mark.parametrize("epsilon", ["1e-09", "1e-12"])
def test_a_piece_left_to_the_other_half_is_on_the_side_of_its_nodes(epsilon):
    """Beside a vertex XFEM leaves a corner of 1e-20 of its cell to its neighbour across the cut.

    The jump there is read from the cells around it: its error is that of a cut a little farther.
    """

    def error(row):
        scene = load_scene(f"benchmark/c8_slivers[epsilon={row}]")
        body, solution = body_of(scene), find_solver("xfem").solve(scene, 0, 0)
        rule = cut_rule_of(body, solution.size, 0)
        exact = ExactMotion(exact_of(scene)).at(0.0)
        return jump_error(field_of(solution, body), exact, rule).relative

    assert error(epsilon) == pytest.approx(error("1e-06"), rel=0.01)
