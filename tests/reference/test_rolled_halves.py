"""Halves rolled to circles: equilibrium, free faces, energy, and the ends that the case holds."""

import numpy as np
import pytest
from fourth_order import difference

from reference.exact import exact_solution
from verify.scene import Material, load_scene

PLANE = Material(young=2.0, poisson=0.3, plane="strain")
TURNED = {
    "point": [0.3, -0.2], "angle": 25.0, "thickness": [0.2, 0.35], "curvature": [2.0, 1.1],
    "shift": [0.01, -0.02],
}  # fmt: skip
ALONG = np.array([np.cos(np.deg2rad(25.0)), np.sin(np.deg2rad(25.0))])
ACROSS = np.array([-ALONG[1], ALONG[0]])


def places(t):
    """Points (n, 2) along the strip at shares `t` of the thickness off the cut, on either side."""
    s = np.linspace(-0.4, 0.9, 7)[:, None]
    rows = [
        TURNED["point"] + s * ALONG + side * share * h * ACROSS
        for side, h in zip((1.0, -1.0), TURNED["thickness"], strict=True)
        for share in np.atleast_1d(t)
    ]
    return np.vstack(rows)


def piola(one, points, law):
    """First Piola–Kirchhoff stress 2μ(F − R) + λ tr(U − I) R of μ‖U − I‖² + ½λ tr²(U − I)."""
    f = np.eye(2) + one.gradient(points)
    left, stretch, right = np.linalg.svd(f)
    turn = left @ right
    trace = (stretch - 1).sum(axis=1)[:, None, None]
    return 2 * law.shear * (f - turn) + law.lame * trace * turn


def test_the_field_is_in_equilibrium_and_its_faces_are_free():
    one = exact_solution("rolled_halves", TURNED, PLANE)
    x = places([0.15, 0.5, 0.85])
    assert difference(one.displacement, x, 1e-3) == pytest.approx(one.gradient(x), abs=1e-9)
    # steps of 1e-3 are off by 1e-12 times fifth derivatives, of order 1 to 10
    slope = difference(lambda p: piola(one, p, one.law).reshape(len(p), 4), x, 1e-3)
    divergence = np.einsum("nijj->ni", slope.reshape(len(x), 2, 2, 2))
    assert np.abs(divergence).max() < 1e-7  # stress over thickness is of order 1
    faces = np.vstack([places(1e-12), places(1.0 - 1e-12)])
    assert np.abs(piola(one, faces, one.law) @ ACROSS).max() < 1e-9


def energy_density(one, points):
    """μ‖U − I‖² + ½λ tr²(U − I), J/m³."""
    stretch = np.linalg.svd(np.eye(2) + one.gradient(points), compute_uv=False) - 1.0
    volume = stretch.sum(axis=1)
    return one.law.shear * (stretch**2).sum(axis=1) + 0.5 * one.law.lame * volume**2


def test_energies_are_those_of_the_catalogue():
    # E = 1, c = π, length 1: one strip of 0.1, two of 0.05
    unit = Material(young=1.0, poisson=0.3, plane="strain")
    for h, energy in ((0.1, 2 * 4.4748894293e-4), (0.05, 1.12698177e-4)):
        both = {"point": [0, 0], "angle": 90.0, "thickness": [h, h], "curvature": [np.pi] * 2}
        nodes, weights = np.polynomial.legendre.leggauss(12)
        one = exact_solution("rolled_halves", both, unit)
        found = sum(  # it is the same all along
            0.5 * h * weights @ energy_density(one, np.column_stack([x, 0.4 + 0 * x]))
            for x in (0.5 * h * (nodes + 1.0), 0.5 * h * (nodes - 1.0))
        )
        assert found == pytest.approx(energy, rel=2e-9)


def test_the_supports_of_the_case_are_the_ends_of_the_exact_field():
    case = load_scene("rotation/peeled_halves")
    one = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    x = np.linspace(0.0, 0.05, 6)
    for support, sign, end in zip(case.supports, (1, -1, 1, -1), (0, 0, 1, 1), strict=True):
        points = np.column_stack([sign * x, np.full(6, float(end))])
        inside = points + np.array([sign * 1e-9, 0.0])
        expected = one.displacement(points, inside)
        assert support.values(points) == pytest.approx(expected, abs=1e-14)
