"""Fields on membranes with a known difference give it, on any triangles of the surface."""

import numpy as np
import pytest
from cut_meshes import grid, quadratic
from membrane_meshes import TILTED, bowl, flat, halved, layers, line, membrane, roof, upright

from verify.compare.displacement_error import displacement_error
from verify.compare.energy_error import energy_error
from verify.compare.hooke import MembraneLaw
from verify.compare.integration import integrate_norm, rules
from verify.compare.jump_error import displacement_jump, jump_error
from verify.compare.locate import SolutionField
from verify.compare.maximum_error import maximum_error
from verify.compare.membrane_body import cut_membrane
from verify.compare.membrane_field import MembraneField
from verify.compare.membrane_rule import membrane_cut_rule, membrane_rule
from verify.compare.near_tip import near_radius
from verify.compare.opening import opening
from verify.compare.opening_error import opening_error, opening_maximum_error
from verify.compare.realised import field_of
from verify.compare.simplex_rule import points_in
from verify.compare.strain_energy import field_strain_energy, strain_energy
from verify.errors import UnsupportedSceneError
from verify.scene.spatial_cuts import DiscCut, PolygonCut, SweptCut

LAW = MembraneLaw(0.7, 0.4)
SLOPE = np.array([[0.1, 0.2, 0.05], [-0.3, 0.05, 0.1], [0.02, 0.15, -0.2]])
SHIFT = np.array([0.01, 0.02, -0.03])
REST = (np.zeros((3, 3)), np.zeros(3))
OTHER = (0.1 * np.eye(3), np.zeros(3))
SHAPES = pytest.mark.parametrize("shape", [flat, roof], ids=["plane", "roof"])


def halves(body, shape, n, above, below, flip=False):
    """Linear fields (slope, shift) of the place in space, above and below the cut."""
    points, cells, layer = layers(shape, n, flip=flip)
    moved = [points @ slope.T + shift for slope, shift in (below, above)]
    u = np.where(layer[:, None] > 0, moved[1], moved[0])
    return field_of(membrane(points, cells, u), body)


def upper_half(shape):
    """Points and weights of a Gauss rule on the surface above the cut, and normals there."""
    x, w = np.polynomial.legendre.leggauss(8)
    x, w = 0.5 * (x + 1), 0.5 * w
    points, weights, normals = [], [], []
    for left in (0.0, 0.5):  # either side of a ridge
        s, t = np.meshgrid(left + 0.5 * x, x, indexing="ij")
        low = line(s)
        points.append(shape(s.ravel(), (low + (1 - low) * t).ravel()))
        slope = 0.0 if shape is flat else 0.8 if left == 0 else -0.8
        across = TILTED[2] if shape is flat else np.array([-slope, 0, 1]) / np.hypot(slope, 1)
        weights.append((np.outer(0.5 * w, w) * (1 - low)).ravel() * np.hypot(slope, 1))
        normals.append(np.tile(across, (64, 1)))
    return np.vstack(points), np.concatenate(weights), np.vstack(normals)


@SHAPES
def test_fields_on_different_triangles_with_a_known_difference_give_it(shape):
    body = halved(shape)
    field = halves(body, shape, 4, (SLOPE, SHIFT), REST)
    reference = halves(body, shape, 6, OTHER, REST, flip=True)
    rule = membrane_rule(body, 0.2)
    points, weights, normals = upper_half(shape)
    assert weights.sum() == pytest.approx(np.sum(rule.weights) - lower_area(shape), rel=1e-13)
    slope = SLOPE - OTHER[0]
    square = weights @ np.sum((points @ slope.T + SHIFT) ** 2, axis=1)
    found = displacement_error(field, reference, rule)
    assert found.absolute == pytest.approx(np.sqrt(square), rel=1e-8)
    # the expected field is a uniform stretch: it turns nothing, so that the difference counts
    # through its symmetric tangential part
    density = []
    for n in normals:
        within = np.eye(3) - np.outer(n, n)
        strain = within @ (slope + slope.T) @ within / 2
        density.append(LAW.lame * np.trace(strain) ** 2 + 2 * LAW.shear * np.sum(strain**2))
    found = energy_error(field, reference, rule, LAW)
    assert found.absolute == pytest.approx(np.sqrt(weights @ density), rel=1e-8)


def lower_area(shape):
    return 0.5 * (1.0 if shape is flat else np.hypot(0.8, 1))  # the line is at 1/2 in the mean


@SHAPES
def test_the_energy_of_a_membrane_is_that_of_its_two_stretches(shape):
    """Against the singular values of F = P + ∇u, by cells and by quadrature."""
    body = halved(shape)
    field = halves(body, shape, 4, (SLOPE, SHIFT), REST)
    _, weights, normals = upper_half(shape)
    density = []
    for n in normals:
        within = np.eye(3) - np.outer(n, n)
        s = np.linalg.svd(within + SLOPE @ within, compute_uv=False)[:2] - 1
        density.append(LAW.shear * np.sum(s**2) + 0.5 * LAW.lame * np.sum(s) ** 2)
    exact = weights @ density
    assert strain_energy(field.solution, LAW) == pytest.approx(exact, rel=1e-11)
    assert field_strain_energy(field, membrane_rule(body, 0.2), LAW) == pytest.approx(exact, 1e-11)


def test_turning_a_membrane_costs_no_energy_and_changes_no_error():
    body = halved(roof)
    turn = np.linalg.qr(np.array([[1.0, 3, -1], [0.2, 1, 4], [2, -1, 0.5]]))[0]
    turn *= np.linalg.det(turn)
    still = halves(body, roof, 4, (turn - np.eye(3), SHIFT), (turn - np.eye(3), SHIFT))
    assert strain_energy(still.solution, LAW) < 1e-28
    rule = membrane_rule(body, 0.2)
    plain = [halves(body, roof, n, (g, SHIFT), REST) for n, g in ((4, SLOPE), (6, 0.5 * SLOPE))]
    turned = [
        halves(
            body, roof, n, (turn @ (np.eye(3) + g) - np.eye(3), SHIFT), (turn - np.eye(3), SHIFT)
        )
        for n, g in ((4, SLOPE), (6, 0.5 * SLOPE))
    ]
    one, other = energy_error(*plain, rule, LAW), energy_error(*turned, rule, LAW)
    assert other.absolute == pytest.approx(one.absolute, rel=1e-12)
    assert other.scale == pytest.approx(one.scale, rel=1e-12)


@SHAPES
def test_a_rigid_jump_is_measured_along_the_cut_of_a_membrane(shape):
    body = halved(shape)
    field = halves(body, shape, 4, (np.zeros((3, 3)), SHIFT), REST)
    still = halves(body, shape, 6, REST, REST, flip=True)
    rule = membrane_cut_rule(body, 0.1)
    # along the cut, square to it in the surface, and its length, on either side of the ridge
    pieces = []
    for left in (0.0, 0.5):
        ends = shape(np.array([left, left + 0.5]), line(np.array([left, left + 0.5])))
        along = (ends[1] - ends[0]) / (length := np.linalg.norm(ends[1] - ends[0]))
        aside = shape(np.array([left + 0.25]), np.array([0.9]))[0] - ends[0]
        square = aside - (aside @ along) * along
        pieces.append((length, square / np.linalg.norm(square)))
    size, whole = np.linalg.norm(SHIFT), sum(length for length, _ in pieces)
    assert jump_error(field, still, rule).absolute == pytest.approx(size * whole**0.5, rel=1e-8)
    profile = np.sqrt(sum(length * (SHIFT @ n) ** 2 for length, n in pieces))
    assert opening_error(still, field, rule).scale == pytest.approx(profile, rel=1e-8)
    largest = max(abs(SHIFT @ n) for _, n in pieces)
    found = opening_maximum_error(field, still, rule).absolute
    assert found == pytest.approx(largest, rel=1e-8)
    place = shape(np.array([0.25]), line(np.array([0.25])))[0]
    normal = SHIFT @ pieces[0][1]
    assert opening(field, body, "cut0", place, "normal") == pytest.approx(normal, rel=1e-10)
    rest = np.linalg.norm(SHIFT - normal * pieces[0][1])
    assert opening(field, body, "cut0", place, "tangential") == pytest.approx(rest, rel=1e-10)
    found = maximum_error(field, still, membrane_rule(body, 0.3))
    assert found.absolute == pytest.approx(size, rel=1e-12)


@SHAPES
@pytest.mark.parametrize("gap", [1e-3, 1e-9])
def test_a_jump_across_a_sliver_of_a_membrane_is_measured_on_its_own_cut(shape, gap):
    body = halved(shape, gaps=[gap])
    points, cells, layer = layers(shape, 4, [line, lambda x: line(x) + gap])
    moved = np.array([[0.0, 0, 0], [3.0, 4.0, 0], [6.0, 0.0, 0]])[layer]
    field, still = (field_of(membrane(points, cells, u), body) for u in (moved, 0 * moved))
    length = 2 * np.linalg.norm(np.diff(shape(np.array([0, 0.5]), np.array([0.3, 0.5])), axis=0))
    # |(3, 4, 0)| = 5 on both cuts, which are equally long
    found = jump_error(field, still, membrane_cut_rule(body, 0.1))
    assert found.absolute == pytest.approx(5 * np.sqrt(2 * length), rel=1e-8)
    only = field_of(membrane(points, cells, np.where(layer[:, None] == 1, moved, 0.0)), body)
    area = gap * (1.0 if shape is flat else np.hypot(0.8, 1))
    # rel: the width of the sliver, a difference of numbers near .5, is known to 1e-16
    tolerance = max(1e-8, 1e-15 / gap)
    found = displacement_error(only, still, membrane_rule(body, 0.15))
    assert found.absolute == pytest.approx(5 * np.sqrt(area), rel=tolerance)


def test_swapped_sides_of_a_membrane_show_as_a_jump_error_of_two():
    body = halved(roof)
    field = halves(body, roof, 4, (np.zeros((3, 3)), SHIFT), REST)

    class Swapped:
        def displacement(self, points, near=None):
            return field.displacement(points, 2 * points - near)

    rule = membrane_cut_rule(body, 0.2)
    assert jump_error(field, field, rule).relative == 0.0
    assert jump_error(Swapped(), field, rule).relative == pytest.approx(2.0, rel=1e-12)


def test_sides_of_a_cut_along_edges_are_the_triangles_beside_it():
    """A cut along edges of a bowl: the planes of the two sides are not one."""
    points, cells = grid(6, 6)
    body = cut_membrane(bowl(*points.T), cells, [upright(bowl, (-0.5, 0.5), (1.5, 0.5))])
    (lines,) = body.cuts.values()
    assert len(lines.ends) == 6
    assert not len(body.tips)
    x, y = np.linspace(0, 1, 7), np.full(7, 0.5)
    length = np.linalg.norm(np.diff(bowl(x, y), axis=0), axis=1).sum()
    assert lines.lengths.sum() == pytest.approx(length, rel=1e-13)
    for way, side in ((lines.positive, 1), (lines.negative, -1)):
        assert (side * way[:, 1] > 0.9).all()
    half = layers(bowl, 6, [lambda x: np.full_like(x, 0.5)])
    u = np.where(half[2][:, None] > 0, SHIFT, 0.0)
    field, still = (field_of(membrane(*half[:2], v), body) for v in (u, 0 * u))
    found = jump_error(field, still, membrane_cut_rule(body, 0.1)).absolute
    assert found == pytest.approx(np.linalg.norm(SHIFT) * length**0.5, rel=1e-10)


def test_tips_of_a_membrane_are_the_ends_of_its_cuts_inside_it():
    points, cells = grid(5, 5)
    a, b, c = (0.23, 0.31), (0.71, 0.64), (0.47, 0.475)  # c is on ab
    cuts = [upright(roof, a, b, "one"), upright(roof, c, (0.47, 1.3), "two")]
    body = cut_membrane(roof(*grid(6, 6)[0].T), grid(6, 6)[1], cuts)
    expected = roof(*np.array([a, b]).T)
    off = np.linalg.norm(body.tips[:, None] - expected, axis=2)
    assert body.tips.shape == (2, 3)
    assert off.min(axis=0).max() < 1e-12
    ridge = roof(np.array([a[0], 0.5, b[0]]), np.array([a[1], 0.495625, b[1]]))
    length = np.linalg.norm(np.diff(ridge, axis=0), axis=1).sum()
    assert near_radius(body) == pytest.approx(0.1 * length, rel=1e-9)
    assert body.has_cuts
    assert not cut_membrane(roof(*points.T), cells, []).has_cuts


class Smooth:
    """Smooth in space; its gradient is made tangential by the rule."""

    def displacement(self, points, near=None):
        x, y, z = points.T
        return 0.1 * np.column_stack([x * x * y, y * z - x**3, z * z * x])

    def gradient(self, points, near=None):
        x, y, z = points.T
        o = np.zeros_like(x)
        rows = [[2 * x * y, x * x, o], [-3 * x * x, z, y], [z * z, o, 2 * z * x]]
        return 0.1 * np.array(rows).transpose(2, 0, 1)


@pytest.mark.parametrize("n", [4, 8])
def test_the_estimated_integration_error_on_a_membrane_covers_the_true_one(n):
    body = halved(roof)
    points, cells, _ = layers(roof, n)
    field = field_of(membrane(points, cells, Smooth().displacement(points)), body)
    # the truth: a rule of degree 9 on the cells of the field itself
    at, weights = points_in(points[cells], 5)
    u, gradient = field.in_cells(at, np.repeat(np.arange(len(cells)), 25))
    true_l2 = np.sqrt(weights @ np.sum((u - Smooth().displacement(at)) ** 2, axis=1))
    corners = points[cells]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across = np.repeat(across / np.linalg.norm(across, axis=1)[:, None], 25, axis=0)
    along = np.cross(across, [0.0, 1, 0])
    along /= np.linalg.norm(along, axis=1)[:, None]
    frames = np.stack([along, np.cross(across, along), across], axis=1)

    def local(g):
        return np.einsum("nai,nij,nbj->nab", frames, g, frames[:, :2])

    expected = local(Smooth().gradient(at))
    density = LAW.error_density(local(gradient) - expected, expected)
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


def test_a_quadratic_field_on_triangles_in_space_is_reproduced():
    """Quadratic in the plan of a plane, with its tangential gradient, off the surface too."""
    plan, cells = quadratic(*grid(5, 4))
    points = flat(*plan.T)

    def truth(x, y):
        u = np.column_stack([x * y, x * x - y, 2 * y * y + x])
        o = np.zeros_like(x)
        slope = np.array([[y, x], [2 * x, o - 1], [o + 1, 4 * y]]).transpose(2, 0, 1)
        return u, slope @ TILTED[:2]

    field = SolutionField(membrane(points, cells.astype(np.int64), truth(*plan.T)[0], order=2))
    at = np.random.default_rng(2).random((300, 2))
    for lift in (0.0, 1e-3):
        u, gradient = field.evaluate(flat(*at.T) + lift * TILTED[2])
        assert np.abs(u - truth(*at.T)[0]).max() < 1e-13
        assert np.abs(gradient - truth(*at.T)[1]).max() < 1e-12


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
        rule = membrane_rule(body, 0.5 / n)
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


def test_cuts_that_do_not_part_a_membrane_in_two_are_refused():
    points, cells = grid(4, 4)
    surface = roof(*points.T), cells
    fold = [(0.5, -1, 0.4), (0.5, 2, 0.4), (-0.5, 2, 0.4), (-0.5, -1, 0.4)]  # touches the ridge
    with pytest.raises(UnsupportedSceneError, match="'touch' lies along a fold"):
        cut_membrane(*surface, [PolygonCut(kind="polygon", name="touch", points=fold)])
    lies = [(0, 0, 0), (0.5, 0, 0.4), (0.5, 1, 0.4), (0, 1, 0)]
    with pytest.raises(UnsupportedSceneError, match="in one of its triangles"):
        cut_membrane(*surface, [PolygonCut(kind="polygon", name="lies", points=lies)])
    with pytest.raises(UnsupportedSceneError, match="'beside' does not cross"):
        cut_membrane(*surface, [upright(roof, (2, 0), (3, 0), "beside")])
    disc = DiscCut(kind="disc", centre=(0.5, 0.5, 0.3), normal=(1, 0, 0), radius=0.2)
    with pytest.raises(UnsupportedSceneError, match="'disc' through a membrane"):
        cut_membrane(*surface, [disc])


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
    surface = membrane_rule(body, 0.1)
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
    assert body.cuts["bent"].lengths.sum() == pytest.approx(length, rel=1e-12)
    assert membrane_cut_rule(body, 0.1).weights.sum() == pytest.approx(length, rel=1e-12)
