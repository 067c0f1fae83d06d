"""Parts of a cut body that supports turn, by the reference: no silent false equilibrium."""

import numpy as np
import pytest
from large_bodies import forces_of
from reference_scenes import needs_fenicsx, polyline, square

from reference.boundary_conditions import best_rotation
from reference.large_strain import solve_large_strain
from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from reference.space import conforming_space
from verify.scene import Material
from verify.solvers import find_solver

pytestmark = needs_fenicsx

YOUNG = 3e4
LEAST = 1e-9 * YOUNG  # E L^2 of a unit square; round-off and the tolerance of forces are far below


def turned(seed, degrees):
    """A unit square with a random cut on an unstructured mesh, its upper part turned and moved."""
    random = np.random.default_rng(seed)
    x = [-0.1, *np.sort(random.uniform(0.15, 0.85, 2)), 1.1]
    cut = polyline("cut", *np.column_stack([x, random.uniform(0.4, 0.65, 4)]).tolist())
    return square(
        [cut],
        mesh={"pattern": "unstructured", "sizes": [0.2]},
        material={"young": YOUNG, "poisson": 0.42, "plane": "strain"},
        analysis={"kinematics": "finite_rotation"},
        supports=[
            {"where": "y < 0.3", "displacement": [0.0, 0.0]},
            {"where": "y > 0.75", "displacement": [0.2, 0.15],
             "rotation": {"angle": degrees, "centre": [0.6, 0.5]}},
        ],
        loads=[],
        reference={"size": 0.3},
    )  # fmt: skip


@pytest.mark.parametrize("degrees", [105.0, 180.0, 260.0])
def test_a_part_that_is_turned_rigidly_stores_nothing(degrees) -> None:
    """At 260° one mesh had 43 J, in nine steps of the linear response."""
    for solver in ("conforming", "reference"):
        found = find_solver(solver).solve(turned(int(degrees), degrees), 0, repetitions=0)
        assert found.notes["stability"] == "tangent positive definite"
        assert found.ledger["strain"][0] < LEAST


def solve(points, cells, fixed, prescribed, load=None, first_step=0.25):
    """Equilibrium of an uncut body of linear triangles, supports at chosen nodes."""
    space = conforming_space(open_cut(*imprint(points, cells, [])), 1)
    nodes = np.flatnonzero(fixed(space.node_points))
    unknowns = (2 * nodes[:, None] + [0, 1]).ravel().astype(np.int32)

    def path(factor):
        return prescribed(space.node_points[nodes], factor).ravel()

    material = Material(young=YOUNG, poisson=0.3, plane="strain")
    forces = None if load is None else forces_of(space, load)
    return solve_large_strain(material, space, unknowns, path, forces, first_step=first_step)


def test_ends_of_a_strip_that_turn_against_one_another_are_followed_the_way_they_turn() -> None:
    """Bent to three quarters of a circle, and not to the quarter the other way with less energy."""
    mesh = structured_triangles((0.0, 0.0), (1.0, 0.1), (30, 3))

    def path(points, factor):
        # the right end moves on the circle that the strip becomes, so that it bends evenly
        angle = factor * 1.5 * np.pi
        c, s = np.cos(angle), np.sin(angle)
        right = points[:, :1] > 0.5
        reach = np.array([np.sinc(angle / np.pi), (1 - c) / angle if angle else 0.0])
        moved = reach + (points - [1.0, 0.05]) @ np.array([[c, s], [-s, c]]) + [0.0, 0.05]
        return np.where(right, moved - points, 0.0)

    def ends(points):
        return (points[:, 0] == 0.0) | (points[:, 0] == 1.0)

    quickly = solve(*mesh, ends, path)
    slowly = solve(*mesh, ends, path, first_step=0.06)
    assert quickly.negative_modes == 0
    assert quickly.strain_energy == pytest.approx(slowly.strain_energy, rel=1e-8)


def test_an_unstable_column_is_refused_with_its_energy() -> None:
    """Three times its critical weight, nothing across: both paths stay straight."""

    def push(v):
        import ufl

        # along the column 7.84 E I / L² in all is critical (Timoshenko & Gere, Theory of Elastic
        # Stability, 2.12); linear triangles in two rows are up to two times as stiff in bending
        weight = 3 * 7.84 * YOUNG / (1 - 0.3**2) * 0.1**3 / 12
        force = ufl.as_vector([-weight / 0.1, 0.0])
        return ufl.inner(force, v) * ufl.dx

    points, cells = structured_triangles((0.0, -0.05), (1.0, 0.05), (20, 2))
    # symmetric about y = 0, so that nothing pushes it across
    cells = np.concatenate([cells[points[cells][:, :, 1].mean(axis=1) > 0]] * 2)
    half = len(cells) // 2
    mirrored = np.array([[x, -y] for x, y in points])
    place = {tuple(np.round(p, 9)): i for i, p in enumerate(points)}
    image = np.array([place[tuple(np.round(p, 9) + 0.0)] for p in mirrored])
    cells[half:] = image[cells[half:]][:, [0, 2, 1]]
    with pytest.raises(RuntimeError, match=r"unstable equilibrium, of \S+ J and \S+ J"):
        solve(points, cells, lambda p: p[:, 0] == 0.0, lambda p, f: 0.0 * p, push)


@pytest.mark.parametrize("degrees", [1e-6, 179.999, 180.0, 300.0])
def test_the_best_rotation_is_the_one_that_was_made(degrees) -> None:
    random = np.random.default_rng(4)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    plane = np.array([[c, -s], [s, c]])
    n = np.array([0.3, -0.5, 0.8]) / np.sqrt(0.98)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    for rotation in (plane, np.eye(3) + s * K + (1 - c) * K @ K):
        points = random.normal(size=(7, len(rotation)))
        points -= points.mean(axis=0)
        assert best_rotation(points, points @ rotation.T) == pytest.approx(rotation, abs=1e-11)


@pytest.mark.parametrize("d", [2, 3])
def test_a_piece_that_is_held_at_one_node_alone_is_not_turned(d) -> None:
    """Its node is its own centre: nothing says by which rotation it went."""
    assert best_rotation(np.zeros((1, d)), np.zeros((1, d))) == pytest.approx(np.eye(d))
