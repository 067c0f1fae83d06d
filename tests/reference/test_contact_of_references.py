"""Contact of the faces of cuts: exact fields by their residuals, the reference against them."""

import numpy as np
import pytest
import scenes
from fourth_order import difference
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from reference.contact import FaceContact, TurningContact, pressures
from reference.exact import exact_of, exact_solution
from reference.meshing import Grading, conforming_mesh
from reference.space import conforming_space
from verify.errors import InputError
from verify.scene import Material, load_scene
from verify.solvers.conforming import ConformingSolver, ReferenceSolver

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


def test_an_inclined_impact_is_the_same_turned_and_halves_that_touch_move_beyond_their_faces():
    turn = np.array([[0.6, 0.8], [-0.8, 0.6]])  # rows: along the bar, across
    bar, inclined = (
        exact_solution("impact", {**IMPACT, **more}, BAR).at(0.3)
        for more in ({}, {"axis": (3.0 * turn[0]).tolist()})
    )
    points = np.random.default_rng(5).uniform(-0.3, 0.7, (40, 2))
    for name in ("displacement", "velocity"):
        expected = getattr(bar, name)(points) @ turn
        np.testing.assert_allclose(getattr(inclined, name)(points @ turn), expected, atol=1e-15)
    expected = turn.T @ bar.gradient(points) @ turn
    np.testing.assert_allclose(inclined.gradient(points @ turn), expected, atol=1e-15)
    np.testing.assert_allclose(inclined.cut_plane[1], turn[0], atol=1e-15)
    with pytest.raises(InputError, match="axis is zero"):
        exact_solution("impact", {**IMPACT, "axis": [0.0, 0.0]}, BAR)
    # unknowns of the lower half on the other side, where a mesh has them: no wave has begun
    for gap in (0.0, 0.01):
        start = exact_solution("impact", {**IMPACT, "gap": gap}, BAR).at(0.0)
        beyond, near = np.array([[0.31, 0.0]]), np.array([[0.19, 0.0]])
        for name in ("displacement", "velocity", "gradient"):
            field = getattr(start, name)
            np.testing.assert_allclose(field(beyond, near), field(near, near), atol=1e-15)


LINES = [
    {"kind": "polyline", "name": "one", "points": [[-0.1, 0.31], [1.1, 0.74]]},
    {"kind": "polyline", "name": "other", "points": [[0.37, -0.1], [0.62, 1.1]]},
]
PLANE = {"kind": "polygon", "points": [[-0.2, -0.2, 0.3], [1.2, -0.2, 0.5], [1.2, 1.2, 0.7],
                                       [-0.2, 1.2, 0.5]]}  # fmt: skip
INNER = {"kind": "polygon", "points": [[0.2, 0.2, 0.3], [0.8, 0.2, 0.5], [0.8, 0.8, 0.7],
                                       [0.2, 0.8, 0.5]]}  # fmt: skip


def pressed(cuts, d, name, parameters, geometry=None, cells=5):
    """Scene with contact whose boundary is moved by an exact field."""
    return scenes.scene(
        cuts, d, contact={"expected": "closed"}, geometry=geometry or scenes.box([1.0] * d),
        supports=[{"where": "boundary", "displacement": "exact"}],
        exact={"solution": name, "parameters": parameters}, mesh={"cells": [[cells] * d]},
    )  # fmt: skip


@pytest.mark.fenicsx
@pytest.mark.parametrize(
    "cuts, d, degree", [(LINES, 2, 1), (LINES, 2, 2), ([PLANE], 3, 1), ([INNER], 3, 2)]
)
def test_faces_under_hydrostatic_pressure_pass_it_on_as_if_uncut(cuts, d, degree):
    """Any cut, the uncut field, the pressure of the stress at every point."""
    strain = -0.1 * np.eye(d)
    scene = pressed(cuts, d, "linear", {"matrix": strain.tolist(), "shift": [0.0] * d}, cells=3)
    found = ConformingSolver().solve(scene, 0, 0, degree=degree, mesh="remeshed")
    exact = exact_of(scene)
    wanted = -exact.stress(np.zeros((1, d)))[0, 0, 0]
    np.testing.assert_allclose(found.displacement[0], exact.displacement(found.points), atol=1e-14)
    np.testing.assert_allclose(found.contact.pressure, wanted, rtol=1e-12)
    facets = found.cut_facets
    edges = np.moveaxis(facets[:, 1:] - facets[:, :1], 1, 0)
    size = np.linalg.norm(edges[0] if d == 2 else 0.5 * np.cross(*edges), axis=1).sum()
    # P1: facets whose corners are all held have no gap that a pressure could close
    assert 0.93 * size < found.contact.weights.sum() < (1 + 1e-12) * size


@pytest.mark.fenicsx
def test_both_faces_at_a_bend_of_a_cut_are_kept_apart():
    """Pushed along, one leg of a bent cut closes and the other opens: no mean of both counts."""
    bend, ends = np.array([0.47, 0.52]), np.array([[-0.1, 0.31], [1.1, 0.2]])
    line = {"kind": "polyline", "points": [ends[0].tolist(), bend.tolist(), ends[1].tolist()]}
    scene = scenes.scene(
        [line], contact={"expected": "closed"}, mesh={"cells": [[5, 5]]},
        supports=[{"where": "bottom", "displacement": [0.0, 0.0]},
                  {"where": "top", "displacement": [0.04, -0.01]}],
    )  # fmt: skip
    found = ConformingSolver().solve(scene, 0, 0, mesh="remeshed")
    nodes = np.flatnonzero(np.linalg.norm(found.points - bend, axis=1) < 1e-9)
    middle = found.points[found.cells].mean(axis=1)[:, 1]
    height = [middle[(found.cells == node).any(axis=1)].mean() for node in nodes]
    below, above = nodes[np.argsort(height)]
    jump = found.displacement[0][above] - found.displacement[0][below]
    legs = np.stack([bend - ends[0], ends[1] - bend])
    normals = np.stack([-legs[:, 1], legs[:, 0]], axis=1)
    gaps = normals @ jump / np.linalg.norm(legs, axis=1)
    assert gaps.min() > -1e-12
    assert gaps.max() > 1e-3


@pytest.mark.fenicsx
def test_drawn_faces_are_free_and_what_contact_adds_is_nothing():
    strain = 0.1 * np.eye(2)
    closed = pressed(LINES, 2, "linear", {"matrix": strain.tolist(), "shift": [0.0, 0.0]})
    open_ = closed.model_copy(update={"contact": scenes.scene().contact})
    with_contact, without = (ConformingSolver().solve(s, 0, 0) for s in (closed, open_))
    np.testing.assert_array_equal(with_contact.displacement, without.displacement)
    assert not with_contact.contact.pressure.any()
    assert without.contact is None


def crack(name, given, cells):
    points = [(np.array(given["centre"]) + s * given["a"] * ALONG).tolist() for s in (-1, 1)]
    box = scenes.box([1.5, 1.5], [-1.5, -1.5])
    return pressed([{"kind": "polyline", "points": points}], 2, name, given, box, cells)


def errors_on(found, scene):
    """Relative L2 error of the pressure, error of the extent in crack lengths, and overlap."""
    exact, contact = exact_of(scene), found.contact
    stress = exact.stress(contact.points, contact.points + 1e-9 * ACROSS)
    wanted = np.maximum(-(stress @ ACROSS @ ACROSS), 0.0)
    (got,), weights = contact.pressure, contact.weights
    error = np.sqrt(weights @ (got - wanted) ** 2 / (weights @ wanted**2))
    extent = weights[got > 1e-3 * got.max()].sum() / 1.2
    return error, extent


@pytest.mark.fenicsx
def test_the_reference_finds_the_uniform_pressure_of_a_closed_crack():
    scene = crack("closed_crack", CLOSED, 8)
    error, extent = errors_on(ReferenceSolver().solve(scene, 0, 0), scene)
    assert error < 2e-3  # at the tips alone: elements of 1e-3 of the others
    assert extent == pytest.approx(1.0)


@pytest.mark.fenicsx
def test_the_reference_finds_the_pressure_and_the_zone_of_a_partly_closed_crack():
    """The zone ends at a third, known to an element; half the elements, half the error."""
    errors = []
    for level in (0, 1):
        scene = crack("partly_closed_crack", PARTLY, 8)
        found = ReferenceSolver().solve(scene, level, 0)
        error, extent = errors_on(found, scene)
        size = found.contact.weights.max() / 1.2
        assert abs(extent - 1 / 3) <= size
        errors.append(error)
    assert errors[1] < 0.1
    assert errors[0] / errors[1] > 1.5


def test_pressures_are_those_of_the_quadratic_program():
    """On random problems against non-negative least squares, which knows no active sets."""
    rng = np.random.default_rng(7)
    for count in (1, 3, 20, 60):
        half = rng.normal(size=(count, count + 3))
        matrix, gaps = half @ half.T, rng.normal(size=count)
        found, _ = pressures(matrix, gaps)
        lower = np.linalg.cholesky(matrix)
        wanted, _ = nnls(lower.T, np.linalg.solve(lower, -gaps))
        np.testing.assert_allclose(found, wanted, atol=1e-8 * max(wanted.max(), 1.0))
    assert pressures(np.eye(3), np.array([0.0, 1.0, 2.0]))[0].tolist() == [0.0, 0.0, 0.0]


@pytest.mark.fenicsx
def test_halves_that_meet_never_gain_energy_and_exchange_their_velocities():
    """The work of contact over a step is p·(g₊ − g) = −p·g, at any step and on any mesh."""
    scene = load_scene("contact/impact")
    found = ConformingSolver().solve(scene, 1, 0)
    energy = found.ledger["kinetic"] + found.ledger["strain"]
    assert energy.max() <= energy[0] * (1 + 1e-10)
    assert energy[-1] >= 0.98 * energy[0]
    right = found.points[found.cells].mean(axis=1)[:, 0] > 1.0
    mean = found.velocity[-1][found.cells[right], 0].mean()
    assert mean == pytest.approx(1e-3, rel=1 / 16)  # the front is as wide as an element
    together = found.contact.pressure.max(axis=1) > 0.0
    meets = (found.times > 0.5) & (found.times < 2.5)
    known = np.abs(found.times - 2.5) > 0.1  # when they part
    np.testing.assert_array_equal(together[known], meets[known])


@pytest.mark.fenicsx
def test_a_damped_scheme_finds_the_pressure_of_the_impact():
    """ρ c v at the times between the first and the last two elements' passages."""
    scene = load_scene("contact/impact")
    found = ConformingSolver().solve(scene, 1, 0, scheme="generalised_alpha", spectral_radius=0.5)
    steady = (found.times > 1.1) & (found.times < 2.1)
    np.testing.assert_allclose(found.contact.pressure[steady], 1e-3, rtol=0.02)
    assert (found.contact.pressure[(found.times < 0.45) | (found.times > 2.8)] == 0.0).all()


def turned(points, d):
    """Places of points after a turn by 130° about an odd axis, and the turn."""
    axis = np.array([0.0, 0.0, 1.0] if d == 2 else [0.6, -0.48, 0.64])
    R = Rotation.from_rotvec(np.deg2rad(130.0) * axis).as_matrix()[:d, :d]
    return points @ R.T + 0.3, R


@pytest.mark.fenicsx
@pytest.mark.parametrize("d, degree", [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_gaps_that_turn_are_objective_and_their_forces_turn_nothing(d, degree):
    cuts = LINES if d == 2 else [PLANE]
    scene = scenes.scene(cuts, d, mesh={"cells": [[3] * d]})
    mesh = conforming_mesh(scene, Grading(0.4, np.zeros((0, d)), 0.5))
    space = conforming_space(mesh, degree)
    faces, linear = (kind(space, np.zeros(0, np.int32)) for kind in (TurningContact, FaceContact))
    random, points = np.random.default_rng(d), space.node_points
    before, other = (0.05 * random.uniform(-1.0, 1.0, points.shape) for _ in "ab")
    R = turned(points, d)[1]
    after = turned(points + other, d)[0] - points
    gaps = faces.opened(other.ravel())
    size = np.abs(gaps).max()
    assert np.abs(faces.opened(after.ravel()) - gaps).max() < 1e-13 * size
    # work of unit pressures is the change of the gaps, from any place to any other
    slopes = faces.slopes(before.ravel(), after.ravel())
    change = gaps - faces.opened(before.ravel())
    assert np.abs(slopes @ (after - before).ravel() - change).max() < 1e-12 * size
    forces = (slopes.T @ random.uniform(0.0, 1.0, len(gaps))).reshape(-1, d)
    middle = points + 0.5 * (before + after)
    moments = [middle[:, i] @ forces[:, j] - middle[:, j] @ forces[:, i]
               for i in range(d) for j in range(i)]  # fmt: skip
    assert np.abs([*forces.sum(axis=0), *moments]).max() < 1e-13 * np.abs(forces).sum()
    # and with equal ends the derivative, which turns with the body
    way = random.uniform(-1.0, 1.0, points.shape)
    found = faces.slopes(after.ravel(), after.ravel()) @ (way @ R.T).ravel()
    nudge = 1e-6 * way
    ends = [faces.opened((other + sign * nudge).ravel()) for sign in (1.0, -1.0)]
    assert np.abs(found - (ends[0] - ends[1]) / 2e-6).max() < 1e-8 * np.abs(found).max()
    pressed = random.uniform(0.0, 1.0, len(gaps))
    ends = [faces.slopes(end, end).T @ pressed
            for end in (after.ravel() + sign * nudge.ravel() for sign in (1.0, -1.0))]  # fmt: skip
    second = faces.turning(after.ravel(), pressed) @ way.ravel()
    assert np.abs(second - (ends[0] - ends[1]) / 2e-6).max() < 1e-7 * np.abs(second).max()
    off = [np.abs(faces.opened(share * way.ravel()) - linear.opened(share * way.ravel())).max()
           for share in (1e-3, 5e-4)]  # fmt: skip
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)  # of second order


@pytest.mark.fenicsx
def test_the_pressure_at_the_start_of_a_motion_is_the_pressure_at_rest():
    squeezed = [{"where": "bottom", "displacement": [0.0, 0.0]},
                {"where": "top", "displacement": [0.0, -0.01]}]  # fmt: skip
    given = {"contact": {"expected": "closed"}, "supports": squeezed,
             "material": scenes.soft(density=1.0)}  # fmt: skip
    rest = ConformingSolver().solve(scenes.scene(LINES[:1], **given), 0, 0)
    motion = {"kind": "dynamic", "duration": 0.1, "outputs": 2}
    initial = {"kind": "equilibrium", "cuts": "open"}
    moving = scenes.scene(LINES[:1], analysis=motion, initial=initial, **given)
    found = ConformingSolver().solve(moving, 0, 0)
    assert rest.contact.pressure.max() > 0.005
    np.testing.assert_allclose(
        found.contact.pressure[0], rest.contact.pressure[0], rtol=1e-9, atol=1e-12
    )


@pytest.mark.fenicsx
def test_pressures_that_grow_slowly_are_those_at_rest_at_the_same_time():
    """Of tiny displacements, in proportion at finite rotation too; a step of delay is 4 to 5 %.

    Steps are much longer than a period. With closed cuts at the start the body rings at first.
    """
    drawn = {"contact": {"expected": "closed"}, "material": scenes.soft(density=1e-6)}
    held = {"where": "bottom", "displacement": [0.0, 0.0]}

    def force(**given):
        top = {"where": "top", "displacement": [0.0, "-1e-5 * (1 + t*t)"]}
        if not given:
            top["displacement"] = [0.0, -1e-5]
        scene = scenes.scene(LINES[:1], supports=[held, top], **drawn, **given)
        found = ConformingSolver().solve(scene, 0, 0).contact
        return found.pressure @ found.weights

    for kinematics, cuts, within in (("linear", "open", 3e-3), ("corotational", "closed", 1.5e-2)):
        motion = {"kind": "dynamic", "kinematics": kinematics, "duration": 1.0, "time_step": 0.05,
                  "outputs": 3}  # fmt: skip
        found = force(analysis=motion, initial={"kind": "equilibrium", "cuts": cuts})
        np.testing.assert_allclose(found[1:], np.array([1.25, 2.0]) * force(), rtol=within)


SPINNING = ["-0.15*y - 0.02*x", "0.15*x"]
HALF_TURN = ["-2*x", "-2*y"]


def spinning(velocity, **initial):
    """A bar across the mesh's lines that spins as its halves are pressed together."""
    return scenes.scene(
        [{"kind": "polyline", "points": [[0.17, -0.4], [0.03, 0.4]]}],
        geometry=scenes.box([1.0, 0.25], [-1.0, -0.25]), mesh={"cells": [[12, 3]]},
        material=scenes.soft(density=1.0), supports=[], contact={"expected": "closed"},
        initial={"kind": "field", "velocity": velocity, **initial},
        analysis={"kind": "dynamic", "kinematics": "finite_rotation", "duration": 3.0,
                  "outputs": 7, "time_step": 0.1},
    )  # fmt: skip


@pytest.mark.fenicsx
@pytest.mark.parametrize("given", [{"degree": 2, "mesh": "remeshed"}, {}])
def test_halves_pressed_together_as_they_spin_keep_their_spin_and_part_alike_at_any_angle(given):
    reference = {"scheme": "energy_momentum", **given}
    found = ConformingSolver().solve(spinning(SPINNING), 0, 0, **reference)
    energy = found.ledger["kinetic"] + found.ledger["strain"]
    assert energy.max() <= energy[0] * (1 + 1e-12)
    assert energy[-1] > 0.999 * energy[0]
    turn = np.array(found.ledger["angular_momentum_z"])
    assert np.abs(turn - turn[0]).max() < 1e-12 * turn[0]
    mean = found.contact.pressure @ found.contact.weights / found.contact.weights.sum()
    # E (0.02 t − ω² t²/2) but for waves from the sides, until one is there from the ends
    assert 0.005 < mean[1] < 0.01
    assert found.contact.pressure[-1].max() == 0.0
    opposite = [f"-({one})" for one in SPINNING]
    other = ConformingSolver().solve(spinning(opposite, displacement=HALF_TURN), 0, 0, **reference)
    places = found.points + found.displacement
    np.testing.assert_allclose(other.points + other.displacement, -places, atol=1e-8)
