from dataclasses import replace

import numpy as np
import pytest
from cut_meshes import STRAIGHT, scene

from verify.compare.body import _inner_parts, body_of
from verify.compare.body_rule import area_rule, slab_angles
from verify.compare.cut_rule import cut_rule, place_on_cut
from verify.geometry.curves import Segment
from verify.geometry.planar import inside_polygon


def level(y, name="cut", x=(-0.1, 1.1)):
    return {"kind": "polyline", "name": name, "points": [[x[0], y], [x[1], y]]}


CUTS = {
    "none": [],
    "inclined": [STRAIGHT],
    "inner kinked": [{"kind": "polyline", "points": [[0.2, 0.3], [0.5, 0.5], [0.7, 0.4]]}],
    "near the boundary": [level(3e-9)],
    "1e-9 apart": [level(0.5), level(0.5 + 1e-9, "other")],
    "crossing": [
        level(0.5),
        {"kind": "polyline", "name": "b", "points": [[0.5, -0.1], [0.6, 1.1]]},
    ],
    "circle": [{"kind": "arc", "centre": [0.5, 0.5], "radius": 0.3}],
}


@pytest.mark.parametrize("cuts", CUTS.values(), ids=CUTS.keys())
def test_weights_sum_to_the_area_and_are_positive(cuts):
    for angle in (0.0, 0.5535):
        rule = area_rule(body_of(scene(cuts)), 0.07, angle)
        assert abs(rule.weights.sum() - 1) < 1e-13
        assert rule.weights.min() >= 0
        assert 0 < rule.points.min() < rule.points.max() < 1


def test_each_side_of_a_cut_has_its_exact_area_down_to_1e_9():
    rule = area_rule(body_of(scene(CUTS["1e-9 apart"])), 0.07)
    y = rule.points[:, 1]
    assert abs(rule.weights[y < 0.5].sum() - 0.5) < 1e-14
    sliver = rule.weights[(y > 0.5) & (y < 0.5 + 1e-9)].sum()
    assert sliver == pytest.approx((0.5 + 1e-9) - 0.5, rel=1e-6)


def test_a_disc_has_its_area_because_arcs_are_not_cut_into_facets():
    rule = area_rule(body_of(scene(CUTS["circle"])), 0.07)
    inside = np.linalg.norm(rule.points - 0.5, axis=1) < 0.3
    # the square-root at the poles is integrated by 6 points on halving slabs: 1e-9 of a slab
    assert rule.weights[inside].sum() == pytest.approx(np.pi * 0.09, rel=1e-10)


def test_a_square_root_singularity_at_a_tip_is_integrated():
    body = body_of(
        scene(
            [{"kind": "polyline", "points": [[0.0, 0.0], [0.0, 0.1]]}],
            geometry={"kind": "rectangle", "lower": [-1.0, -1.0], "upper": [1.0, 1.0]},
        )
    )
    tip = np.array([0.0, 0.1])
    assert np.allclose(np.abs(body.tips - tip).min(axis=0), 0)

    def inverse_distance(depth):
        rule = area_rule(body, 0.2, order=4, depth=depth)
        return rule.weights @ (1 / np.linalg.norm(rule.points - tip, axis=1))

    # ∫ 1/r over a rectangle with the point at its corner: b asinh(a/b) + a asinh(b/a)
    a = np.array([1.0, 1.0])
    exact = sum(2 * (b * np.arcsinh(1 / b) + np.arcsinh(b)) for b in (0.9, 1.1)) * a[0]
    assert inverse_distance(1e-6) == pytest.approx(exact, rel=1e-6)
    assert inverse_distance(1e-3) == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("turn", [0.0, np.pi / 4, 2 * np.pi / 3])
def test_a_tip_in_any_direction_is_refined_on_all_sides(turn):
    tip = 0.5 + 0.3 * np.array([np.cos(turn), np.sin(turn)])
    body = body_of(scene([{"kind": "polyline", "points": [[0.5, 0.5], tip.tolist()]}]))
    values = [
        rule.weights @ (1 / np.linalg.norm(rule.points - tip, axis=1))
        for rule in (area_rule(body, 0.2, angle, 6, 1e-8) for angle in slab_angles(body))
    ]
    assert np.ptp(values) < 2e-6 * values[0]


def test_a_cut_is_trimmed_to_the_body_and_its_normal_points_left():
    body = body_of(scene([STRAIGHT]))
    rule = cut_rule(body, 0.03)
    assert rule.weights.sum() == pytest.approx(np.hypot(1, 1 / 3), rel=1e-14)
    assert (rule.normals @ [-1, 3] > 0).all()
    assert (rule.positive[:, 1] > rule.points[:, 1]).all()
    middle = place_on_cut(body, "cut", 0.5)
    assert np.allclose(middle.points, [[0.5, 0.5]], atol=1e-15)


def test_tips_kinks_and_junctions_are_known_and_smooth_points_are_not():
    kinked = body_of(scene(CUTS["inner kinked"]))
    assert len(kinked.tips) == 2
    assert any(np.allclose(point, [0.5, 0.5]) for point in kinked.singular)
    straight = {"kind": "polyline", "points": [[0.2, 0.5], [0.5, 0.5], [0.8, 0.5]]}
    assert not any(np.allclose(p, [0.5, 0.5]) for p in body_of(scene([straight])).singular)
    crossing = body_of(scene(CUTS["crossing"]))
    assert len(crossing.tips) == 0
    assert any(np.allclose(point, [0.55, 0.5]) for point in crossing.singular)
    assert not len(body_of(scene(CUTS["circle"])).tips)


L_SHAPE = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.4], [0.3, 0.4], [0.3, 1.0], [0.0, 1.0]]


@pytest.mark.parametrize("seed", range(6))
def test_random_cuts_through_a_body_with_a_notch_lose_no_area(seed):
    random = np.random.default_rng(seed)
    cuts = []
    for k in range(3):  # some through corners, along mesh lines, on each other's ends
        ends = random.uniform(-0.2, 1.2, (2, 2))
        if seed % 3 == 0:
            ends = np.round(ends, 1)
        if seed % 3 == 1 and k:
            ends[0] = cuts[0]["points"][1]
        cuts.append({"kind": "polyline", "name": f"c{k}", "points": ends.tolist()})
    body = body_of(scene([]))
    outline = np.array(L_SHAPE)
    pieces = {c["name"]: [Segment(*np.array(c["points"]))] for c in cuts}
    parts = [part for name in pieces for part in _inner_parts(name, pieces, (outline,))]
    body = replace(body, loops=(outline,), cuts=pieces, parts=parts, singular=outline)
    rule = area_rule(body, 0.1, slab_angles(body)[seed % 3])
    assert abs(rule.weights.sum() - body.measure) < 1e-13
    assert rule.weights.min() >= 0
    # each point is well inside: no point on a cut or outside
    assert inside_polygon(rule.points, outline).all()
    for part in parts:
        foot = part.piece.point(part.piece.nearest(rule.points))
        assert np.linalg.norm(rule.points - foot, axis=1).min() > 0
