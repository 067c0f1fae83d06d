"""Motion of cut bodies: waves from a cut, periods, free fall, and a ledger that closes."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx

from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from verify.errors import InputError
from verify.scene import Material

pytestmark = needs_fenicsx

TISSUE = Material(young=1e4, poisson=0.3, plane="strain", density=1000.0)
WAVE = 3.668997  # of pressure waves, m/s
HALF, STRAIN = 0.5, 0.01
MIDDLE = np.array([[0.0, -1.0], [0.0, 1.0]])


def spaces(lower, upper, counts, cut, degree=1):
    """Give one mesh twice: with its cut closed, and open."""
    from reference.space import conforming_space

    points, cells, facets = imprint(*structured_triangles(lower, upper, counts), [cut])
    none = np.zeros((0, 2), dtype=np.int64)
    return [conforming_space(open_cut(points, cells, f), degree) for f in (none, facets)]


def opened_bar(n=200, degree=1):
    """Give a prestrained bar that slides between walls, cut in the middle at t = 0."""
    from reference.dynamics import inherit

    closed, opened = spaces((-HALF, 0.0), (HALF, 0.02), (n, 2), MIDDLE, degree)
    stretched = closed.node_points * [STRAIN, 0.0]
    x = opened.node_points[:, 0]
    ends = np.flatnonzero(np.abs(x) > HALF - 1e-9)
    held = np.concatenate([2 * ends, 2 * np.arange(len(x)) + 1]).astype(np.int32)
    return opened, held, inherit(closed, opened, stretched)


def face(space):
    """Nodes of the right face of the cut."""
    right = np.unique(space.cell_nodes[space.centroids[:, 0] > 0])
    return right[np.abs(space.node_points[right, 0]) < 1e-12]


def test_the_faces_of_a_cut_fly_apart_at_the_speed_of_the_wave_and_return_after_its_period():
    from reference.dynamics import LinearMotion, generalised_alpha

    space, held, start = opened_bar()
    motion = LinearMotion(TISSUE, space, held, start, 0 * start)
    step = 4 * HALF / WAVE / 400
    history = list(motion.run(generalised_alpha(0.9), step, 800))
    nodes = face(space)
    time = np.array([m.time for m in history])
    velocity = np.array([m.velocity[nodes, 0].mean() for m in history])
    place = np.array([m.displacement[nodes, 0].mean() for m in history])
    # the right face retracts to the right with c_d ε₀, then comes back as fast
    going = (time > 0.02 * 0.545) & (time < 0.48 * 0.545)
    assert np.median(velocity[going]) == pytest.approx(0.0366899693, rel=0.01)
    back = (time > 0.52 * 0.545) & (time < 0.98 * 0.545)
    assert np.median(velocity[back]) == pytest.approx(-0.0366899693, rel=0.01)
    # the face is back where it was after a whole period
    around = (time > 0.75 * 0.545) & (time < 1.25 * 0.545)
    returned = time[around][np.argmin(place[around])]
    assert returned == pytest.approx(0.545108115, rel=0.01)


@pytest.mark.parametrize("degree", [1, 2])
def test_the_trapezoidal_rule_keeps_the_energy_of_an_opened_bar(degree):
    from reference.dynamics import LinearMotion, generalised_alpha

    space, held, start = opened_bar(40, degree)
    history = list(
        LinearMotion(TISSUE, space, held, start, 0 * start).run(generalised_alpha(), 1e-3, 500, 50)
    )
    # the cut costs nothing: the energy of the uniform strain, ½ (λ+2μ) ε² per area
    assert history[0].strain == pytest.approx(0.5 * 1000 * WAVE**2 * STRAIN**2 * 0.02, rel=1e-6)
    lost = [m.dissipated / history[0].strain for m in history]
    assert np.abs(lost).max() < 1e-10


def test_implicit_euler_loses_what_theory_says_of_each_mode():
    from reference.dynamics import LinearMotion, implicit_euler
    from reference.vibration import lowest_frequencies

    space, _ = spaces((0.0, 0.0), (1.0, 0.2), (20, 4), np.array([[0.5, -1], [0.5, 1]]), 2)
    clamp = np.flatnonzero(space.node_points[:, 0] < 1e-12)
    held = (2 * clamp[:, None] + [0, 1]).ravel().astype(np.int32)
    mode = lowest_frequencies(TISSUE, space, held, 1)
    omega, step = mode.frequencies[0], 0.2
    motion = LinearMotion(TISSUE, space, held, mode.modes[0], 0 * mode.modes[0])
    first, last = list(motion.run(implicit_euler(), step, 50, 50))
    energy = (last.kinetic + last.strain) / first.strain
    assert energy == pytest.approx((1 + (omega * step) ** 2) ** -50, rel=1e-6)
    assert last.dissipated == pytest.approx(first.strain - last.kinetic - last.strain, rel=1e-12)


@pytest.mark.parametrize("rho, fall", [(1.0, -1.225), (0.5, -1.225), (None, -1.2495)])
def test_a_freed_half_falls_with_the_parabola_of_its_scheme(rho, fall):
    import ufl
    from dolfinx import fem

    from reference.dynamics import LinearMotion, generalised_alpha, implicit_euler

    _, space = spaces((0.0, 0.0), (1.0, 1.0), (8, 8), np.array([[-0.1, 0.47], [1.1, 0.53]]))
    top = np.flatnonzero(space.node_points[:, 1] > 1 - 1e-12)
    held = (2 * top[:, None] + [0, 1]).ravel().astype(np.int32)
    weight = fem.Constant(space.function_space.mesh, np.array([0.0, -9800.0]))
    at_rest = np.zeros_like(space.node_points)
    motion = LinearMotion(
        TISSUE, space, held, at_rest, at_rest, lambda v: ufl.inner(weight, v) * ufl.dx
    )
    scheme = implicit_euler() if rho is None else generalised_alpha(rho)
    *_, last = motion.run(scheme, 0.01, 50, 50)
    lower = np.unique(space.cell_nodes[space.centroids[:, 1] < 0.45])
    assert last.displacement[lower] == pytest.approx(
        np.tile([0.0, fall], (len(lower), 1)), abs=1e-9
    )
    # the work of the weight is in the ledger: both sides of the balance are of its size
    assert last.kinetic + last.strain + last.dissipated == pytest.approx(last.work, rel=1e-12)


def test_stiffness_damping_takes_energy_and_never_gives():
    from reference.dynamics import LinearMotion, generalised_alpha

    space, held, start = opened_bar(40)
    motion = LinearMotion(TISSUE, space, held, start, 0 * start, damping=(0.1, 1e-4))
    lost = [m.dissipated for m in motion.run(generalised_alpha(), 1e-3, 200)]
    assert (np.diff(lost) > -1e-12 * lost[-1]).all()
    assert lost[-1] > 0


def test_a_state_is_not_carried_over_to_another_mesh():
    from reference.dynamics import inherit

    closed, _ = spaces((-1.0, 0.0), (1.0, 1.0), (4, 4), MIDDLE)
    other, _ = spaces((-1.0, 0.0), (1.0, 1.0), (6, 4), MIDDLE)
    with pytest.raises(InputError, match="does not have the cells"):
        inherit(closed, other, closed.node_points)
