import numpy as np
import pytest
from cut_meshes import STRAIGHT, grid, layered, quadratic, scene, solution

from verify.compare.body import body_of
from verify.compare.body_rule import area_rule
from verify.compare.cut_rule import cut_rule
from verify.compare.errors import energy_error, jump_error
from verify.compare.hooke import hooke, strain_energy
from verify.compare.locate import SolutionField
from verify.scene import Material

LAW = hooke(Material(young=1.0, poisson=0.3, plane="strain"))


def line(x):
    return 0.5 + (x - 0.5) / 3


def _noisy(move, noise):
    """Halves moved alike, each node by some noise."""
    points, cells, _ = layered(5, (line,))
    rng = np.random.default_rng(3)
    moved = points @ np.array(move[0]).T + np.array(move[1])
    return SolutionField(solution(points, cells, moved + noise * rng.uniform(-1, 1, points.shape)))


@pytest.mark.parametrize(
    "move", [([[0, 0], [0, 0]], [0.3, -0.1]), ([[0, -0.2], [0.2, 0]], [0.0, 7.0])],
    ids=["shifted", "turned"],
)  # fmt: skip
def test_round_off_is_not_divided_by_round_off(move):
    """A rigid motion has neither strain nor openings: noise of 1e-15 of it is no error."""
    body = body_of(scene([STRAIGHT]))
    area, cut = area_rule(body, 0.2), cut_rule(body, 0.1)
    largest = np.abs(_noisy(move, 0.0).displacement(area.points, area.points)).max()
    still = _noisy(move, 1e-15 * largest)
    field = _noisy(move, 0.0)
    norms = [energy_error(field, still, area, LAW), jump_error(field, still, cut)]
    assert [norm.relative for norm in norms] == [0.0, 0.0]
    # a noise of 1e-6 is an error, and has nothing to be relative to
    moved = _noisy(move, 1e-6 * largest)
    norms = [energy_error(moved, still, area, LAW), jump_error(moved, still, cut)]
    assert [norm.relative for norm in norms] == [np.inf, np.inf]
    # a strain of 1e-7 is one: noise is held against it
    strained = ([[1e-7, move[0][0][1]], [move[0][1][0], 0.0]], move[1])
    assert energy_error(field, _noisy(strained, 0.0), area, LAW).relative == pytest.approx(
        1, abs=1e-3
    )


def test_the_energy_of_a_quadratic_field_is_exact():
    points, cells = quadratic(*grid(3, 2))
    x, y = points.T
    u = np.column_stack([x * x + 0.5 * x * y, x * y - y * y])
    # ε_xx = 2x + y/2, ε_yy = x − 2y, 2ε_xy = x/2 + y: moments of the unit square
    xx, xy, yy = 1 / 3, 1 / 4, 1 / 3
    trace = 9 * xx - 9 * xy + 2.25 * yy
    square = (4 * xx + 2 * xy + yy / 4) + (xx - 4 * xy + 4 * yy) + (xx / 4 + xy + yy) / 2
    expected = 0.5 * LAW.lame * trace + LAW.shear * square
    assert strain_energy(solution(points, cells, u, order=2), LAW) == pytest.approx(expected, 1e-13)


def test_plane_stress_has_the_energy_of_free_thickness():
    law = hooke(Material(young=2.0, poisson=0.3, plane="stress"))
    # uniaxial stress: σ = Eε with a lateral strain of −νε
    uniaxial = np.diag([1e-3, -0.3e-3])[None]
    assert law.energy_density(uniaxial)[0] == pytest.approx(0.5 * 2.0 * 1e-6, rel=1e-13)
