"""Contact of the faces of cuts: exact fields by their residuals, the reference against them."""

import numpy as np
import pytest
from fourth_order import difference

from reference.exact import exact_solution
from verify.errors import InputError
from verify.scene import Material

STRAIN = Material(young=1.0, poisson=0.3, plane="strain")
BAR = Material(young=4.0, poisson=0.0, plane="strain", density=1.0)
ANGLE = 20.0
CLOSED = {"centre": [0.1, -0.2], "a": 0.6, "angle": ANGLE, "stress": [-0.3, -1.0, 0.4]}
PARTLY = {"centre": [0.1, -0.2], "a": 0.6, "angle": ANGLE, "slope": 2.0}
IMPACT = {"half_length": 0.5, "at": 0.2, "speed": 0.1, "gap": 0.01}
ALONG = np.array([np.cos(np.deg2rad(ANGLE)), np.sin(np.deg2rad(ANGLE))])
ACROSS = np.array([-ALONG[1], ALONG[0]])


def on_crack(shares):
    """Points at x = share a of the crack, and tiny steps to its positive side."""
    points = np.array(CLOSED["centre"]) + 0.6 * np.asarray(shares)[:, None] * ALONG
    return points, np.broadcast_to(1e-7 * ACROSS, points.shape)


def faces(field, shares):
    """Normal and shear traction above and below, and the jump, normal and along."""
    points, step = on_crack(shares)
    tractions = [field.stress(points, points + s * step) @ ACROSS for s in (1, -1)]
    jump = field.displacement(points, points + step) - field.displacement(points, points - step)
    return [(t @ ACROSS, t @ ALONG) for t in tractions], jump @ ACROSS, jump @ ALONG


def test_faces_of_a_closed_crack_press_with_the_remote_stress_and_slide_by_an_ellipse():
    field, shares = exact_solution("closed_crack", CLOSED, STRAIN), np.linspace(-0.95, 0.95, 9)
    remote = np.array([[-0.3, 0.4], [0.4, -1.0]])
    tractions, gap, slip = faces(field, shares)
    for normal, shear in tractions:
        np.testing.assert_allclose(normal, ACROSS @ remote @ ACROSS, rtol=1e-12)
        np.testing.assert_allclose(shear, 0.0, atol=1e-12)
    tau, modulus = ACROSS @ remote @ ALONG, 1.0 / (1 - 0.3**2)
    np.testing.assert_allclose(gap, 0.0, atol=1e-12)
    np.testing.assert_allclose(slip, 4 * tau * 0.6 / modulus * np.sqrt(1 - shares**2), rtol=1e-6)
    assert field.stress_intensity == pytest.approx((0.0, tau * np.sqrt(0.6 * np.pi)), rel=1e-12)
    far = np.array([[1e5, 2e4], [-3e4, 9e4]])
    np.testing.assert_allclose(field.stress(far), np.stack([remote] * 2), atol=1e-9)
    with pytest.raises(InputError, match="Pa across the crack; expected compression"):
        exact_solution("closed_crack", {**CLOSED, "stress": [0.0, 1.0, 0.0]}, STRAIN)


def test_a_crack_in_a_growing_field_is_closed_on_a_third_and_open_beyond():
    field = exact_solution("partly_closed_crack", PARTLY, STRAIN)
    shut, loose = np.array([-0.99, -0.8, -0.5, -0.34]), np.array([-0.32, 0.0, 0.5, 0.97])
    tractions, gap, _ = faces(field, shut)
    for normal, shear in tractions:
        assert (normal / (2.0 * 0.6)).round(2).tolist() == [-0.95, -0.75, -0.39, -0.07]
        np.testing.assert_allclose(shear, 0.0, atol=1e-12)
    np.testing.assert_allclose(gap, 0.0, atol=1e-12)
    tractions, gap, slip = faces(field, loose)
    np.testing.assert_allclose(np.array(tractions), 0.0, atol=1e-6)
    assert (gap > 0.0).all()
    np.testing.assert_allclose(slip, 0.0, atol=1e-12)
    # K from the stress ahead of the open tip; none where contact begins
    ahead = 1e-8 * np.array([1.0, 4.0])
    points, step = on_crack(1.0 + ahead / 0.6)
    normal = field.stress(points, points + step) @ ACROSS @ ACROSS
    k = normal * np.sqrt(2 * np.pi * ahead)
    np.testing.assert_allclose(k, field.stress_intensity[0], rtol=1e-6)
    assert field.stress_intensity[0] == pytest.approx(2.0 * 0.4 * np.sqrt(np.pi * 0.4), rel=1e-12)
    far = np.array([[3e5, -2e4], [5e4, 9e4]])
    local = (far - CLOSED["centre"]) @ np.stack([ALONG, ACROSS], axis=1)
    turn = np.stack([ALONG, ACROSS])
    stress = turn @ field.stress(far) @ turn.T / 2.0
    x, y = local.T
    wanted = np.moveaxis(np.array([[x, -y], [-y, x]]), 2, 0)
    np.testing.assert_allclose(stress, wanted, atol=1e-4 * np.abs(wanted).min())


def test_halves_that_meet_are_together_for_two_lengths_and_leave_with_velocities_exchanged():
    """Momentum of a half changes by the pressure ρ c v times that time; waves obey d'Alembert."""
    bar = exact_solution("impact", IMPACT, BAR)
    points = np.column_stack([np.linspace(-0.29, 0.69, 50), np.zeros(50)])
    side = np.sign(points[:, 0] - 0.2)
    for time, velocity in ((0.0, -0.1), (0.049, -0.1), (0.56, 0.1), (2.0, 0.1)):
        np.testing.assert_allclose(bar.at(time).velocity(points)[:, 0], side * velocity)
    meeting = np.array([[0.2, 0.0]])
    beside = [meeting + np.array([s, 0.0]) for s in (1e-9, -1e-9)]
    for time in (0.051, 0.3, 0.549):
        now = bar.at(time)
        one, other = (now.displacement(meeting, near)[0, 0] for near in beside)
        assert one == other == 0.0
        assert now.stress(meeting, beside[0])[0, 0, 0] == pytest.approx(-1.0 * 2.0 * 0.1)
    for time in (0.0, 0.02, 0.6):
        one, other = (bar.at(time).displacement(meeting, near)[0, 0] for near in beside)
        assert one - other == pytest.approx(0.01 - 0.2 * time if time < 0.1 else 0.2 * 0.05)
    moment = bar.at(0.4)
    rate = (
        bar.at(0.4 + 1e-5).displacement(points) - bar.at(0.4 - 1e-5).displacement(points)
    ) / 2e-5
    np.testing.assert_allclose(rate, moment.velocity(points), atol=1e-9)
    slope = difference(moment.displacement, points, 1e-5)
    np.testing.assert_allclose(slope, moment.gradient(points), atol=1e-9)
