"""Exact motions: the blade through a prestretched strip, the bar that is let go."""

from itertools import pairwise

import numpy as np
import pytest
import scenes
from reference_scenes import needs_fenicsx

from reference.exact import exact_solution
from verify.scene import Material
from verify.solvers import find_solver

# λ = μ = 1, ρ = 1: c = 1
MATERIAL = Material(young=2.5, poisson=0.25, density=1.0)
TURNED = {"tip": [0.3, -0.2], "angle": 37.0}


def _field(speed, time=0.1, material=MATERIAL, **further):
    given = {"half_width": 1.0, "grip": 1.0, "speed": speed, **further}
    return exact_solution("blade_strip", given, material).at(time)


def _places(tip, count=200, far=0.2):
    """Places of the strip in its own axes, not too near to the tip and off the middle."""
    at = np.random.default_rng(3).uniform([-2.0, -0.95], [2.0, 0.95], (count, 2))
    at = at[(np.hypot(at[:, 0] - tip, at[:, 1]) > far) & (np.abs(at[:, 1]) > 0.02)]
    return np.column_stack([at, np.linspace(0.0, 0.3, len(at))])


def _turned(local, tip, angle):
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    found = local.copy()
    found[:, :2] = np.asarray(tip) + local[:, :2] @ np.array([[c, s], [-s, c]])
    return found


@pytest.mark.parametrize("speed", [0.0, 0.6, 0.95])
def test_it_solves_the_wave_equation(speed):
    # second differences are off by d²/12 of the fourth derivatives: of 1.13 √r in each direction
    # 1.06/r^3.5, with the contraction 1/g^4
    points, d, t = _turned(_places(speed * 0.1), **TURNED), 1e-3, 0.1
    u = lambda p, time: _field(speed, time, **TURNED).displacement(p)[:, 2]  # noqa: E731
    bend = sum(
        u(points + d * axis, t) - 2 * u(points, t) + u(points - d * axis, t)
        for axis in np.eye(3)[:2]
    )
    fast = u(points, t + d) - 2 * u(points, t) + u(points, t - d)
    tolerance = 3 * 1.06 * d**2 / 12 / 0.2**3.5 / (1 - speed**2) ** 2
    np.testing.assert_allclose(bend / d**2, fast / d**2, atol=tolerance)


@pytest.mark.parametrize("speed", [0.0, 0.6])
def test_gradient_and_velocity_are_the_derivatives(speed):
    points, d = _turned(_places(speed * 0.1), **TURNED), 1e-5
    field = _field(speed, **TURNED)
    gradient = field.gradient(points)
    for k, axis in enumerate(np.eye(3)):
        slope = field.displacement(points + d * axis) - field.displacement(points - d * axis)
        np.testing.assert_allclose(gradient[:, :, k], slope / (2 * d), atol=1e-7)
    later, earlier = field.at(0.1 + d), field.at(0.1 - d)
    rate = (later.displacement(points) - earlier.displacement(points)) / (2 * d)
    np.testing.assert_allclose(field.velocity(points), rate, atol=1e-7)


def test_grips_faces_and_what_lies_ahead():
    field, x = _field(0.6, **TURNED), np.linspace(-3.0, 3.0, 41)
    grip = _turned(np.column_stack([x, np.ones(41), 0 * x]), **TURNED)
    np.testing.assert_allclose(field.displacement(grip)[:, 2], 1.0, atol=1e-12)
    behind = _turned(np.column_stack([x[x < 0.05], 0 * x[x < 0.05], 0 * x[x < 0.05]]), **TURNED)
    normal = np.array([-np.sin(np.deg2rad(37.0)), np.cos(np.deg2rad(37.0)), 0.0])
    for side in (1.0, -1.0):
        near = behind + 0.01 * side * normal
        # also for places that round-off has put on the other side
        for off in (-1e-15, 0.0, 1e-15):
            points = behind + off * normal
            traction = field.stress(points, near) @ normal
            np.testing.assert_allclose(traction, 0.0, atol=1e-9)
            assert (side * field.displacement(points, near)[:, 2] > 0.0).all()
    ahead = _turned(np.column_stack([x[x > 0.1], 0 * x[x > 0.1], 0 * x[x > 0.1]]), **TURNED)
    for side in (1.0, -1.0):
        found = field.displacement(ahead, ahead + 0.01 * side * normal)
        np.testing.assert_allclose(found, 0.0, atol=1e-12)


@pytest.mark.parametrize("speed", [0.0, 0.6])
def test_intensity_at_the_moving_tip(speed):
    """The opening at r behind the tip is 4 K/(μg) √(r/2π), up to r/b; G = K²/(2μg) = μw₀²/b."""
    material = Material(young=25.0, poisson=0.25, density=10.0)  # μ = 10, c = 1
    field = _field(speed, 0.2, material, grip=0.02, half_width=0.5)
    k, g, r = field.stress_intensity[2], np.sqrt(1 - speed**2), 1e-7
    behind = np.array([[0.2 * speed - r, 0.0, 0.0]])
    up = np.array([[0.0, 1.0, 0.0]])
    opening = (field.displacement(behind, up) - field.displacement(behind, -up))[0, 2]
    assert opening == pytest.approx(4 * k / (10.0 * g) * np.sqrt(r / (2 * np.pi)), rel=1e-5)
    assert field.energy_release_rate == pytest.approx(10.0 * 0.02**2 / 0.5)
    assert k**2 / (2 * 10.0 * g) == pytest.approx(field.energy_release_rate)


def test_energy_of_the_strip_at_rest():
    """The work on the surface, against the integral over triangles from the tip."""
    field, total = _field(0.0), 0.0
    nodes, weights = np.polynomial.legendre.leggauss(48)
    r, t = (grid.ravel() for grid in np.meshgrid(0.5 * (nodes + 1), 0.5 * (nodes + 1)))
    weight = np.outer(weights, weights).ravel() / 4
    corners = np.array([[-0.7, 0.0], [-0.7, 1.0], [0.9, 1.0], [0.9, 0.0]])[::-1]
    for a, c in pairwise(corners):  # of the upper half
        points = np.zeros((len(r), 3))
        points[:, :2] = r[:, None] * (a + t[:, None] * (c - a))
        slope = field.gradient(points)[:, 2, :2]
        area = a[0] * c[1] - a[1] * c[0]
        total += 0.5 * float((weight * r * area) @ np.sum(slope**2, axis=1))
    box = np.array([[-0.7, -1.0, 0.0], [0.9, 1.0, 0.25]])
    assert field.strain_energy(box) == pytest.approx(2 * 0.25 * total, rel=1e-8)


def _strip(cells_across, speed, lead):
    """The slab of tetrahedra, h = 1 / cells_across, steps of h/2c; relative L2 error at the end."""
    h, reach = 1.0 / cells_across, 3.0
    tip = [0.0137, 0.0]
    path = [[-reach - 0.5, 0.0, -0.5], [tip[0] + 2.0 * speed, 0.0, -0.5]]
    exact_end = {"displacement": "exact", "components": ["z"]}
    parameters = {"half_width": 1.0, "grip": 1.0, "speed": speed, "tip": tip}
    scene = scenes.scene(
        [{"kind": "tool_path", "points": path, "direction": [0.0, 0.0, 1.0], "depth": 1.5,
          "speed": speed, "starts_at": (path[0][0] - tip[0]) / speed}],
        geometry=scenes.box([reach, 1.0, h], [-reach, -1.0, 0.0]),
        mesh={"cells": [[6 * cells_across, 2 * cells_across, 1]]},
        material={"young": 2.5, "poisson": 0.25, "density": 1.0},
        supports=[
            {"where": "boundary", "displacement": [0.0, 0.0], "components": ["x", "y"]},
            {"where": "left", **exact_end},
            {"where": "right", **exact_end},
            {"where": "y < -1 + 1e-9", "displacement": [-1.0], "components": ["z"]},
            {"where": "y > 1 - 1e-9", "displacement": [1.0], "components": ["z"]},
        ],
        exact={"solution": "blade_strip", "parameters": parameters},
        initial={"kind": "field", "displacement": "exact", "velocity": "exact"},
        analysis={"kind": "dynamic", "duration": 2.0, "time_step": h / 2, "outputs": 2},
    )  # fmt: skip
    found = find_solver("conforming").solve(
        scene, 0, 0, scheme="generalised_alpha", spectral_radius=0.0, delay=-lead * h / speed
    )
    assert scene.exact is not None
    exact = exact_solution("blade_strip", scene.exact.parameters, scene.material).at(2.0)
    corners = found.points[found.cells]
    near = np.empty_like(found.points)
    near[found.cells] = corners.mean(axis=1)[:, None]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6.0
    weight = np.bincount(found.cells.ravel(), np.repeat(volume / 4.0, 4))
    true = exact.displacement(found.points, near)
    off = found.displacement[-1] - true
    return np.sqrt(weight @ (off**2).sum(axis=1) / (weight @ (true**2).sum(axis=1)))


@pytest.mark.heavy
@needs_fenicsx[0]
@needs_fenicsx[1]
@pytest.mark.parametrize(("lead", "least", "most"), [(0.0, 0.85, 1.15), (1.0, 1.25, 1.6)])
def test_a_facet_that_opens_behind_the_blade_costs_the_higher_order(lead, least, most):
    # the rule opens a facet when all of it is passed: one element late, an error O(h). Opened as
    # the blade reaches it (nodes released at the tip) what is left is the mesh: 1.4 where the
    # scheme takes the waves (the table of the strip, by a scalar program)
    errors = [_strip(cells, 0.6, lead) for cells in (8, 16)]
    assert least < np.log2(errors[0] / errors[1]) < most


@pytest.mark.parametrize(("at", "dimension"), [(0.3, 2), (1.1, 3), (-0.2, 3)])
def test_a_bar_that_is_let_go_moves_by_waves(at, dimension):
    """Derivatives, free faces, held ends; at rest before. Waves: study/test_cost_study.py."""
    plane = {"plane": "strain"} if dimension == 2 else {}
    material = Material(young=2.0, poisson=0.3, density=0.7, **plane)
    given = {"strain": 0.02, "ends": [-0.2, 1.1], "at": at, "origin": 0.4}
    bar = exact_solution("released_bar", given, material)
    points = np.random.default_rng(2).uniform(-0.2, 1.1, (300, dimension))
    step, shift = 1e-4, 1e-4 * np.eye(dimension)[0]
    assert bar.at(-1.0).displacement(points)[:, 0] == pytest.approx(0.02 * (points[:, 0] - 0.4))
    for side in (-1.0, 1.0):  # unknowns of a part beyond its face move with it: no wave has begun
        near = np.full((1, dimension), at) + 1e3 * side * shift
        if -0.2 < near[0, 0] < 1.1:
            start, beyond = bar.at(0.0), near - 2e3 * side * shift
            assert (start.velocity(beyond, near) == 0.0).all()
            expected = pytest.approx(0.02 * (beyond[0, 0] - 0.4), rel=1e-14)
            assert start.displacement(beyond, near)[0, 0] == expected
            assert start.gradient(beyond, near)[0, 0, 0] == pytest.approx(0.02, rel=1e-14)
    for end in (-0.2, 1.1):  # the ends themselves, and round-off beyond them
        beyond = np.full((1, dimension), np.nextafter(end, np.sign(end) * np.inf))
        assert np.isfinite(bar.at(0.11).displacement(beyond)).all()
    for time in (0.11, 0.74, 3.3):
        field = bar.at(time)
        far = field.smooth(points, 5e-4) & (np.abs(points[:, 0] - at) > 5e-4)
        here = points[far]
        assert len(here) > 280
        along = (field.displacement(here + shift) - field.displacement(here - shift)) / (2 * step)
        np.testing.assert_allclose(field.gradient(here)[:, :, 0], along, atol=1e-10)
        late, early = (bar.at(time + s).displacement(here) for s in (step, -step))
        np.testing.assert_allclose(field.velocity(here), (late - early) / (2 * step), atol=1e-10)
        for side in (-1.0, 1.0):
            face = np.full((1, dimension), at)
            beside = face + side * shift
            if -0.2 < beside[0, 0] < 1.1:
                assert np.abs(field.stress(face, beside)).max() < 1e-14
        for end in {-0.2, 1.1} - {at}:
            held = np.full((1, dimension), end)
            assert field.displacement(held)[0, 0] == pytest.approx(0.02 * (end - 0.4), abs=1e-15)
