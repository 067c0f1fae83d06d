"""Fields in space with a known difference give it by any quadrature, in sheets and in solids."""

import numpy as np
import pytest
from halves_in_space import Cube, Sheet
from membrane_meshes import flat, roof

from verify.compare.body_rule import body_rule, rules
from verify.compare.cut_profile import opening
from verify.compare.errors import (
    displacement_error,
    displacement_squares,
    energy_error,
    integrate_norm,
    jump_error,
    opening_squares,
)
from verify.compare.simplices import points_in

SLOPE = np.array([[0.1, 0.2, 0.05], [-0.3, 0.05, 0.1], [0.02, 0.15, -0.2]])
SHIFT = np.array([0.01, 0.02, -0.03])
STILL = np.zeros((3, 3))
REST = (STILL, np.zeros(3))
OTHER = (0.1 * np.eye(3), np.zeros(3))
BODIES = [Sheet(flat), Sheet(roof), Cube()]
NAMES = ["plane", "roof", "cube"]
ALL = pytest.mark.parametrize("cut", BODIES, ids=NAMES)


@ALL
def test_fields_on_different_meshes_with_a_known_difference_give_it(cut):
    """On meshes with opposite diagonals; linear on each side, so that round-off remains."""
    body, (n, m) = cut.body(), cut.levels
    field, reference = cut.halves(n, (SLOPE, SHIFT), REST), cut.halves(m, OTHER, REST, flip=True)
    rule = body_rule(body, 0.2)
    points, weights, _ = cut.upper()
    upper = np.sum(rule.weights) - cut.lower_measure
    assert weights.sum() == pytest.approx(upper, rel=1e-13)
    slope = SLOPE - OTHER[0]
    square = weights @ np.sum((points @ slope.T + SHIFT) ** 2, axis=1)
    found = displacement_error(field, reference, rule)
    assert found.absolute == pytest.approx(np.sqrt(square), rel=1e-8)
    found = energy_error(field, reference, rule, cut.law)
    assert found.absolute == pytest.approx(np.sqrt(cut.energy(slope)), rel=1e-8)


@ALL
def test_a_rigid_jump_is_measured_along_the_cut(cut):
    body, (n, m) = cut.body(), cut.levels
    field, still = cut.halves(n, (STILL, SHIFT), REST), cut.halves(m, REST, REST, flip=True)
    rule, pieces = cut.cut_rule(body, 0.1), cut.pieces()
    size, whole = np.linalg.norm(SHIFT), sum(measure for measure, _ in pieces)
    assert jump_error(field, still, rule).absolute == pytest.approx(size * whole**0.5, rel=1e-8)
    profile = np.sqrt(sum(measure * (SHIFT @ normal) ** 2 for measure, normal in pieces))
    assert opening_squares(still, field, rule).norm(rule.weights).scale == pytest.approx(
        profile, rel=1e-8
    )
    largest = max(abs(SHIFT @ normal) for _, normal in pieces)
    found = opening_squares(field, still, rule).largest().absolute
    assert found == pytest.approx(largest, rel=1e-8)
    across = SHIFT @ pieces[0][1]
    found = opening(field, body, cut.cut, cut.place(), "normal")
    assert found == pytest.approx(across, rel=1e-10)
    rest = np.linalg.norm(SHIFT - across * pieces[0][1])
    found = opening(field, body, cut.cut, cut.place(), "tangential")
    assert found == pytest.approx(rest, rel=1e-10)
    found = displacement_squares(field, still, body_rule(body, 0.3)).largest()
    assert found.absolute == pytest.approx(size, rel=1e-12)


@ALL
@pytest.mark.parametrize("gap", [1e-3, 1e-9])
def test_a_jump_across_a_sliver_is_measured_on_its_own_cut(cut, gap):
    body = cut.body(gap)
    points, cells, layer = cut.layers(4, gap)
    moved = np.array([[0.0, 0, 0], [3.0, 4.0, 0], [6.0, 0.0, 0]])[layer]
    middle = np.where(layer[:, None] == 1, moved, 0.0)
    field, still, only = (cut.field(points, cells, u, body) for u in (moved, 0 * moved, middle))
    measure = sum(measure for measure, _ in cut.pieces())
    # |(3, 4, 0)| = 5 on both cuts, which are equally large
    found = jump_error(field, still, cut.cut_rule(body, 0.1))
    assert found.absolute == pytest.approx(5 * np.sqrt(2 * measure), rel=1e-8)
    found = displacement_error(only, still, body_rule(body, 0.15))
    tolerance = max(1e-8, cut.round_off / gap)
    assert found.absolute == pytest.approx(5 * np.sqrt(cut.sliver(gap)), rel=tolerance)


class Smooth:
    """Smooth in space; on a sheet its gradient is made tangential by the rule."""

    def displacement(self, points, near=None):
        x, y, z = points.T
        return 0.1 * np.column_stack([x * x * y, y * z - x**3, z * z * x])

    def gradient(self, points, near=None):
        x, y, z = points.T
        o = np.zeros_like(x)
        rows = [[2 * x * y, x * x, o], [-3 * x * x, z, y], [z * z, o, 2 * z * x]]
        return 0.1 * np.array(rows).transpose(2, 0, 1)


@pytest.mark.parametrize(("cut", "n"), [(BODIES[1], 8), (BODIES[2], 3)], ids=["roof-8", "cube-3"])
def test_the_estimated_integration_error_in_space_covers_the_true_one(cut, n):
    body, true = cut.body(), Smooth()
    points, cells, _ = cut.layers(n)
    field = cut.field(points, cells, true.displacement(points), body)
    # the truth: a rule of degree 9 on the cells of the field itself
    at, weights = points_in(points[cells], 5)
    cell = np.repeat(np.arange(len(cells)), len(at) // len(cells))
    u, gradient = field.in_cells(at, cell)
    true_l2 = np.sqrt(weights @ np.sum((u - true.displacement(at)) ** 2, axis=1))
    density = cut.error_density(points[cells][cell], gradient, true.gradient(at))
    true_energy = np.sqrt(2 * weights @ density)
    family = rules(body, 1 / n)
    for truth, measure in (
        (true_l2, lambda r: displacement_error(field, true, r)),
        (true_energy, lambda r: energy_error(field, true, r, cut.law)),
    ):
        # by all rules; by the two coarser, which are asked first
        for first, share in ((0, 0.05), (1, 0.15)):
            found = integrate_norm(measure, family[first:])
            off = abs(found.norm.absolute - truth) / found.norm.scale
            assert off <= found.integration_error
            assert found.integration_error < share * found.norm.relative
