"""Exact solutions are held to the equations they claim to solve, then to known energies."""

import numpy as np
import pytest
from fourth_order import check_equations
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.exact import exact_solution, exact_solution_names
from reference.exact.solution import hooke
from verify.scene import Material

STRAIN = Material(young=1.0, poisson=0.3, plane="strain")
STRESS = Material(young=1.0, poisson=0.3, plane="stress")
SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
BOX = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
INCLINED = {"point": [0.5, 0.5], "slope": 1 / 3}
AT_ZERO = {"a": 1.0, "centre": [0, 0], "angle": 0.0}
BOTH = pytest.mark.parametrize("material", [STRAIN, STRESS], ids=["strain", "stress"])

SOLUTIONS = {
    "linear": {"matrix": [[0.1, 0.2], [-0.3, 0.4]], "shift": [1.0, 2.0]},
    "patch": {**INCLINED, "strain": [0.1, -0.05], "shift": [0.0, -0.02]},
    "bending": {**INCLINED, "stress_gradient": [1.0, -0.5], "shift": [0.02, 0.0]},
    "airy": {**INCLINED, "above": [0.1, 0.2, 2.0], "below": [-0.2, 0.1, 3.0]},
    "smooth": {
        **INCLINED,
        "above": [[0.1, np.pi, 0.0], [0.05, np.pi, 90.0]],
        "below": [[-0.05, 2 * np.pi, 0.0], [-0.05, 2 * np.pi, 90.0]],
    },
    "tip": {"tip": [0.1, 0.2], "angle": 20.0, "intensity": [1.0, 0.7]},
    "griffith": {"a": 0.4, "centre": [0.1, 0.2], "angle": 20.0, "stress": [0.3, 1.0, 0.5]},
    "closed_crack": {"a": 0.4, "centre": [0.1, 0.2], "angle": 20.0, "stress": [0.3, -1.0, 0.5]},
    "partly_closed_crack": {"a": 0.4, "centre": [0.1, 0.2], "angle": 20.0, "slope": 2.0},
    "arc_crack": {
        "centre": [0.1, 0.2],
        "radius": 0.5,
        "angle": 35.0,
        "half_angle": 50.0,
        "stress": [0.3, 1.0, 0.4],
    },
    "circular_cut": {"centre": [0.1, 0.2], "radius": 0.4, "outward": 0.1, "at": 1.0},
}


def solution(name, material=STRAIN):
    return exact_solution(name, SOLUTIONS[name], material)


def test_every_named_solution_is_checked_here():
    others = ("3D", "finite rotation", "contact, moving")  # in files of their own
    plane = {name for name, text in exact_solution_names().items() if not text.startswith(others)}
    elsewhere = {"layers", "released_bar"}  # test_layered_bodies, test_blade_strip: it moves
    assert set(SOLUTIONS) == plane - elsewhere


@pytest.mark.parametrize(
    "plane, strains",
    [("strain", [1 - 0.3**2, -0.3 * 1.3]), ("stress", [1, -0.3]), (None, [1, -0.3, -0.3])],
)
def test_a_bar_that_is_pulled_in_any_direction_contracts_by_poissons_ratio(plane, strains):
    """Unit tension along one axis: ε = 1/E and −ν/E, in plane strain (1−ν²)/E and −ν(1+ν)/E."""
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(len(strains),) * 2))[0]
    law = hooke(Material(young=2.0, poisson=0.3, plane=plane))
    gradient = turn @ np.diag(strains) @ turn.T / 2.0
    assert law.stress(gradient) == pytest.approx(np.outer(turn[:, 0], turn[:, 0]), abs=1e-14)


@BOTH
@pytest.mark.parametrize("name", SOLUTIONS)
def test_the_gradient_is_the_derivative_and_the_stress_is_in_equilibrium(name, material):
    points = np.random.default_rng(3).uniform(-0.95, 0.95, (60, 2))
    check_equations(solution(name, material), points)


# a point and the angle of each straight cut, and the part of it that is open
FACES = dict.fromkeys(["patch", "bending", "airy", "smooth"], ([0.5, 0.5], np.arctan(1 / 3), 0.5))
FACES |= dict.fromkeys(["tip", "griffith"], ([0.1, 0.2], np.deg2rad(20.0), -0.02))


def axes(angle):
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


@BOTH
@pytest.mark.parametrize("name", FACES)
def test_faces_of_a_straight_cut_are_free_of_traction(name, material):
    u, (origin, angle, end) = solution(name, material), FACES[name]
    along, normal = axes(angle)
    face = origin + np.linspace(-0.38, end, 11)[:, None] * along
    for sign in (1, -1):
        traction = u.stress(face, face + sign * 1e-3 * normal) @ normal
        assert np.abs(traction).max() < 1e-12


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(["patch", "airy", "griffith", "tip"]),
    x=st.floats(-0.3, -0.02),
    off=st.floats(-1e-14, 1e-14),
    side=st.sampled_from([1.0, -1.0]),
)
def test_a_point_off_the_cut_by_round_off_is_on_the_side_of_its_near_point(name, x, off, side):
    u, (origin, angle, _) = solution(name), FACES[name]
    along, normal = axes(angle)
    point = (origin + x * along + off * normal)[None]
    near, inside = point + side * 0.05 * normal, point + side * 1e-9 * normal
    assert u.displacement(point, near) == pytest.approx(u.displacement(inside, near), abs=1e-7)
    assert u.gradient(point, near) == pytest.approx(u.gradient(inside, near), rel=1e-4, abs=1e-6)


def test_faces_of_an_arc_crack_are_free_of_traction_and_the_plate_is_loaded_far_away():
    u, turn = solution("arc_crack"), np.deg2rad(35.0 + np.linspace(-49.5, 49.5, 41))
    normal = np.column_stack([np.cos(turn), np.sin(turn)])
    for side in (0.99, 1.01):  # of 0.5, the radius
        stress = u.stress([0.1, 0.2] + 0.5 * normal, np.array([0.1, 0.2]) + 0.5 * side * normal)
        # of stresses of about 10 beside the tips
        assert np.abs(np.einsum("nij,nj->ni", stress, normal)).max() < 1e-12
    far = u.stress(np.array([[1e7, 3e6], [-2e6, -1e7]]))  # what the crack adds falls as r⁻²
    assert np.abs(far - [[0.3, 0.4], [0.4, 1.0]]).max() < 1e-12


def test_an_arc_crack_is_smooth_beside_its_faces_and_at_its_centre():
    u = solution("arc_crack")
    turn = np.deg2rad(35.0 + np.linspace(52.0, 308.0, 41))
    ring = 0.5 * np.column_stack([np.cos(turn), np.sin(turn)])
    inside, outside = (u.gradient([0.1, 0.2] + (1 + s) * ring) for s in (-1e-13, 1e-13))
    assert np.abs(inside - outside).max() < 1e-9
    # the closed form and the series meet at a fifth of the radius
    inside, outside = (u.displacement([0.1, 0.2] + 0.2 * s * ring) for s in (1 - 1e-12, 1 + 1e-12))
    assert np.abs(inside - outside).max() < 1e-11
    with np.errstate(all="raise"):
        assert np.isfinite(u.gradient(np.array([[0.1, 0.2], [0.1, 0.2 + 1e-9]]))).all()


def test_the_intensity_of_an_arc_crack_is_that_of_the_closed_form_and_of_its_field():
    given = {**SOLUTIONS["arc_crack"], "stress": [1.0, 1.0, 0.0]}
    u = exact_solution("arc_crack", given, STRAIN)
    known = np.sqrt(np.pi * 0.5 * np.sin(np.deg2rad(50.0))) / (1 + np.sin(np.deg2rad(25.0)) ** 2)
    for tip, sign in zip(u.singular_points, (-1, 1), strict=True):
        expected = known * np.cos(np.deg2rad(25)), sign * known * np.sin(np.deg2rad(25))
        assert u.intensity_at(tip) == pytest.approx(expected, rel=1e-13)
    u = solution("arc_crack")
    for tip, sign in zip(u.singular_points, (-1, 1), strict=True):
        turn = np.deg2rad(35.0 + sign * 50.0)
        ahead = sign * np.array([-np.sin(turn), np.cos(turn)])
        left = np.array([-ahead[1], ahead[0]])
        stress = u.stress((tip + 1e-8 * ahead)[None])[0] * np.sqrt(2e-8 * np.pi)
        # next to the tip the rest is √r of it
        expected = left @ stress @ left, ahead @ stress @ left
        assert u.intensity_at(tip) == pytest.approx(expected, abs=1e-6)


ENERGIES = [
    ("patch", {}, SQUARE, 3.434065934e-3, 1e-9),
    ("bending", {}, SQUARE, 0.02369791667, 2e-10),
    ("airy", {}, SQUARE, 2.7789417971, 1e-10),
    ("smooth", {}, SQUARE, 0.05589161925, 1e-10),
    ("tip", {"tip": [0, 0], "angle": 0.0, "intensity": [1, 0]}, BOX, 0.474129375227, 2e-12),
    ("tip", {"tip": [0, 0], "angle": 0.0, "intensity": [0, 1]}, BOX, 1.203559183268, 2e-12),
    ("griffith", {**AT_ZERO, "stress": [0, 1, 0]}, 2 * BOX, 8.07875793695, 1e-12),
    ("griffith", {**AT_ZERO, "stress": [0.5, 0.5, 0.5]}, 2 * BOX, 7.5081993035, 1e-12),
]


@pytest.mark.parametrize(("name", "changes", "outline", "value", "digits"), ENERGIES)
def test_strain_energies_are_the_known_ones(name, changes, outline, value, digits):
    u = exact_solution(name, SOLUTIONS[name] | changes, STRAIN)
    assert u.strain_energy(outline) == pytest.approx(value, rel=digits)


@pytest.mark.parametrize("name", ["smooth", "griffith", "arc_crack"])
def test_energies_of_parts_add_up_also_where_an_outline_is_not_convex(name):
    u = solution(name)
    corner = np.array([[0, 0], [1, 0], [1, 0.45], [0.4, 0.45], [0.4, 1], [0, 1.0]])
    rest = np.array([[0.4, 0.45], [1, 0.45], [1, 1], [0.4, 1.0]])
    parts = u.strain_energy(corner) + u.strain_energy(rest)
    assert parts == pytest.approx(u.strain_energy(SQUARE), rel=1e-11)


@BOTH
def test_a_body_drawn_off_a_disc_leaves_its_edge_free_and_the_known_gap(material):
    u = exact_solution("circular_cut", {"radius": 0.4, "outward": 0.1, "at": 1.0}, material)
    turn = np.linspace(0, 2 * np.pi, 17)
    normal = np.column_stack([np.cos(turn), np.sin(turn)])
    outside, inside = (u.displacement(0.4 * normal, s * normal) for s in (0.5, 0.3))
    assert np.abs(np.einsum("nij,nj->ni", u.stress(0.4 * normal, normal), normal)).max() < 1e-15
    assert np.sum(u.displacement(normal) * normal, axis=1) == pytest.approx(np.full(17, 0.1))
    assert np.abs(inside).max() == 0
    if material is STRAIN:
        assert np.sum(outside * normal, axis=1) == pytest.approx(np.full(17, 0.1), rel=1e-12)


def test_the_energy_of_a_ring_around_a_disc_is_the_known_one():
    u = exact_solution("circular_cut", {"radius": 0.4, "outward": 0.1, "at": 1.0}, STRAIN)

    def inscribed(n):
        turn = 2 * np.pi * np.arange(n) / n
        return u.strain_energy(np.column_stack([np.cos(turn), np.sin(turn)]))

    # polygons approach the circle like n⁻²
    one, two, four = (inscribed(n) for n in (64, 128, 256))
    better = (16 * (4 * four - two) / 3 - (4 * two - one) / 3) / 15
    assert better == pytest.approx(0.036249146003, rel=1e-9)
    # an outline that crosses the cut: the sum of parts
    halves = [u.strain_energy(np.array(c)) for c in (
        [[-0.6, -0.6], [0.1, -0.6], [0.1, 0.6], [-0.6, 0.6]],
        [[0.1, -0.6], [0.6, -0.6], [0.6, 0.6], [0.1, 0.6]],
    )]  # fmt: skip
    whole = u.strain_energy(np.array([[-0.6, -0.6], [0.6, -0.6], [0.6, 0.6], [-0.6, 0.6]]))
    assert sum(halves) == pytest.approx(whole, rel=1e-11)


def test_a_griffith_crack_opens_by_its_ellipse():
    u = exact_solution("griffith", {"a": 2.0, "stress": [0.0, 3.0, 0.0]}, STRAIN)
    x = np.linspace(-1.99, 1.99, 21)
    face = np.column_stack([x, np.zeros_like(x)])
    up = np.array([0.0, 1e-3])
    jump = u.displacement(face, face + up) - u.displacement(face, face - up)
    assert jump[:, 1] == pytest.approx(4 * 3.0 * (1 - 0.3**2) * np.sqrt(4 - x**2), rel=1e-12)
    assert np.abs(jump[:, 0]).max() < 1e-14


def test_the_field_next_to_a_griffith_tip_is_the_tip_field():
    crack = exact_solution("griffith", {"a": 1.0, "stress": [0.0, 1.0, 0.6]}, STRAIN)
    tip = exact_solution(
        "tip", {"tip": [1.0, 0.0], "intensity": list(crack.stress_intensity)}, STRAIN
    )
    angle = np.linspace(-3.1, 3.1, 13)
    ring = np.array([1.0, 0.0]) + 1e-6 * np.column_stack([np.cos(angle), np.sin(angle)])
    # the next term of the series is √r smaller: 1e-3
    scale = np.abs(tip.stress(ring)).max()
    assert np.abs(crack.stress(ring) - tip.stress(ring)).max() < 3e-3 * scale
