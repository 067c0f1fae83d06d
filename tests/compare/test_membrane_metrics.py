"""Metrics of membranes alone: stretches, folds, sectors, and other triangles beside them."""

import numpy as np
import pytest
from cut_meshes import grid
from halves_in_space import Sheet
from membrane_meshes import bowl, flat, halved, layers, membrane, roof, upright

from verify.compare.body_rule import body_rule
from verify.compare.cut_rule import membrane_cut_rule
from verify.compare.errors import (
    displacement_error,
    displacement_jump,
    jump_error,
)
from verify.compare.hooke import field_strain_energy, strain_energy
from verify.compare.realised import MembraneField, field_of
from verify.compare.simplex_bodies import cut_membrane
from verify.scene.cuts import SweptCut

LAW = Sheet.law
SLOPE = np.array([[0.1, 0.2, 0.05], [-0.3, 0.05, 0.1], [0.02, 0.15, -0.2]])
SHIFT = np.array([0.01, 0.02, -0.03])
REST = (np.zeros((3, 3)), np.zeros(3))
SHAPES = pytest.mark.parametrize("shape", [flat, roof], ids=["plane", "roof"])


@SHAPES
def test_the_energy_of_a_membrane_is_that_of_its_two_stretches(shape):
    """Against the singular values of F = P + ∇u, by cells and by quadrature."""
    cut = Sheet(shape)
    field = cut.halves(4, (SLOPE, SHIFT), REST)
    _, weights, normals = cut.upper()
    density = []
    for n in normals:
        within = np.eye(3) - np.outer(n, n)
        s = np.linalg.svd(within + SLOPE @ within, compute_uv=False)[:2] - 1
        density.append(LAW.shear * np.sum(s**2) + 0.5 * LAW.lame * np.sum(s) ** 2)
    exact = weights @ density
    assert strain_energy(field.solution, LAW) == pytest.approx(exact, rel=1e-11)
    assert field_strain_energy(field, body_rule(cut.body(), 0.2), LAW) == pytest.approx(
        exact, 1e-11
    )


def test_two_triangulations_of_a_curved_surface_are_compared_by_nearest_points():
    """The error of the comparison falls like the sagitta, and the cut stays where it is."""
    found = []
    for n in (8, 16):
        body = halved(bowl, n)
        points, cells, layer = layers(bowl, n + 3)
        u = points @ SLOPE.T + np.where(layer[:, None] > 0, SHIFT, 0.0)
        other, cells_2, layer_2 = layers(bowl, 2 * n + 1, flip=True)
        v = other @ SLOPE.T + np.where(layer_2[:, None] > 0, SHIFT, 0.0)
        one, two = (
            field_of(membrane(*of), body) for of in ((points, cells, u), (other, cells_2, v))
        )
        assert isinstance(one, MembraneField)
        # curvature 0.6 in y and 0.4 in x, chords up to √2 squares of 1 / n: sagitta h² κ / 8
        assert 0 < two.off_surface < 0.6 * 2 / n**2 / 8
        rule = body_rule(body, 0.5 / n)
        apart = displacement_error(one, two, rule)
        cut = membrane_cut_rule(body, 0.5 / n)
        # no point of the cut is read from the wrong side: the feet of its two sides are apart by
        # the sagitta times the angle between two triangles, κ h, and the slope is about 0.4
        jump = jump_error(one, two, cut)
        feet = 0.6 * 2 / n**2 / 8 * 0.6 / n * 0.4
        assert jump.absolute < feet * cut.weights.sum() ** 0.5
        size = np.linalg.norm(SHIFT) * cut.weights.sum() ** 0.5
        assert jump.scale == pytest.approx(size, abs=feet)
        found.append(apart.relative)
    assert found[0] < 1e-2
    assert found[1] < 0.4 * found[0]


def test_each_sector_of_crossing_cuts_in_a_curved_membrane_keeps_its_own_values():
    """Four quarters of a bowl, each with its own nodes, moved by their own numbers."""
    whole, cells = grid(6, 6)
    cuts = [
        upright(bowl, (0.5, -0.5), (0.5, 1.5), "up"),  # its positive side is x < 1/2
        upright(bowl, (-0.5, 0.5), (1.5, 0.5), "along"),  # y > 1/2
    ]
    body = cut_membrane(bowl(*whole.T), cells, cuts)
    assert not len(body.tips)
    quarter, quarter_cells = grid(3, 3)
    corners = [np.array([i, j]) / 2 for i in (0, 1) for j in (0, 1)]
    points = np.vstack([bowl(*(0.5 * quarter + corner).T) for corner in corners])
    quarters = np.vstack([quarter_cells + k * len(quarter) for k in range(4)])
    values = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 5.0, 0], [0, 0, 20.0]])
    u = np.repeat(values, len(quarter), axis=0)
    field, still = (field_of(membrane(points, quarters, v), body) for v in (u, 0 * u))
    rule = membrane_cut_rule(body, 0.1)
    up = np.abs(rule.points[:, 0] - 0.5) < 1e-12
    late = np.where(up, rule.points[:, 1], rule.points[:, 0]) > 0.5
    # over "up": left minus right, below and above y = 1/2; over "along": above minus below
    expected = np.where(
        up[:, None],
        np.where(late[:, None], values[1] - values[3], values[0] - values[2]),
        np.where(late[:, None], values[3] - values[2], values[1] - values[0]),
    )
    assert np.abs(displacement_jump(field, rule) - expected).max() == 0.0
    square = rule.weights @ np.sum(expected**2, axis=1)
    assert jump_error(field, still, rule).absolute == pytest.approx(np.sqrt(square), rel=1e-12)
    surface = body_rule(body, 0.1)
    which = 2 * (surface.points[:, 0] > 0.5) + (surface.points[:, 1] > 0.5)
    found = field.displacement(surface.points, surface.points)
    assert np.abs(found - values[which]).max() == 0.0


def test_a_swept_cut_with_a_kink_is_one_line_on_the_surface():
    points, cells = grid(6, 6)
    plan = [(0.21, 0.33), (0.62, 0.57), (0.44, 1.4)]
    swept = SweptCut(
        kind="swept", name="bent", points=[(x, y, -1.0) for x, y in plan], along=(0.0, 0.0, 3.0)
    )
    body = cut_membrane(roof(*points.T), cells, [swept])
    assert len(body.patches) == 2
    assert np.abs(body.tips - roof(*np.array(plan[:1]).T)).max() < 1e-12
    # up to the ridge and down, and along the other plane until the rim at y = 1
    x = np.array([0.21, 0.5, 0.62, 0.62 - 0.18 * 0.43 / 0.83])
    y = np.array([0.33, 0.33 + 0.24 * 0.29 / 0.41, 0.57, 1.0])
    length = np.linalg.norm(np.diff(roof(x, y), axis=0), axis=1).sum()
    assert body.lines["bent"].lengths.sum() == pytest.approx(length, rel=1e-12)
    assert membrane_cut_rule(body, 0.1).weights.sum() == pytest.approx(length, rel=1e-12)
