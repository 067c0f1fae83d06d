"""Distance of a realised cut from the cut as asked: closed forms in general position."""

from itertools import pairwise

import numpy as np
import pytest
from cut_meshes import grid, scene, solution
from solid_meshes import cube_grid, solid_scene

from verify.compare.body import body_of
from verify.compare.cut_deviation import realised_cut
from verify.compare.cut_rule import cut_rule_of

SEEDS = range(3)


def record(cuts, facets, size=0.1):
    """The record of facets in a unit square or cube of elements of that size."""
    facets = np.asarray(facets, dtype=float)
    n = round(1 / size)
    space = facets.shape[2] == 3
    body = body_of((solid_scene if space else scene)(cuts))
    points, cells = cube_grid(n, n, n) if space else grid(n, n)
    given = solution(points, cells, 0 * points, cut_facets=facets)
    return realised_cut(given, body, cut_rule_of(body, size)).record


def line(points, name="cut"):
    return {"kind": "polyline", "name": name, "points": np.asarray(points).tolist()}


def segments(points):
    return [list(pair) for pair in pairwise(np.asarray(points).tolist())]


def turned(seed):
    """A random frame in the square: origin, direction, normal."""
    random = np.random.default_rng(seed)
    angle = random.uniform(0, 2 * np.pi)
    along = np.array([np.cos(angle), np.sin(angle)])
    return random, random.uniform(0.45, 0.55, 2), along, np.array([-along[1], along[0]])


@pytest.mark.parametrize("seed", SEEDS)
def test_a_tooth_that_is_cut_off_is_as_high_as_it_is(seed):
    random, middle, along, up = turned(seed)
    height, left, right = random.uniform(0.08, 0.2), *random.uniform(0.03, 0.1, 2)
    ends = [middle - 0.3 * along, middle + 0.3 * along]
    tooth = [middle - left * along, middle + height * up, middle + right * along]
    found = record([line([ends[0], *tooth, ends[1]])], segments(ends))
    assert found.asked_to_realised == pytest.approx(height, rel=1e-3)
    # the points of the base that are farthest from the flanks are as far as the incircle reaches
    flanks = [np.linalg.norm(tooth[1] - tooth[k]) for k in (0, 2)]
    within = height * (left + right) / (left + right + sum(flanks))
    assert 0.3 * within < found.realised_to_asked <= 2.0 * within
    assert found.missing == found.surplus == 0.0
    assert not found.continued
    assert found.element == pytest.approx(0.1 * np.sqrt(2))


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_missing_and_too_much_at_ends_is_a_length(seed):
    random, middle, along, up = turned(seed)
    left, right, short, long, off = random.uniform(0.03, 0.1, 5) * [4, 4, 1, 1, 0.1]
    asked = [middle - left * along, middle + right * along]
    start, end = asked[0] + short * along, asked[1] + long * along
    shift = off * up
    # in pieces of an element
    stops = np.linspace(0, 1, 8)[:, None] * (end - start) + start + shift
    found = record([line(asked)], segments(stops))
    assert found.missing == pytest.approx(short, rel=0.1)
    facet = np.linalg.norm(stops[1] - stops[0])
    assert found.surplus == pytest.approx(long, abs=0.1 * facet)  # eight points each
    assert found.lateral == pytest.approx(off)
    assert found.continued


def test_a_cut_that_was_dropped_is_missing_also_beside_another():
    triangle = np.array([[0.5, 0.5], [0.54, 0.51], [0.53, 0.53], [0.5, 0.5]])
    perimeter = np.linalg.norm(np.diff(triangle, axis=0), axis=1).sum()
    stem = np.array([[0.1, 0.43], [0.9, 0.47]])
    slit = stem + np.array([0.0, 0.004])  # nearer to the other cut than the limit
    for other, length in ((triangle, perimeter), (slit, np.linalg.norm(slit[1] - slit[0]))):
        found = record([line(stem), line(other, "small")], segments(stem))
        assert found.missing == pytest.approx(length, rel=1e-6)
        assert found.lateral < 1e-12
        found = record([line(other)], np.zeros((0, 2, 2)))
        assert found.missing == pytest.approx(length, rel=1e-6)
        assert found.continued  # a field that has no cut is what it is


def test_a_branch_is_short_too_long_or_in_place():
    stem, branch = np.array([[0.1, 0.4], [0.9, 0.5]]), np.array([[0.5, 0.45], [0.63, 0.81]])
    cuts = [line(stem), line(branch, "branch")]
    halves = segments([stem[0], branch[0], stem[1]])
    exact = record(cuts, halves + segments(branch))
    assert max(exact.lateral, exact.missing, exact.surplus) < 1e-12
    short = record(cuts, halves + segments([branch[0], 0.5 * branch.sum(axis=0)]))
    length = np.linalg.norm(branch[1] - branch[0])
    assert short.missing == pytest.approx(0.5 * length, rel=0.03)
    # it goes on through the stem
    crossed = segments([branch[0], branch[0] - 0.3 * (branch[1] - branch[0])])
    long = record(cuts, halves + segments(branch) + crossed)
    assert long.surplus == pytest.approx(0.3 * length, abs=long.limit + 0.1 * 0.3 * length)
    assert long.continued


def rings(axes, radius, count=40):
    """Triangles of a regular polygon in the plane of two axes."""
    angle = 2 * np.pi * np.arange(count) / count
    unit = np.column_stack([np.cos(angle), np.sin(angle)]) @ axes[:2]
    found = []
    for low, high in pairwise(np.linspace(0, radius, 9)):
        a, b = 0.5 + low * unit, 0.5 + high * unit
        c, d = (np.roll(one, -1, axis=0) for one in (a, b))
        found += [np.stack([a, b, d], axis=1)] + ([np.stack([a, d, c], axis=1)] if low else [])
    return np.concatenate(found), count / 2 * np.sin(2 * np.pi / count) * radius**2


@pytest.mark.parametrize("seed", SEEDS[:1])
def test_what_a_disc_is_short_of_is_an_area(seed):
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    outer, inner = 0.3, 0.22
    disc = {"kind": "disc", "centre": [0.5, 0.5, 0.5], "normal": axes[2].tolist(),
            "radius": outer}  # fmt: skip
    (small, area), (large, beyond) = rings(axes, inner), rings(axes, outer)
    found = record([disc], small)
    assert found.missing == pytest.approx(np.pi * outer**2 - area, rel=0.03)
    assert found.surplus == 0.0
    assert found.lateral < 1e-9
    wide = record([{**disc, "radius": inner}], large)
    assert wide.surplus == pytest.approx(beyond - np.pi * inner**2, rel=0.03)
    assert wide.missing == 0.0
    lifted = record([disc], large + 0.02 * axes[2])
    assert lifted.lateral == pytest.approx(0.02)
    assert not lifted.continued  # 3D/32 is 0.0162


@pytest.mark.parametrize("seed", SEEDS[:2])
def test_a_swept_tooth_in_space_is_as_high_as_it_is(seed):
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    height, left, right = random.uniform(0.1, 0.15), *random.uniform(0.05, 0.1, 2)
    flat = np.array([[-0.25, 0], [-left, 0], [0, height], [right, 0], [0.25, 0]])
    profile = 0.5 + flat @ axes[:2] - 0.1 * axes[2]
    along = 0.2 * axes[2]
    swept = {"kind": "swept", "points": profile.tolist(), "along": along.tolist()}
    a, b = profile[0], profile[-1]
    facets = np.array([[a, b, b + along], [a, b + along, a + along]])
    found = record([swept], facets)
    assert found.asked_to_realised == pytest.approx(height, rel=0.15)  # between points of the rule
    assert found.asked_to_realised <= height
    assert found.missing == found.surplus == 0.0
    assert not found.continued
    exact = [[p, q, q + along] for p, q in pairwise(profile)]
    exact += [[p, q + along, p + along] for p, q in pairwise(profile)]
    found = record([swept], exact)
    assert max(found.lateral, found.missing, found.surplus) < 1e-9
