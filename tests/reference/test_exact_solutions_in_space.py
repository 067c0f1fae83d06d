"""Exact solutions in space: held to the equations they claim to solve, then to known energies."""

import numpy as np
import pytest
from fourth_order import check_equations

from reference.exact import ExactSolution, exact_solution, exact_solution_names
from verify.scene import Material

SOLID = Material(young=1.0, poisson=0.3)
CUBE = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
INCLINED = {"point": [0.5, 0.5, 0.5], "normal": [-1.0, -2.0, 3.0], "axis": [2.0, -1.0, 0.0]}
NORMAL = np.array([-1.0, -2.0, 3.0]) / np.sqrt(14)
REMOTE = [[0.2, 0.1, 0.3], [0.1, -0.4, 0.5], [0.3, 0.5, 0.7]]

SOLUTIONS = {
    "solid_patch": {
        **INCLINED,
        "strain": [[0.1, -0.03], [-0.05, 0.02]],
        "shift": [[0, 0, 0], [0, 0, -0.02]],
    },
    "solid_smooth": {
        **INCLINED,
        "above": [[0.1, 2.0, 1.0, 20.0], [0.05, -1.0, 3.0, 0.0], [0.04, 3.0, 1.5, 90.0]],
        "below": [[-0.1, 1.0, 2.5, 0.0], [0.08, 2.0, 0.5, 40.0], [0.05, 1.0, -2.0, 10.0]],
    },
    "spherical_cut": {"centre": [0.1, 0.2, -0.1], "radius": 0.4, "outward": 0.1, "at": 1.0},
    "penny": {"centre": [0.4, 0.5, 0.45], "normal": [1.0, 2.0, 2.0], "a": 0.3, "tension": 1.5},
    "straight_front": {**INCLINED, "intensity": [1.0, 0.5, -0.7]},
    "penny, sheared": {
        "centre": [0.4, 0.5, 0.45],
        "normal": [1.0, 2.0, 2.0],
        "a": 0.3,
        "stress": REMOTE,
        "pressure": 0.4,
    },
}
AHEAD = np.array([2.0, -1.0, 0.0]) / np.sqrt(5)
POINTS = np.random.default_rng(5).uniform(-0.2, 1.2, (80, 3))


def solution(name, material=SOLID):
    return exact_solution(name.split(",")[0], SOLUTIONS[name], material)


def test_every_solution_in_space_is_checked_here():
    # one that moves is in test_blade_strip.py
    named = {n for n, t in exact_solution_names().items() if t.startswith("3D:")}
    assert set(SOLUTIONS) - {"penny, sheared"} == named


@pytest.mark.parametrize("poisson", [0.0, 0.49])
@pytest.mark.parametrize("name", SOLUTIONS)
def test_the_gradient_is_the_derivative_and_the_stress_is_in_equilibrium(name, poisson):
    check_equations(solution(name, Material(young=1.0, poisson=poisson)), POINTS)


@pytest.mark.parametrize("name", ["solid_patch", "solid_smooth", "straight_front"])
def test_faces_of_a_plane_cut_are_free_of_traction(name):
    """Behind a straight front; elsewhere the cut goes on ahead too."""
    u, face = solution(name), POINTS - ((POINTS - 0.5) @ NORMAL)[:, None] * NORMAL
    face -= (0.1 + np.abs((face - 0.5) @ AHEAD) + (face - 0.5) @ AHEAD)[:, None] * AHEAD
    for sign in (1, -1):
        traction = u.stress(face, face + sign * 0.01 * NORMAL) @ NORMAL
        assert np.abs(traction).max() < 1e-14 * (1 + np.abs(u.stress(face)).max())


def test_the_stress_ahead_of_a_straight_front_has_its_three_intensities():
    """Ahead √(2πr) times the traction is K_I, K_II, K_III; the jump behind likewise."""
    u, ahead, r = solution("straight_front"), AHEAD, 0.07
    axes = np.stack([NORMAL, ahead, np.cross(ahead, NORMAL)])
    traction = u.stress(np.array([[0.5] * 3]) + r * ahead)[0] @ NORMAL
    assert axes @ traction * np.sqrt(2 * np.pi * r) == pytest.approx(u.stress_intensity, rel=1e-12)
    behind = np.array([[0.5] * 3]) - r * ahead
    jump = u.displacement(behind, behind + 0.01 * NORMAL) - u.displacement(
        behind, behind - 0.01 * NORMAL
    )
    plane, shear = 1.0 / (1 - 0.3**2), 1.0 / 2.6
    factors = np.array([8 / plane, 8 / plane, 4 / shear]) * np.sqrt(r / (2 * np.pi))
    assert axes @ jump[0] == pytest.approx(factors * np.array(u.stress_intensity), rel=1e-12)


def penny_ring(radius):
    """Points on a circle in the plane of the penny of SOLUTIONS, and its normal."""
    turn = np.linspace(0.0, 6.0, 7)
    normal = np.array([1.0, 2.0, 2.0]) / 3
    one, two = np.array([2.0, -2.0, 1.0]) / 3, np.array([2.0, 1.0, -2.0]) / 3
    ring = radius * (np.outer(np.cos(turn), one) + np.outer(np.sin(turn), two))
    return np.array([0.4, 0.5, 0.45]) + ring, normal


def test_a_penny_opens_by_its_ellipsoid_and_far_away_there_is_tension_only():
    u = solution("penny")
    for radius in (0.0, 0.17, 0.2999):
        face, normal = penny_ring(radius)
        jump = u.displacement(face, face + normal) - u.displacement(face, face - normal)
        opening = 8 * (1 - 0.3**2) * 1.5 / np.pi * np.sqrt(0.3**2 - radius**2)
        assert jump == pytest.approx(opening * np.tile(normal, (len(jump), 1)), abs=1e-12)
    far, normal = penny_ring(300.0)
    # the crack's own stress decays like (a/r)³
    assert u.stress(far) == pytest.approx(
        np.tile(1.5 * np.outer(normal, normal), (len(far), 1, 1)), abs=1e-8
    )


def test_the_field_ahead_of_a_penny_has_its_stress_intensity():
    u = solution("penny")
    assert u.stress_intensity == pytest.approx(2 * 1.5 * np.sqrt(0.3 / np.pi))
    ahead, normal = penny_ring(0.3 + 1e-8)
    across = np.einsum("nij,i,j->n", u.stress(ahead), normal, normal)
    # the next term is √(r/a) smaller: 2e-4
    assert across * np.sqrt(2 * np.pi * 1e-8) == pytest.approx(u.stress_intensity, rel=1e-3)


def test_round_off_across_the_faces_does_not_change_the_side():
    u = solution("penny")
    face, normal = penny_ring(0.2)
    for side in (1.0, -1.0):
        on = u.displacement(face + 1e-16 * normal, face + side * 1e-2 * normal)
        off = u.displacement(face - 1e-16 * normal, face + side * 1e-2 * normal)
        inside = u.displacement(face + side * 1e-10 * normal)
        assert on == pytest.approx(inside, abs=1e-8)
        assert off == pytest.approx(inside, abs=1e-8)


def test_known_energies_in_cubes():
    patch = exact_solution("solid_patch", SOLUTIONS["solid_patch"], SOLID)
    assert patch.strain_energy(CUBE) == pytest.approx(3.131868132e-3, rel=1e-9)
    penny = exact_solution("penny", {"a": 1.0, "tension": 1.0}, SOLID)
    assert penny.strain_energy(4 * CUBE - 2) == pytest.approx(32.244473884, rel=3e-11)


@pytest.mark.parametrize("centre", [[-0.06, -0.03, -0.04], [0.5, 1.1, 0.2]])
def test_the_energy_around_a_ball_is_the_integral_of_its_density(centre):
    # a centre beyond a corner and one beyond a face
    u = exact_solution(
        "spherical_cut", {"centre": centre, "radius": 0.4, "outward": 0.1, "at": 1.0}, SOLID
    )
    points = (np.arange(50) + 0.5) / 50
    grid = np.stack(np.meshgrid(points, points, points, indexing="ij"), axis=-1).reshape(-1, 3)
    gradient = u.gradient(grid)
    density = 0.5 * np.einsum("nij,nij->n", u.stress(grid), gradient)
    # midpoints of 50³ cells: the 4 % of them on the sphere, where the density is highest, count
    # whole or not at all
    assert u.strain_energy(CUBE) == pytest.approx(density.mean(), rel=5e-3)


def test_the_energy_around_a_ball_inside_the_body_is_the_work_on_its_surface():
    u = exact_solution(
        "spherical_cut",
        {"centre": [0.45, 0.5, 0.55], "radius": 0.3, "outward": 0.1, "at": 1.0},
        SOLID,
    )
    assert u.strain_energy(CUBE) == pytest.approx(ExactSolution.strain_energy(u, CUBE), rel=1e-11)


@pytest.mark.parametrize("poisson", [0.3, 0.0, 0.49])
def test_a_ball_that_is_cut_out_leaves_a_hollow_free_of_traction(poisson):
    u = solution("spherical_cut", Material(young=1.0, poisson=poisson))
    outward = np.random.default_rng(2).normal(size=(40, 3))
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    centre = np.array(SOLUTIONS["spherical_cut"]["centre"])
    points = centre + 0.4 * outward
    traction = np.einsum("nij,nj->ni", u.stress(points, points + 1e-6 * outward), outward)
    scale = np.abs(u.stress(points, points + 1e-6 * outward)).max()
    assert np.abs(traction).max() < 1e-13 * scale
    np.testing.assert_allclose(u.displacement(centre + outward), 0.1 * outward, atol=1e-14)
    assert not u.displacement(points, points - 1e-6 * outward).any()


def test_the_faces_of_a_penny_bear_its_pressure_alone():
    for name, pressure in (("penny", 0.0), ("penny, sheared", 0.4)):
        u = solution(name)
        for radius in (0.0, 0.1, 0.29):
            face, normal = penny_ring(radius)
            for side in (1.0, -1.0):
                bears = u.stress(face, face + side * normal) @ normal
                assert bears == pytest.approx(np.tile(-pressure * normal, (7, 1)), abs=1e-12)
    far, _ = penny_ring(300.0)
    assert u.stress(far) == pytest.approx(np.tile(REMOTE, (len(far), 1, 1)), abs=1e-8)


def test_the_slip_behind_the_front_of_a_sheared_penny_is_that_of_its_intensities():
    """4(1−ν)K√(r/2π)/μ across in I and II, 4K√(r/2π)/μ in III; the next term is r/a smaller."""
    given = SOLUTIONS["penny, sheared"] | {"pressure": 0.0}
    u, behind = exact_solution("penny", given, SOLID), 1e-7
    front, normal = penny_ring(0.3)
    face, _ = penny_ring(0.3 - behind)
    jump = u.displacement(face, face + normal) - u.displacement(face, face - normal)
    root = 4 * np.sqrt(behind / (2 * np.pi)) * 2.6
    centre = np.array([0.4, 0.5, 0.45])
    for place, slip in zip(front, jump, strict=True):
        ahead = (place - centre) / 0.3
        k_1, k_2, k_3 = u.intensity_at(place)
        seen = slip @ np.stack([normal, ahead, np.cross(ahead, normal)]).T
        assert seen == pytest.approx(root * np.array([0.7 * k_1, 0.7 * k_2, k_3]), rel=1e-5)
    # M. K. Kassir and G. C. Sih: K_II = 4T√(a/π)/(2−ν) where the shear points ahead
    vector = np.array(REMOTE) @ normal
    shear = np.linalg.norm(vector - (vector @ normal) * normal)
    ahead = (vector - (vector @ normal) * normal) / shear
    largest = u.intensity_at(centre + 0.3 * ahead)
    assert largest[1] == pytest.approx(4 * shear * np.sqrt(0.3 / np.pi) / 1.7)
    assert largest[2] == pytest.approx(0.0, abs=1e-12)


def test_the_energy_of_a_penny_under_pressure_is_half_the_pressure_times_the_volume():
    """Far from the walls of a large box all work is done in the crack: p V / 2."""
    given = {"a": 1.0, "tension": 0.0, "pressure": 2.0}
    u = exact_solution("penny", given, SOLID)
    volume = 16 * 0.91 * 2.0 / 3
    assert u.strain_energy(np.array([[-60.0] * 3, [60.0] * 3])) == pytest.approx(volume, rel=1e-4)
