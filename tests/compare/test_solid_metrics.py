"""Fields in space with a known difference give that difference, by any quadrature."""

import numpy as np
import pytest
from solid_meshes import height, inclined, sliver_body, solid_scene, stacked

from verify.compare.body import body_of
from verify.compare.curves import Arc
from verify.compare.displacement_error import displacement_error
from verify.compare.energy_error import energy_error
from verify.compare.hooke import hooke
from verify.compare.integration import cut_rules, integrate_norm, rules
from verify.compare.jump_error import jump_error
from verify.compare.locate import SolutionField
from verify.compare.maximum_error import maximum_error
from verify.compare.opening import opening
from verify.compare.opening_error import opening_error, opening_maximum_error
from verify.compare.realised import SidedField, cut_deviation, field_of
from verify.compare.simplex_rule import points_in
from verify.compare.strain_energy import strain_energy
from verify.compare.surface_rule import surface_rule
from verify.compare.volume_rule import volume_rule
from verify.scene import Material
from verify.solution import Solution

LAW = hooke(Material(young=1.0, poisson=0.3))
SLOPE = np.array([[0.1, 0.2, 0.0], [-0.3, 0.05, 0.1], [0.0, 0.15, -0.2]])
SHIFT = np.array([0.01, 0.02, -0.03])
AREA = np.sqrt(1 + 1 / 9 + 1 / 25)
NORMAL = np.array([-1 / 3, 1 / 5, 1]) / AREA


def solution(points, cells, u, **more):
    return Solution(points=points, cells=cells.astype(np.int64), displacement=u[None], **more)


def halves(n, above, below, flip=False):
    """Linear fields (slope, shift) above and below the inclined cut."""
    points, cells, layer = stacked(n, [height], flip)
    moved = [points @ slope.T + shift for slope, shift in (below, above)]
    return SolutionField(solution(points, cells, np.where(layer[:, None] > 0, moved[1], moved[0])))


REST = (np.zeros((3, 3)), np.zeros(3))
OTHER = (0.1 * np.eye(3), np.zeros(3))


def test_fields_on_different_meshes_with_a_known_difference_give_it():
    body = body_of(solid_scene([inclined()]))
    # meshes of 3 and 5 cells with opposite diagonals; linear per side: only round-off remains
    field, reference = halves(3, (SLOPE, SHIFT), REST), halves(5, OTHER, REST, flip=True)
    rule = volume_rule(body, 0.2)
    slope = SLOPE - OTHER[0]
    # moments of the upper half in closed form: ∫ f(x, y, z) from height to 1, by 8-point Gauss
    x, w = np.polynomial.legendre.leggauss(8)
    x, w = 0.5 * (x + 1), 0.5 * w
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"), axis=-1).reshape(-1, 3)
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel()
    low = height(grid)
    grid[:, 2] = low + (1 - low) * grid[:, 2]
    weight *= 1 - low
    square = weight @ np.sum((grid @ slope.T + SHIFT) ** 2, axis=1)
    found = displacement_error(field, reference, rule)
    assert found.absolute == pytest.approx(np.sqrt(square), rel=1e-8)
    strain = 0.5 * (slope + slope.T)
    density = LAW.lame * np.trace(strain) ** 2 + 2 * LAW.shear * np.sum(strain**2)
    found = energy_error(field, reference, rule, LAW)
    assert found.absolute == pytest.approx(np.sqrt(0.5 * density), rel=1e-8)
    # the energy of a solution is half of the square of its energy norm, cell by cell or not
    energy = strain_energy(field.solution, LAW)
    still = halves(2, REST, REST)
    assert energy == pytest.approx(0.5 * energy_error(still, field, rule, LAW).scale ** 2, 1e-12)


def test_a_rigid_jump_in_space_is_measured_on_its_cut():
    field, still = halves(3, (np.zeros((3, 3)), SHIFT), REST), halves(4, REST, REST, flip=True)
    body = body_of(solid_scene([inclined()]))
    rule = surface_rule(body, 0.1)
    size = np.linalg.norm(SHIFT)
    assert jump_error(field, still, rule).absolute == pytest.approx(size * AREA**0.5, rel=1e-8)
    normal = SHIFT @ NORMAL
    assert opening_error(still, field, rule).scale == pytest.approx(abs(normal) * AREA**0.5, 1e-8)
    assert opening_maximum_error(field, still, rule).absolute == pytest.approx(abs(normal), 1e-8)
    middle = [0.4, 0.6, 0.5]
    assert opening(field, body, "cut", middle, "normal") == pytest.approx(normal, rel=1e-10)
    along = np.linalg.norm(SHIFT - normal * NORMAL)
    assert opening(field, body, "cut", middle, "tangential") == pytest.approx(along, rel=1e-10)
    found = maximum_error(field, still, volume_rule(body, 0.3))
    assert found.absolute == pytest.approx(size, rel=1e-12)


@pytest.mark.parametrize("gap", [1e-3, 1e-9])
def test_a_jump_across_a_sliver_in_space_is_measured_on_its_own_cut(gap):
    points, cells, layer = stacked(4, [height, lambda p: height(p) + gap])
    moved = np.array([[0.0, 0, 0], [3.0, 4.0, 0], [6.0, 0.0, 0]])[layer]
    field = SolutionField(solution(points, cells, moved))
    still = SolutionField(solution(points, cells, np.zeros_like(points)))
    body = sliver_body(gap)
    # |(3, 4, 0)| = 5 on both cuts; trimmed by the cube both have the same area
    expected = 5 * np.sqrt(2 * AREA)
    found = jump_error(field, still, surface_rule(body, 0.1))
    assert found.absolute == pytest.approx(expected, rel=1e-8)
    only = SolutionField(solution(points, cells, np.where(layer[:, None] == 1, moved, 0.0)))
    # rel: the height of the sliver, a difference of numbers near .5, is known to 1e-16
    tolerance = max(1e-8, 4e-16 / gap)
    found = displacement_error(only, still, volume_rule(body, 0.15))
    assert found.absolute == pytest.approx(5 * np.sqrt(gap), rel=tolerance)


def test_swapped_sides_in_space_show_as_a_jump_error_of_two():
    field = halves(3, (np.zeros((3, 3)), SHIFT), REST)

    class Swapped:
        def displacement(self, points, near=None):
            return field.displacement(points, 2 * points - near)

    rule = surface_rule(body_of(solid_scene([inclined()])), 0.2)
    assert jump_error(field, field, rule).relative == 0.0
    assert jump_error(Swapped(), field, rule).relative == pytest.approx(2.0, rel=1e-12)


class Smooth:
    def displacement(self, points, near=None):
        x, y, z = points.T
        return np.column_stack([x * x * y, y * z - x**3, z * z * x])

    def gradient(self, points, near=None):
        x, y, z = points.T
        o = np.zeros_like(x)
        rows = [[2 * x * y, x * x, o], [-3 * x * x, z, y], [z * z, o, 2 * z * x]]
        return np.array(rows).transpose(2, 0, 1)


@pytest.mark.parametrize("n", [3, 6])
def test_the_estimated_integration_error_in_space_covers_the_true_one(n):
    points, cells, _ = stacked(n, [height])
    field = SolutionField(solution(points, cells, Smooth().displacement(points)))
    body = body_of(solid_scene([inclined()]))
    # the truth: a rule of degree 9 on the cells of the field itself
    at, weights = points_in(points[cells], 5)
    cell = np.repeat(np.arange(len(cells)), 125)
    u, gradient = field.in_cells(at, cell)
    true_l2 = np.sqrt(weights @ np.sum((u - Smooth().displacement(at)) ** 2, axis=1))
    density = LAW.energy_density(gradient - Smooth().gradient(at))
    true_energy = np.sqrt(2 * weights @ density)
    family = rules(body, 1 / n)
    for truth, measure in (
        (true_l2, lambda r: displacement_error(field, Smooth(), r)),
        (true_energy, lambda r: energy_error(field, Smooth(), r, LAW)),
    ):
        found = integrate_norm(measure, family)
        off = abs(found.norm.absolute - truth) / found.norm.scale
        assert off <= found.integration_error
        assert found.integration_error < 0.05 * found.norm.relative


def tube(facets, radius=0.3):
    """A prism with a regular polygon inscribed in a circle, in a cube: cut along its mantle."""
    angle = 2 * np.pi * np.arange(facets) / facets
    ring = 0.5 + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    scale = 0.5 / np.abs(ring - 0.5).max(axis=1)[:, None]
    hull = 0.5 + (ring - 0.5) * scale  # on the square
    points, cells, inner, mantle = [], [], [], []

    def prism(a, b, c, moved):
        first = 6 * (len(points) // 6)
        points.extend([[*p, z] for z in (0.0, 1.0) for p in (a, b, c)])
        inner.extend([moved] * 6)
        cells.extend(
            (first + np.array(t)).tolist() for t in ([0, 1, 2, 5], [0, 1, 4, 5], [0, 3, 4, 5])
        )

    centre = np.array([0.5, 0.5])
    for k in range(facets):
        a, b, c, d = ring[k], ring[(k + 1) % facets], hull[k], hull[(k + 1) % facets]
        prism(centre, a, b, True)
        prism(a, c, d, False)
        prism(a, d, b, False)
        low, high = [[*p, 0.0] for p in (a, b)], [[*p, 1.0] for p in (a, b)]
        mantle += [[low[0], low[1], high[1]], [low[0], high[1], high[0]]]
    return np.array(points), np.array(cells), np.array(inner), np.array(mantle)


def test_the_sides_of_a_tube_are_those_of_the_cylinder_and_not_of_its_facets():
    cut = {"kind": "cylinder", "base": [0.5, 0.5, -0.1], "axis": [0.0, 0.0, 1.0],
           "radius": 0.3, "height": 1.2}  # fmt: skip
    body = body_of(solid_scene([cut]))
    points, cells, inner, mantle = tube(16)
    u = np.where(inner[:, None], [0.0, 0.0, 1.0], 0.0)
    one = solution(points, cells, u, cut_facets=mantle)
    # sagitta of 16 chords; probes are corners and centroids, those lie two thirds along it
    sagitta = 0.3 * (1 - np.cos(np.pi / 16))
    assert 0.8 * sagitta < cut_deviation(one, body) <= sagitta * (1 + 1e-12)
    field = field_of(one, body)
    assert isinstance(field, SidedField)
    rule = volume_rule(body, 0.1)
    inside = np.linalg.norm(rule.points[:, :2] - 0.5, axis=1) < 0.3
    lift = field.displacement(rule.points, rule.points)[:, 2]
    assert np.allclose(lift, inside)
    jump = jump_error(field, SolutionField(solution(points, cells, 0 * u)), surface_rule(body, 0.1))
    area = 2 * np.pi * 0.3
    assert jump.absolute == pytest.approx(np.sqrt(area), rel=1e-3)  # that of the trimmed area
    assert isinstance(body.patches[0].arc, Arc)


def test_rules_of_a_cut_have_the_estimate_of_their_error_too():
    body = body_of(solid_scene([inclined()]))
    field, still = halves(3, (SLOPE, SHIFT), REST), halves(3, REST, (SLOPE, SHIFT))
    found = integrate_norm(lambda r: jump_error(field, still, r), cut_rules(body, 0.3))
    # linear on a plane: its square is integrated exactly by every rule
    assert found.integration_error < 1e-12
