"""Finite rotation and strain: patches, bending to half circles, loads that follow no rotation."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline, square

from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from verify.scene import Material

pytestmark = needs_fenicsx

STRAIN = Material(young=1.0, poisson=0.3, plane="strain")
LAM, MU = 0.3 / (1.3 * 0.4), 1 / 2.6


def body(degree, counts, lower=(0.0, 0.0), upper=(1.0, 1.0), cuts=()):
    from reference.space import conforming_space

    points, cells = structured_triangles(lower, upper, counts)
    mesh = open_cut(*imprint(points, cells, [np.array(cut) for cut in cuts]))
    return conforming_space(mesh, degree)


def solve(space, nodes, prescribed, **parameters):
    from reference.large_strain import solve_large_strain

    unknowns = (2 * nodes[:, None] + [0, 1]).ravel().astype(np.int32)
    return solve_large_strain(
        STRAIN, space, unknowns, lambda factor: prescribed(factor).ravel(), **parameters
    )


def ends(space, length=1.0):
    y = space.node_points[:, 1]
    return np.flatnonzero((y < 1e-12) | (y > length - 1e-12))


def turned_and_stretched(points, turn, stretch):
    """Displacement of a uniform stretch in y with free sides, then a rotation by `turn`."""
    across = (2 * (LAM + MU) - LAM * stretch) / (LAM + 2 * MU)
    c, s = np.cos(turn), np.sin(turn)
    return points @ (np.array([[c, -s], [s, c]]) @ np.diag([across, stretch])).T - points


def test_halves_turned_each_by_its_own_rotation_are_stretched_exactly():
    # a patch test at large strain: W per volume 0.137362637 at stretch 1.5, free sides
    space = body(1, (8, 8), cuts=[[[0.5, -0.1], [0.5, 1.1]]])
    nodes, points = ends(space), space.node_points
    left = np.zeros(len(points), dtype=bool)
    left[space.cell_nodes[space.centroids[:, 0] < 0.5]] = True

    def field(factor):
        one = turned_and_stretched(points, 1.2 * factor, 1 + 0.5 * factor)
        two = turned_and_stretched(points, -0.7 * factor, 1 + 0.5 * factor)
        return np.where(left[:, None], one, two)

    found = solve(space, nodes, lambda factor: field(factor)[nodes])
    assert found.strain_energy == pytest.approx(0.137362637, rel=1e-8)
    assert found.displacement == pytest.approx(field(1.0), abs=1e-10)


def rolled(points, curvature, height):
    """Displacement of a strip |X| < height/2 bent to a curvature, sides free of traction."""
    if curvature == 0.0:
        return np.zeros_like(points)
    X, Y = points.T
    b = 2 * (LAM + MU) / (LAM + 2 * MU)
    D = 2 * (LAM + MU) - LAM * b
    B = D * (LAM + 2 * MU) / ((LAM + 2 * MU) ** 2 - LAM**2)
    B /= curvature * np.cosh(curvature * height / 2)
    A = -LAM * B / (LAM + 2 * MU)
    r = A * np.cosh(curvature * X) + B * np.sinh(curvature * X) + b / curvature
    middle = A + b / curvature
    return np.column_stack([r * np.cos(curvature * Y) - middle - X, r * np.sin(curvature * Y) - Y])


@pytest.mark.parametrize("degree, order", [(1, 2.0), (2, 4.0)])
def test_bending_converges_with_twice_the_degree(degree, order):
    errors = []
    for n in (2, 4):
        space = body(degree, (n * (3 - degree), 10 * n * (3 - degree)), (-0.05, 0.0), (0.05, 1.0))
        nodes = ends(space)
        found = solve(
            space, nodes, lambda f, s=space, k=nodes: rolled(s.node_points[k], f * np.pi, 0.1)
        )
        errors.append(found.strain_energy / 4.4748894293e-4 - 1)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


def test_a_split_strip_peels_into_opposite_half_circles():
    space = body(2, (16, 160), (-0.05, 0.0), (0.05, 1.0), [[[0.0, -0.1], [0.0, 1.1]]])
    nodes, points = ends(space), space.node_points
    right = np.zeros(len(points), dtype=bool)
    right[space.cell_nodes[space.centroids[:, 0] > 0]] = True
    mirror = np.where(right, 1.0, -1.0)[:, None] * [1.0, 0.0] + [0.0, 1.0]

    def field(factor):
        own = points * mirror - [0.025, 0.0]  # both halves as the right one, about its middle
        return rolled(own, -factor * np.pi, 0.05) * mirror

    found = solve(space, nodes, lambda factor: field(factor)[nodes])
    assert found.strain_energy == pytest.approx(1.12698177e-4, rel=1e-6)


def test_small_loads_give_the_linear_answer():
    from verify.solvers import find_solver

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
    from verify.solvers import find_solver

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
    space = body(1, (4, 4))
    nodes = ends(space)
    with pytest.raises(RuntimeError, match=r"no equilibrium beyond load factor 0\.\d+: at 0\.\d+"):
        # pressed to nothing and through itself
        solve(space, nodes, lambda f: -1.5 * f * space.node_points[nodes] * [0, 1])
