"""The corotated energy does not see rotations; the linear one does."""

import numpy as np
import pytest
from cut_meshes import grid, quadratic, solution
from scipy.spatial.transform import Rotation
from solid_meshes import cube_grid

from verify.compare import hooke as laws
from verify.compare.body_rule import Rule
from verify.compare.errors import energy_error
from verify.compare.hooke import Corotated, NeoHookean, corotated, hooke, strain_energy
from verify.compare.hooke import _rotations as rotations
from verify.compare.locate import SolutionField
from verify.compare.simplices import points_in
from verify.scene import Material

PLANE = Material(young=1e4, poisson=0.3, plane="strain")
SPACE = Material(young=1e4, poisson=0.3)


def turn(d, angle=0.7):
    c, s = np.cos(angle), np.sin(angle)
    if d == 2:
        return np.array([[c, -s], [s, c]])
    about_z = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    about_x = np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])
    return about_z @ about_x


@pytest.mark.parametrize("d", [2, 3])
def test_a_rotation_costs_nothing_and_a_turned_stretch_what_the_stretch_does(d):
    law = corotated(PLANE if d == 2 else SPACE)
    rotation = turn(d)
    assert law.energy_density((rotation - np.eye(d))[None])[0] < 1e-28 * 1e4
    stretch = np.diag([0.2, -0.1, 0.05][:d])
    moved = rotation @ (np.eye(d) + stretch) - np.eye(d)
    expected = law.shear * np.sum(stretch**2) + 0.5 * law.lame * np.trace(stretch) ** 2
    assert law.energy_density(moved[None])[0] == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(("law", "shape"), [
    (hooke(SPACE), (3, 3)), (corotated(PLANE), (2, 2)), (corotated(SPACE), (3, 3)),
    (Corotated(1e3, 4e3), (3, 2)), (NeoHookean(1e3, 4e3), (2, 2)),
    (NeoHookean(1e3, 4e3, stable=True), (3, 3)),
])  # fmt: skip
def test_the_stress_of_a_law_is_the_derivative_of_its_energy(law, shape):
    H, rate = 0.15 * np.random.default_rng(4).standard_normal((2, 20, *shape))
    step = 1e-5
    slope = (law.energy_density(H + step * rate) - law.energy_density(H - step * rate)) / (2 * step)
    assert np.einsum("nij,nij->n", law.piola(H), rate) == pytest.approx(
        slope, rel=1e-6, abs=1e-6 * law.shear
    )


@pytest.mark.parametrize(("angle", "energy"), [(30.0, 162.233085), (90.0, 9038.461538)])
def test_linear_kinematics_charge_for_a_rotation_what_is_known(angle, energy):
    """2 (λ + μ)(1 − cos θ)² per area; the upper part of the catalogue's square is .47."""
    moved = turn(2, np.deg2rad(angle)) - np.eye(2)
    found = 0.47 * hooke(PLANE).energy_density(moved[None])[0]
    assert found == pytest.approx(energy, rel=1e-8)


@pytest.mark.parametrize("d", [2, 3])
def test_an_inverted_cell_has_a_negative_stretch(d):
    flat = np.eye(d)
    flat[-1, -1] = -0.5
    moved = (turn(d) @ flat - np.eye(d))[None]
    law = corotated(PLANE if d == 2 else SPACE)
    stretch = 1.5  # from 1 to −0.5
    expected = (law.shear + 0.5 * law.lame) * stretch**2
    assert law.energy_density(moved)[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("spread", [0.0, 0.1, 0.5, 3.0])
def test_rotations_in_space_are_nearest_whatever_the_stretch(spread, compiled, monkeypatch):
    """R ∈ SO(3) is nearest to F if S = RᵀF is symmetric with tr(S) I − S not negative (Horn)."""
    monkeypatch.setattr(laws, "COMPILED", compiled)
    random = np.random.default_rng(5)
    turns = Rotation.random(3000, rng=random).as_matrix()
    F = turns @ (np.eye(3) + spread * random.standard_normal((3000, 3, 3)))
    R = rotations(F - np.eye(3))
    assert np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max() < 1e-13
    assert np.linalg.det(R).min() > 0.0
    S = np.swapaxes(R, 1, 2) @ F
    size = np.abs(F).max(axis=(1, 2))
    assert (np.abs(S - np.swapaxes(S, 1, 2)).max(axis=(1, 2)) / size).max() < 1e-12
    hessian = np.trace(S, axis1=1, axis2=2)[:, None, None] * np.eye(3) - S
    least = np.linalg.eigvalsh(0.5 * (hessian + np.swapaxes(hessian, 1, 2)))[:, 0]
    assert (least / size).min() > -1e-12
    assert spread < 0.5 or (np.linalg.det(F) < 0.0).any()


@pytest.mark.parametrize("d", [2, 3])
def test_the_norm_of_an_error_does_not_change_when_both_fields_are_turned(d):
    random = np.random.default_rng(5)
    law = corotated(PLANE if d == 2 else SPACE)
    one, other = np.eye(d) + 0.1 * random.normal(size=(2, 20, d, d))
    rotation = turn(d)
    still = law.error_density(one - other, other - np.eye(d))
    turned = law.error_density(rotation @ (one - other), rotation @ other - np.eye(d))
    assert turned == pytest.approx(still, rel=1e-12)


@pytest.mark.parametrize("compiled", [True, False])
def test_a_reference_that_is_kept_is_measured_by_the_law_that_is_asked_for(compiled, monkeypatch):
    """What one law finds of gradients that several solvers are held against is not another's."""
    monkeypatch.setattr(laws, "COMPILED", compiled)
    found, expected = 0.3 * np.random.default_rng(3).standard_normal((2, 50, 3, 3))
    for law in (Corotated(2.0, 1.0), NeoHookean(2.0, 1.0), NeoHookean(2.0, 1.0, stable=True)):
        for _ in range(2):
            difference, energy, _ = law.compared(found, expected)
            assert np.array_equal(energy, law.energy_density(expected))
            turned = np.swapaxes(rotations(expected), 1, 2) @ (found - expected)
            trace, strain = np.trace(turned, axis1=1, axis2=2), turned + np.swapaxes(turned, 1, 2)
            known = 0.5 * law.lame * trace**2 + 0.25 * law.shear * (strain**2).sum((1, 2))
            assert difference == pytest.approx(known, rel=1e-12)


def test_the_corotated_energy_of_a_quadratic_field_is_integrated():
    points, cells = quadratic(*grid(3, 3))
    x, y = points.T
    law = corotated(PLANE)
    # a bent square: rotations up to one radian
    u = np.column_stack([-0.5 * y * x, 0.5 * x * x])
    found = strain_energy(solution(points, cells, u, order=2), law)
    at, weights = points_in(grid(3, 3)[0][grid(3, 3)[1]], 12)
    o = np.zeros(len(at))
    gradient = np.array([[-0.5 * at[:, 1], -0.5 * at[:, 0]], [at[:, 0], o]]).transpose(2, 0, 1)
    assert found == pytest.approx(weights @ law.energy_density(gradient), rel=1e-8)


def test_a_reference_that_only_turns_has_no_energy_norm_to_be_relative_to():
    points, cells = cube_grid(2, 2, 2)
    turned = points @ turn(3).T - points
    noise = 1e-14 * np.random.default_rng(0).normal(size=points.shape)
    field, reference = (SolutionField(solution(points, cells, u)) for u in (turned + noise, turned))
    rule = Rule(*points_in(points[cells], 2))
    assert energy_error(field, reference, rule, corotated(SPACE)).scale == 0.0
    # linear kinematics see strains of order one there
    assert energy_error(field, reference, rule, hooke(SPACE)).scale > 1.0
