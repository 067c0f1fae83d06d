"""Finite rotation and strain: patches, bending to half circles, loads that follow no rotation."""

from functools import partial

import numpy as np
import pytest
import scenes
from large_bodies import forces_of, lame, on_ends, rolled, solve, space_of, turn
from reference_scenes import needs_fenicsx, polyline, square
from scipy.optimize import brentq
from scipy.special import ellipe, ellipeinc, ellipk, ellipkinc

from reference import large_strain
from reference.inside_out import singular_nodes
from verify.compare.simplices import share_inside_out
from verify.judge.convergence import field_uncertainty
from verify.solvers import find_solver

pytestmark = needs_fenicsx


@pytest.mark.parametrize(
    ("d", "degree", "poisson", "pressure"),
    [(2, 2, 0.49, True), (3, 1, 0.3, False), (3, 2, 0.3, False)],
)
def test_halves_turned_each_by_its_own_rotation_are_stretched_exactly(d, degree, poisson, pressure):
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

    found = solve(space, on_ends(space), field, poisson, pressure=pressure)
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
        assert float(field.notes["smallest det F"]) < 0
        assert 0 < share_inside_out(field) < 1e-4
    # and the solution converges all the same
    assert two.ledger["strain"][0] == pytest.approx(one.ledger["strain"][0], rel=1e-4)


def test_a_load_beyond_any_equilibrium_says_how_far_it_came_and_why():
    space = space_of(1, (4, 4))
    with pytest.raises(RuntimeError, match=r"no equilibrium beyond load factor 0\.\d+: at 0\.\d+"):
        # pressed to nothing and through itself
        solve(space, on_ends(space), lambda f: -1.5 * f * space.node_points * [0, 1])


def elastica(load):
    """Tip (x, y) of a cantilever of length 1 under the dead end load PL²/EI across it.

    From θ'² = 2 PL²/EI (sin θ₁ − sin θ), θ₁ the angle of the tip (Bisshopp and Drucker, Quart.
    Appl. Math. 3, 1945, 272), with m = (1 + sin θ₁)/2.
    """

    def parts(m):
        begin = np.arcsin(1 / np.sqrt(2 * m))
        return ellipk(m) - ellipkinc(begin, m), ellipe(m) - ellipeinc(begin, m)

    root = np.sqrt(load)
    m = brentq(lambda m: parts(m)[0] - root, 0.5 + 1e-15, 1 - 1e-15, xtol=1e-16)
    return np.array([np.sqrt(2 * (2 * m - 1) / load), 1 - 2 / root * parts(m)[1]])


def thin(load, slenderness, young=1.2e7):
    """A strip of length 10 m and ν = 0, clamped on the left, under PL²/EI at its right end."""
    height = 10.0 / slenderness
    return scenes.scene(
        [],
        geometry={"kind": "rectangle", "lower": [0.0, 0.0], "upper": [10.0, height]},
        mesh={"cells": [[slenderness, 2]]},
        material={"young": young, "poisson": 0.0, "plane": "stress"},
        analysis={"kinematics": "corotational"},
        supports=[{"where": "left", "displacement": [0.0, 0.0]}],
        loads=[
            {"kind": "traction", "where": "right",
             "traction": [0.0, load * young / slenderness**2 / 12]},
        ],
    )  # fmt: skip


def tip(load, slenderness, level):
    """Tip of that strip by the reference, over its length; the path must be short."""
    found = find_solver("reference").solve(thin(load, slenderness), level, repetitions=0)
    assert_few(found.iterations["load steps"], found.iterations["newton"])
    end = np.argmin(np.linalg.norm(found.points - [10.0, 5.0 / slenderness], axis=1))
    return (found.points[end] + found.displacement[0, end] - [0.0, 5.0 / slenderness]) / 10


def assert_few(steps, iterations):
    assert steps <= 40
    assert iterations <= 400


def test_the_tip_of_a_thin_strip_is_that_of_the_elastica_in_few_steps():
    """Shear and stretch add PL²/EI (h/L)² times a number of order one."""
    assert tip(10.0, 100, 0) == pytest.approx(elastica(10.0), abs=1e-3)


@pytest.mark.heavy
def test_a_thin_strip_tends_to_the_elastica_like_the_square_of_its_thickness():
    """Quarters to 5 %, which the next power may add; half-widths to a tenth of the difference."""
    away, load = [], 10.0
    for slenderness in (25, 50, 100):
        tips = np.array([tip(load, slenderness, level) for level in range(3)])
        away.append(tips[-1] - elastica(load))
        differences = np.linalg.norm(np.diff(tips, axis=0), axis=1).tolist()
        width = field_uncertainty(differences, [4.0, 2.0, 1.0], 2.0).half_width
        assert width <= 0.1 * np.linalg.norm(away[-1])
    assert away[0] / away[1] == pytest.approx([4.0, 4.0], rel=0.05)
    assert away[1] / away[2] == pytest.approx([4.0, 4.0], rel=0.05)


def end_load(force, length, v):
    """Dead load at the end x = length of a body."""
    import ufl

    x = ufl.SpatialCoordinate(ufl.domain.extract_unique_domain(v))
    at_end = ufl.conditional(ufl.gt(x[0], length * (1 - 1e-9)), 1.0, 0.0)
    return at_end * ufl.inner(ufl.as_vector(force), v) * ufl.ds


def slender_block():
    """A block of 1 × 0.03 × 0.03 under a dead load askew at its end, PL²/EI = 6, ν = 0."""
    space = space_of(2, (16, 1, 1), upper=(1.0, 0.03, 0.03))
    across = 6.0 * 0.03**2 / 12 * np.array([0.0, 0.8, 0.6])
    held = space.node_points[:, 0] < 1e-12
    still = np.zeros_like(space.node_points)
    load = forces_of(space, partial(end_load, across, 1.0))
    found = solve(space, held, lambda _: still, poisson=0.0, load=load)
    end = space.node_points[:, 0] > 1 - 1e-12
    return found, found.displacement[end].mean(axis=0)


def test_a_slender_block_turns_in_few_steps_along_its_load():
    """Its section has no axis of its own: the plane of the elastica is that of the load."""
    found, moved = slender_block()
    assert_few(found.steps, found.iterations)
    assert not found.nested  # linear elements lock: they end far from here
    plane = moved @ np.array([[1.0, 0.0], [0.0, 0.8], [0.0, 0.6]])
    assert moved @ [0.0, 0.6, -0.8] == pytest.approx(0.0, abs=1e-3)
    # shear and stretch: of the order of PL²/EI (h/L)², and the error of the coarse mesh
    assert plane == pytest.approx(elastica(6.0) - [1.0, 0.0], abs=6 * 0.03**2)
    assert found.method == "PETSc SNES, MUMPS Cholesky"


def test_the_record_names_the_iterative_solver_that_ran(monkeypatch):
    monkeypatch.setattr(large_strain, "_MOST_DIRECT", 0)
    space = space_of(1, (3, 3, 3))
    found = solve(space, on_ends(space), lambda f: 0.1 * f * space.node_points * [0, 1, 0])
    assert found.method == "PETSc SNES, GMRES with GAMG"


@pytest.mark.parametrize("d", [2, 3])
def test_a_path_of_linear_elements_leads_to_the_equilibrium_of_the_quadratic_ones(d, monkeypatch):
    """Of a block that is cut askew and bears its own weight, held on two of its sides."""
    import ufl

    line, plane = (
        [(-1, 0.3), (0.55, 0.62)],
        [(-1, 0.3, -1), (0.55, 0.62, -1), (0.55, 0.62, 2), (-1, 0.3, 2)],
    )
    space = space_of(2, (6, 6) if d == 2 else (2, 2, 2), cuts=[line if d == 2 else plane])
    weight = np.array([-0.02, -0.05, 0.03][:d])
    load = forces_of(space, lambda v: ufl.inner(ufl.as_vector(weight), v) * ufl.dx)

    def field(factor):
        return 0.2 * factor * space.node_points[:, ::-1] * space.node_points[:, :1]

    found = solve(space, on_ends(space), field, load=load)
    monkeypatch.setattr(large_strain, "_nested", lambda *_: None)
    whole = solve(space, on_ends(space), field, load=load)
    assert found.nested
    assert not whole.nested
    scale = np.abs(whole.displacement).max()
    assert found.displacement == pytest.approx(whole.displacement, abs=1e-9 * scale)
    assert found.strain_energy == pytest.approx(whole.strain_energy, rel=1e-10)
    assert 2 * found.iterations < whole.iterations


def test_a_body_turned_inside_out_away_from_singular_places_is_refused_with_the_place():
    """A traction of twice Young's modulus on a thirtieth of a smooth edge folds what is below."""
    scene = square(
        mesh={"cells": [[64, 8]]},
        material={"young": 1.0, "poisson": 0.3, "plane": "strain"},
        supports=[{"where": "bottom", "displacement": [0, 0]}],
        loads=[
            {"kind": "traction", "where": "y > 1 - 1e-9 and x > 0.4837 and x < 0.5173",
             "traction": [0.2, -2.0]},
        ],
        analysis={"kinematics": "corotational"},
        reference={"size": 0.2},
    )  # fmt: skip
    with pytest.raises(RuntimeError, match=r"det F is -\S+ at \(0\.5\d*, 0\.9\d*\), away"):
        find_solver("reference").solve(scene, 0, repetitions=0)


@pytest.mark.parametrize("d", [2, 3])
def test_singular_places_are_tips_and_ends_of_supports(d):
    """Of an edge cut, and of a support over half of a face, in the plane and in space."""
    line, plane = (
        [(-1, 0.5), (0.5, 0.5)],
        [(-1, 0.5, -1), (0.5, 0.5, -1), (0.5, 0.5, 2), (-1, 0.5, 2)],
    )
    space = space_of(1, (4,) * d, cuts=[line if d == 2 else plane])
    x, y = space.node_points.T[:2]
    held = np.repeat((y == 0.0) & (x <= 0.5), d)
    nodes = singular_nodes(space, np.flatnonzero(held).astype(np.int32))
    places = np.unique(space.node_points[nodes][:, :2], axis=0).tolist()
    # the support ends at the free faces beside it too: in space all along them
    beside = [[0.0, 0.0]] if d == 2 else [[0.0, 0.0], [0.25, 0.0]]
    assert places == [*beside, [0.5, 0.0], [0.5, 0.5]]
