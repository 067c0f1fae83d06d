"""Finite rotation and strain: patches, bending to half circles, loads that follow no rotation."""

import numpy as np
import pytest
from large_bodies import lame, on_ends, rolled, solve, space_of, turn
from reference_scenes import needs_fenicsx, polyline, square

from verify.solvers import find_solver

pytestmark = needs_fenicsx


@pytest.mark.parametrize(
    ("d", "degree", "poisson", "energy"),
    [
        (2, 1, 0.3, "corotated"),
        (3, 1, 0.3, "corotated"),
        (3, 2, 0.3, "corotated"),
        (2, 2, 0.49, "corotated_mixed"),
        (3, 2, 0.49, "corotated_mixed"),
    ],
)
def test_halves_turned_each_by_its_own_rotation_are_stretched_exactly(d, degree, poisson, energy):
    """Sides are free: 2μ (a − 1) + λ tr (U − I) = 0 for the stretch a across the pull."""
    line, plane = [(0.5, -1), (0.5, 2)], [(0.5, -1, -1), (0.5, 2, -1), (0.5, 2, 2), (0.5, -1, 2)]
    space = space_of(degree, (8, 8) if d == 2 else (2, 2, 2), cuts=[line if d == 2 else plane])
    points, (lam, mu) = space.node_points, lame(poisson)
    left = np.zeros(len(points), dtype=bool)
    left[space.cell_nodes[space.centroids[:, 0] < 0.5]] = True

    def strains(factor):
        across = -lam * 0.5 * factor / (2 * mu + (d - 1) * lam)
        return np.array([across, 0.5 * factor, across][:d])

    def field(factor):
        stretched = points * (1 + strains(factor))
        one, two = (stretched @ turn(d, angle * factor).T - points for angle in (1.2, -1.9))
        return np.where(left[:, None], one, two)

    found = solve(space, on_ends(space), field, poisson, energy=energy)
    stored = mu * np.sum(strains(1.0) ** 2) + lam / 2 * np.sum(strains(1.0)) ** 2
    assert found.strain_energy == pytest.approx(stored, rel=1e-9)
    assert found.displacement == pytest.approx(field(1.0), abs=1e-9)


@pytest.mark.parametrize("degree, order", [(1, 2.0), (2, 4.0)])
def test_bending_converges_with_twice_the_degree(degree, order):
    errors = []
    for n in (2, 4):
        rows = n * (3 - degree)
        space = space_of(degree, (rows, 10 * rows), (-0.05, 0.0), (0.05, 1.0))
        found = solve(
            space, on_ends(space), lambda f, x=space.node_points: rolled(x, f * np.pi, 0.1)
        )
        errors.append(found.strain_energy / 4.4748894293e-4 - 1)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


def test_a_split_strip_peels_into_opposite_half_circles():
    space = space_of(2, (16, 160), (-0.05, 0.0), (0.05, 1.0), [[[0.0, -0.1], [0.0, 1.1]]])
    points = space.node_points
    right = np.zeros(len(points), dtype=bool)
    right[space.cell_nodes[space.centroids[:, 0] > 0]] = True
    mirror = np.where(right, 1.0, -1.0)[:, None] * [1.0, 0.0] + [0.0, 1.0]

    def field(factor):
        own = points * mirror - [0.025, 0.0]  # both halves as the right one, about its middle
        return rolled(own, -factor * np.pi, 0.05) * mirror

    found = solve(space, on_ends(space), field)
    assert found.strain_energy == pytest.approx(1.12698177e-4, rel=1e-6)


def test_small_loads_give_the_linear_answer():
    cut = polyline("cut", (-0.1, 0.5), (0.5, 0.5))
    opening = [{"kind": "opening", "name": "mouth", "at": 0.2}]
    held = [{"where": "bottom", "displacement": [0, 0]}]
    load = [{"kind": "traction", "where": "top", "traction": [0, 1e-6]}]
    arguments = {"supports": held, "loads": load, "quantities": opening}
    linear = square([cut], **arguments)
    finite = square([cut], analysis={"kinematics": "corotational"}, **arguments)
    one, two = (
        find_solver("conforming").solve(scene, 0, repetitions=0) for scene in (linear, finite)
    )
    # the difference is of second order in strains of 1e-6, some ten times larger at the tip
    scale = np.abs(one.displacement).max()
    assert np.abs(two.displacement - one.displacement).max() < 1e-4 * scale
    assert two.ledger["strain"][0] == pytest.approx(one.ledger["strain"][0], rel=1e-4)
    assert two.iterations["newton"] >= 1


def test_what_turns_inside_out_at_a_tip_is_measured_and_stays_a_point():
    # the corotated energy has no barrier: strains like r^-1/2 invert the cells next to a tip
    cut = polyline("cut", (-0.1, 0.5), (0.5, 0.5))
    scene = square(
        [cut],
        supports=[{"where": "top", "displacement": [0, 0]}],
        loads=[{"kind": "gravity", "acceleration": [0, -0.3]}],
        analysis={"kinematics": "corotational"},
        quantities=[{"kind": "opening", "name": "mouth", "at": 0.2}],
    )
    one, two = (find_solver("reference").solve(scene, level, repetitions=0) for level in (0, 1))
    for field in (one, two):
        assert float(field.notes["smallest det F"]) < 0 < float(field.notes["area inside out"])
        assert float(field.notes["area inside out"]) < 1e-4
    # and the solution converges all the same
    assert two.ledger["strain"][0] == pytest.approx(one.ledger["strain"][0], rel=1e-4)


def test_a_load_beyond_any_equilibrium_says_how_far_it_came_and_why():
    space = space_of(1, (4, 4))
    with pytest.raises(RuntimeError, match=r"no equilibrium beyond load factor 0\.\d+: at 0\.\d+"):
        # pressed to nothing and through itself
        solve(space, on_ends(space), lambda f: -1.5 * f * space.node_points * [0, 1])
