"""Faces of a cut that touch: exact fields, slivers, and the bound by which the method is stable."""

import numpy as np
import pytest
from cut_bodies import material, rotation, shaken
from scipy.linalg import eigh
from xfem_bodies import boundary_nodes, sparse_stiffness

import verify.xfem as xfem
from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.block_pattern import body_pattern
from verify.xfem.closing import STABILITY, ClosingFaces, solve_closed
from verify.xfem.energy_balance import BalanceRecorder
from verify.xfem.explicit import SymplecticEuler
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.loads_and_supports import UnsupportedBodyError
from verify.xfem.real_time import RealTimeEuler

NU, P = 0.3, 0.01
SHEAR = 0.5 / (1.0 + NU)
KOLOSOV = 3.0 - 4.0 * NU


def grid(dim, n, seed=1):
    """A mesh whose inner nodes are moved at random, so that it has no lines."""
    mesh = xfem.rectangle_mesh((n, n)) if dim == 2 else xfem.box_mesh((n, n, n))
    points, inner = mesh.points.copy(), np.ones(len(mesh.points), dtype=bool)
    inner[boundary_nodes(mesh)] = False
    random = np.random.default_rng(seed).uniform(-1.0, 1.0, points.shape)
    points[inner] += 0.2 * mesh.measures.mean() ** (1 / dim) * random[inner]
    return xfem.SimplexMesh(points, mesh.cells)


def soft(dim):
    return material(dim, 1.0)


def closed(mesh, cuts, field, tip="inside"):
    """Equilibrium with a field (points, points inside the material) as boundary values."""
    phantom = xfem.cut_mesh(mesh, cuts, tip)
    exact = field(phantom.node_points, phantom.node_piece_points)
    outer = np.zeros(len(mesh.points), dtype=bool)
    outer[boundary_nodes(mesh)] = True
    fixed = np.repeat(outer[phantom.node_parent, None], mesh.dim, axis=1)
    faces = ClosingFaces(phantom, soft(mesh.dim))
    force = xfem.InternalForce(phantom, soft(mesh.dim), "linear")
    supports = xfem.Supports(fixed, np.where(fixed, exact, 0.0))
    return phantom, faces, solve_closed(force, faces, supports), exact


def misses(faces, pressure, exact):
    """Error of the pressure in L2, and the largest, over the exact one."""
    of = (faces.weights * exact**2).sum()
    error = (faces.weights * (pressure - exact) ** 2).sum()
    return np.sqrt(error / of), np.abs(pressure - exact).max() / exact.max()


def overlap(faces, displacement):
    return -np.einsum("fqid,fid->fq", faces.gap, displacement[faces.nodes]).min()


BENT = xfem.Polyline([[-0.1, 0.2], [0.3, 0.3], [0.6, 0.55], [0.8, 1.1]])
CUTS = {
    "none": (2, []),
    "crossing": (2, [xfem.Plane([0.47, 0.47], [0.6, 0.8]), BENT]),
    "ends inside": (2, [xfem.Polyline([[0.21, 0.33], [0.77, 0.58]])]),
    "along faces": (2, [xfem.Plane([0.5, 0.5], [0.0, 1.0])]),
    "two in space": (
        3,
        [xfem.Plane([0.47] * 3, [0.5, 0.6, 0.62]), xfem.Plane([0.6] * 3, [1, -0.3, 0.2])],
    ),
}


@pytest.mark.parametrize("name", CUTS)
def test_under_pressure_from_all_sides_a_cut_is_not_felt(name):
    dim, cuts = CUTS[name]
    mesh = xfem.rectangle_mesh((6, 6)) if name == "along faces" else grid(dim, 7 if dim == 2 else 4)
    lame = NU / ((1.0 + NU) * (1.0 - 2.0 * NU))
    strain = -P / (dim * lame + 2.0 * SHEAR)
    _, _faces, found, exact = closed(mesh, cuts, lambda x, _: strain * x)
    assert np.abs(found.displacement - exact).max() < 1e-12 * np.abs(exact).max()
    assert np.abs(found.pressure / P - 1.0).max(initial=0.0) < 1e-10


def bending(normal, origin):
    """σ = −p (1 + b·t) n ⊗ n, t along the cut: its displacement, and its pressure on the cut."""
    d = len(normal)
    basis = np.linalg.qr(np.column_stack([normal, np.eye(d)[:, : d - 1]]))[0]
    n, along = normal, basis[:, 1:]
    b = np.array([0.7, -0.4][: d - 1])
    # strains along the normal and along the cut, over the stress (E = 1)
    across, beside = (1.0 - NU**2, -NU * (1.0 + NU)) if d == 2 else (1.0, -NU)

    def field(x, _):
        z, t = (x - origin) @ n, (x - origin) @ along
        u = t + t * (t @ b)[:, None] - 0.5 * (t**2).sum(axis=1)[:, None] * b
        u = beside * u - 0.5 * across * z[:, None] ** 2 * b
        return -P * ((across * z * (1.0 + t @ b))[:, None] * n + u @ along.T)

    return field, lambda x: P * (1.0 + ((x - origin) @ along) @ b)


def by_sliver(dim, n, direction, share):
    """Errors of displacement and pressure with a cut a share of h beside a node."""
    mesh, direction = grid(dim, n), np.array(direction) / np.linalg.norm(direction)
    node = mesh.points[((mesh.points - 0.5) ** 2).sum(axis=1).argmin()]
    origin = node + share / n * direction
    field, pressure = bending(direction, origin)
    phantom, faces, found, exact = closed(mesh, [xfem.Plane(origin, direction)], field)
    at, inside = phantom.node_points, phantom.node_piece_points
    real = np.sign((at - origin) @ direction) == np.sign((inside - origin) @ direction)
    error = np.linalg.norm((found.displacement - exact)[real]) / np.linalg.norm(exact[real])
    truth, averaged = pressure(faces.points), faces.averaged(found.pressure)
    return error, *misses(faces, found.pressure, truth), *misses(faces, averaged, truth)


@pytest.mark.parametrize(("dim", "n", "direction"), [(2, 8, [0.3, 1.0]), (3, 3, [0.2, 0.35, 1.0])])
def test_errors_of_displacement_and_pressure_do_not_grow_with_a_sliver(dim, n, direction):
    # twice: the cut goes elsewhere through its cells, as on another mesh of the same size
    usual = np.array(by_sliver(dim, n, direction, 0.5))
    for share in (1e-2, 1e-6, 1e-12):
        assert (np.array(by_sliver(dim, n, direction, share)) < 2.0 * usual).all(), share


def test_pressure_converges_with_the_first_order_beside_a_sliver():
    errors = np.array([by_sliver(2, n, [0.3, 1.0], 1e-9) for n in (8, 16, 32)])
    rates = np.log2(errors[0] / errors[-1]) / 2.0
    assert rates[0] > 1.8
    assert (rates[1:3] > 0.9).all()
    # at the ends of the cut a mean is of one side: order 1 there, and 3/2 in the mean square
    assert rates[3] > 1.4
    assert rates[4] > 0.9
    assert (errors[:, 3:] < errors[:, 1:3]).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_stress_on_faces_is_bounded_by_the_energy(seed):
    # ∫ σ²/γ ≤ a(u, u)/c for every u, or a body whose faces are apart has no stable equilibrium
    random, dim = np.random.default_rng(seed), 2 + seed % 2
    mesh = grid(dim, 5 if dim == 2 else 2)
    planes = [
        xfem.Plane(mesh.points[k] + 10.0 ** -random.uniform(2, 12), random.normal(size=dim))
        for k in random.integers(len(mesh.points), size=3)
    ]
    phantom = xfem.cut_mesh(mesh, planes)
    faces = ClosingFaces(phantom, soft(dim))
    pattern = body_pattern(phantom, faces.couplings)
    blocks = np.zeros((len(pattern.columns), dim, dim))
    faces.add_stiffness(pattern, blocks, False)
    K, own = sparse_stiffness(phantom).toarray(), pattern.matrix(blocks).toarray()
    scale = 1.0 / np.sqrt(np.diag(K))
    K, own = (scale[:, None] * one * scale for one in (K, own))
    largest = eigh(-own, K + 1e-10 * np.eye(len(K)), eigvals_only=True)[-1]
    assert 0.02 < largest < 1.0 / STABILITY


def westergaard(x):
    """Stress function of a crack that σ_yy → σ′x closes from −a to −a/3, and its integral.

    Z = σ′(ξ − c/2)√((ξ + c)/(ξ − c)), c = 2a/3, ξ = z − a/3.
    """
    c, xi = 2.0 / 3.0, x[..., 0] - 1.0 / 3.0 + 1j * x[..., 1]
    root = np.sqrt(xi - c) * np.sqrt(xi + c)
    return P * (xi - 0.5 * c) * (xi + c) / root, 0.5 * P * (xi + c) * root


def partly(n):
    """A crack −1 < x < 1, turned and moved; the sign of y on it is that of the material."""
    origin, R = 0.013, rotation(2, 0.4)

    def local(x):
        return (x - origin) @ R

    def field(x, inside):
        own, side = local(x), local(inside)[:, 1]
        y = np.where(own[:, 1] * side > 0.0, own[:, 1], np.copysign(1e-14, side))
        Z, integral = westergaard(np.column_stack([own[:, 0], y]))
        u = 0.5 * (KOLOSOV - 1.0) * integral.real - y * Z.imag
        v = 0.5 * (KOLOSOV + 1.0) * integral.imag - y * Z.real
        return np.stack([u, v], axis=1) @ R.T / (2.0 * SHEAR)

    crack = xfem.Polyline(np.array([[-1.0, 0.0], [1.0, 0.0]]) @ R.T + origin)
    mesh = shaken(xfem.rectangle_mesh((n, n), (-2.0, -2.0), (2.0, 2.0)), 1, 0.15)
    _phantom, faces, found, exact = closed(mesh, [crack], field)
    at = local(faces.points)
    pressure = np.maximum(0.0, -westergaard(at * [1.0, 0.0])[0].real)
    touching = at[..., 0][found.pressure > 1e-3 * found.pressure.max()]
    error = np.linalg.norm(found.displacement - exact) / np.linalg.norm(exact)
    wrong = misses(faces, faces.averaged(found.pressure), pressure)[0]
    depth = overlap(faces, found.displacement)
    return 4.0 / n, touching.max() + 1.0 / 3.0, error, wrong, depth


def test_a_partly_closed_crack_opens_where_it_shall():
    h, end, error, pressure, depth = np.array([partly(n) for n in (20, 40, 80)]).T
    assert (np.abs(end) < h).all()
    assert (depth < 0.1 * P * h).all()
    assert np.log2(depth[0] / depth[-1]) / 2.0 > 1.0
    # It ends in a root: what an element there is off by is of order 1.
    assert np.log2(pressure[0] / pressure[-1]) / 2.0 > 0.9
    assert pressure[-1] < 0.05
    # as the un-enriched end allows
    assert np.log2(error[0] / error[-1]) / 2.0 > 0.6


def sheared(n, seed):
    """A crack −1 < x < 1 anywhere, under pressure P across it and P/2 along it, on a mesh of 2/n.

    Mean errors of the pressure at the crack, and in L2 farther than a quarter from its ends: as it
    is at the points, and averaged.
    """
    random = np.random.default_rng(seed)
    origin, R = random.uniform(-0.1, 0.1, 2), rotation(2, random.uniform(0.0, 1.5))
    lame = NU / ((1.0 + NU) * (1.0 - 2.0 * NU))

    def field(x, inside):
        own, side = (x - origin) @ R, ((inside - origin) @ R)[:, 1]
        y = np.where(own[:, 1] * side > 0.0, own[:, 1], np.copysign(1e-14, side))
        z = own[:, 0] + 1j * y
        root = np.sqrt(z - 1.0) * np.sqrt(z + 1.0)
        Z, integral = 0.5 * P * z / root, 0.5 * P * root
        u = 0.5 * (KOLOSOV + 1.0) * integral.imag + y * Z.real
        v = -0.5 * (KOLOSOV - 1.0) * integral.real - y * Z.imag
        uniform = -P / (2.0 * (lame + SHEAR)) * (x - origin)
        return np.stack([u, v], axis=1) @ R.T / (2.0 * SHEAR) + uniform

    crack = xfem.Polyline(np.array([[-1.0, 0.0], [1.0, 0.0]]) @ R.T + origin)
    mesh = shaken(xfem.rectangle_mesh((n, n), (-2.0, -2.0), (2.0, 2.0)), seed, 0.15)
    _, faces, found, _ = closed(mesh, [crack], field)
    share = faces.weights / faces.weights.sum()
    far = share * (np.abs(((faces.points - origin) @ R)[..., 0]) < 0.75)
    errors = [one / P - 1.0 for one in (found.pressure, faces.averaged(found.pressure))]
    return [(share * np.abs(one)).sum() for one in errors] + [
        np.sqrt((far * one**2).sum()) for one in errors
    ]


def test_at_a_sheared_crack_the_pressure_converges_in_the_mean_and_away_from_its_ends():
    # At an end the stress of a mesh is off by a part of K/√h over a length h, so that the square
    # of the error has the same integral on any mesh, and the error an integral of order ½.
    errors = np.array([np.median([sheared(n, seed) for seed in range(5)], 0) for n in (20, 40, 80)])
    rates = np.log2(errors[0] / errors[-1]) / 2.0
    assert (rates[:2] > 0.35).all()
    assert rates[2] > 0.9
    assert rates[3] > 1.5
    assert (errors[:, 1::2] < errors[:, ::2]).all()


@pytest.mark.parametrize("name", CUTS)
def test_averages_keep_uniform_pressures_forces_and_what_touches(name):
    dim, cuts = CUTS[name]
    mesh = xfem.rectangle_mesh((6, 6)) if name == "along faces" else grid(dim, 7 if dim == 2 else 4)
    faces = ClosingFaces(xfem.cut_mesh(mesh, cuts, "inside"), soft(dim))
    random = np.random.default_rng(dim)
    touches = random.random(len(faces.weights)) < 0.6
    shut = np.where(touches[:, None], 1.0, np.zeros_like(faces.weights))
    assert np.abs(faces.averaged(shut) - shut).max(initial=0.0) < 1e-14
    one, other = (shut * random.uniform(0.5, 1.5, shut.shape) for _ in "ab")
    found, weights = faces.averaged(one), faces.weights
    assert np.array_equal(found > 0.0, one > 0.0)
    assert (weights * found).sum() == pytest.approx((weights * one).sum(), rel=1e-13)
    assert found.max(initial=0.0) <= 1.5
    # and what one pressure does with the mean of another, that one's mean does with it
    with_mean = [(weights * a * faces.averaged(b)).sum() for a, b in ((one, other), (other, one))]
    assert with_mean[0] == pytest.approx(with_mean[1], rel=1e-13)


def test_the_average_at_a_bend_is_of_each_face_alone():
    """Of a cut along two principal axes, the pressure on each part of which is its own."""
    R, mesh = rotation(2, 0.4), grid(2, 9)
    corner = mesh.points[((mesh.points - 0.5) ** 2).sum(axis=1).argmin()]
    strain = R @ np.diag([-0.01, -0.02]) @ R.T
    cut = xfem.Polyline([corner + R[:, 0], corner, corner + R[:, 1]])
    _, faces, found, exact = closed(mesh, [cut], lambda x, _: x @ strain)
    assert np.abs(found.displacement - exact).max() < 1e-12
    along = np.abs(faces.normal @ R[:, 0]) > 0.5
    assert 0.3 < np.mean(along) < 0.7
    lame = NU / ((1.0 + NU) * (1.0 - 2.0 * NU))
    truth = 0.03 * lame + 2.0 * SHEAR * np.where(along, 0.01, 0.02)
    assert np.abs(faces.averaged(found.pressure) / truth[:, None] - 1.0).max() < 1e-9


def test_faces_that_slide_along_a_circle_bear_the_pressure_as_if_they_did_not():
    # All of the plate is under pressure P, and its disc is turned besides. Along the circle the
    # faces slide by s = turn R and do not part, so nothing changes. With normals of facets s reads
    # as a gap of s h/R from facet to facet, a pressure of M s/R = P here whatever the mesh.
    lam, shear = NU / ((1.0 + NU) * (1.0 - 2.0 * NU)), SHEAR
    turn, centre, radius = P / (lam + 2.0 * shear), np.array([0.52, 0.49]), 0.3
    angles = np.linspace(0.0, 2.0 * np.pi, 6000)
    circle = xfem.Polyline(centre + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1))
    found = []
    for n in (14, 28, 56):
        mesh = grid(2, n)
        phantom = xfem.cut_mesh(mesh, [circle])
        x = phantom.node_points - centre
        inside = np.linalg.norm(phantom.node_piece_points - centre, axis=1) < radius
        exact = -P / (2.0 * (lam + shear)) * x
        exact += np.where(inside[:, None], turn * np.stack([-x[:, 1], x[:, 0]], axis=1), 0.0)
        held = np.linalg.norm(x, axis=1) < 0.4 * radius
        outer = np.zeros(len(mesh.points), dtype=bool)
        outer[boundary_nodes(mesh)] = True
        fixed = np.repeat((held | outer[phantom.node_parent])[:, None], 2, axis=1)
        faces = ClosingFaces(phantom, soft(2), [circle])
        force = xfem.InternalForce(phantom, soft(2), "linear")
        answer = solve_closed(force, faces, xfem.Supports(fixed, np.where(fixed, exact, 0.0)))
        # it is this that normals of facets would take for gaps
        taken = faces.stiffness[:, None] * faces.slid(answer.displacement, force)
        assert np.abs(taken).max() > P
        found.append(misses(faces, answer.pressure, np.full_like(answer.pressure, P))[0])
    # differences over a step of h/4 leave a gap of s (h/4R)², a pressure of M s h/16R²
    assert found[0] > 1.5 * found[1] > 1.5**2 * found[2]
    assert found[2] < 1.0 / (16 * 56 * radius)


@pytest.mark.parametrize("seed", [28, 122, *range(4)])
def test_any_cuts_and_any_movement_of_the_boundary_find_a_balance(seed):
    # of the first two a piece between the cuts is loose until faces hold it
    random, dim = np.random.default_rng(seed), 2 + seed % 2
    mesh = grid(dim, int(random.integers(6, 14) if dim == 2 else random.integers(3, 5)), seed)
    cuts = []
    for _ in range(random.integers(1, 4)):
        node, normal = random.integers(len(mesh.points)), random.normal(size=dim)
        cuts.append(xfem.Plane(mesh.points[node] + 10.0 ** -random.uniform(1, 13), normal))
    linear, square = (0.05 * random.normal(size=(dim,) * order) for order in (2, 3))

    def field(x, _):
        return x @ linear.T + np.einsum("ijk,nj,nk->ni", square, x, x)

    _, faces, found, _ = closed(mesh, cuts, field)
    assert found.residual < 1e-10
    assert found.iterations <= 30
    # where faces press, γ times the overlap is what the pressure is beyond the mean stress
    stress = np.einsum("fid,fid->f", faces.stress, found.displacement[faces.nodes])
    gap = np.einsum("fqid,fid->fq", faces.gap, found.displacement[faces.nodes])
    trial = stress[:, None] + faces.stiffness[:, None] * gap
    assert np.abs(found.pressure - np.maximum(0.0, -trial)).max() < 1e-12


def test_what_nothing_holds_is_named():
    mesh = xfem.rectangle_mesh((5, 5))
    phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.5, 0.53], [0.0, 1.0])])
    held = xfem.Supports.none(phantom).prescribe(phantom, mesh.points[:, 1] == 0.0)
    force = xfem.InternalForce(phantom, soft(2), "linear")
    with pytest.raises(UnsupportedBodyError, match="around"):  # it can slide
        solve_closed(force, ClosingFaces(phantom, soft(2)), held)
    # a wedge between two cuts, which only their faces hold, is pulled out
    planes = [xfem.Plane([0.3, 0.5], [1.0, 0.35]), xfem.Plane([0.72, 0.5], [1.0, -0.3])]
    phantom = xfem.cut_mesh(grid(2, 9), planes)
    between, y = (phantom.node_side == [1, -1]).all(axis=1), phantom.node_points[:, 1]
    fixed, load = np.zeros((2, phantom.node_count, 2))
    fixed[(y == 0.0) & ~between], load[between & (y == 1.0), 1] = 1.0, P
    force = xfem.InternalForce(phantom, soft(2), "linear")
    with pytest.raises(xfem.XfemError, match="faces or supports that hold"):
        solve_closed(
            force, ClosingFaces(phantom, soft(2)), xfem.Supports(fixed > 0.0, 0.0 * fixed), load
        )


def impact(n, dim=2, gap=0.0, tilt=0.0, scheme=xfem.EnergyMomentum, step=1.0):
    """Halves of a bar, of length, wave speed and density 1, that meet; in time steps of h."""
    v0, across = 0.01, (3,) * (dim - 1)
    make = xfem.rectangle_mesh if dim == 2 else xfem.box_mesh
    mesh = make((n, *across), (-1.0, *[0.0] * (dim - 1)), (1.0, *[6.0 / n] * (dim - 1)))
    plane = xfem.Plane([0.003, *[3.0 / n] * (dim - 1)], [1.0, *[tilt] * (dim - 1)])
    phantom = xfem.cut_mesh(mesh, [plane])
    elastic = xfem.isotropic(1.0, 0.0, "plane strain" if dim == 2 else "solid")
    force, mass = xfem.InternalForce(phantom, elastic, "linear"), xfem.side_wise_mass(phantom, 1.0)
    faces = ClosingFaces(phantom, elastic, moving=True)
    fixed = np.zeros((phantom.node_count, dim), dtype=bool)
    fixed[:, 1:] = True
    held = xfem.Supports(fixed, np.zeros(fixed.shape))
    body = xfem.DynamicBody(force, mass, supports=held, contact=faces)
    state, side = body.rest(), phantom.node_side[:, 0]
    state.velocity[:, 0], state.displacement[:, 0] = -v0 * side, 0.5 * gap * side
    recorder, integrator = BalanceRecorder(body, state), scheme(body, 2.0 / n * step)
    above = side > 0
    means, pressures, depth = [], [], 0.0
    while state.time < 2.3 + 0.5 * gap / v0:
        recorder.record(state, integrator.step(state))
        means.append([state.time, mass.weights[above] @ state.velocity[above, 0]])
        pressed = (faces.weights * faces.pressure(state.displacement)).sum()
        pressures.append(pressed / faces.weights.sum())
        depth = max(depth, overlap(faces, state.displacement))
    balance, means = recorder.close(), np.array(means)
    means[:, 1] /= v0 * mass.weights[above].sum()
    own = (balance.kinetic + balance.strain - balance.penalty) / balance.kinetic[0]
    return means, np.array(pressures) / v0, own, depth / (v0 * 2.0 / n)


@pytest.mark.parametrize("gap", [0.0, pytest.param(1e-3, marks=pytest.mark.heavy)])
def test_halves_that_collide_exchange_velocities_and_gain_no_energy(gap):
    lost, wrong = [], []
    for n in (20, 40, 80, 160):
        means, pressure, own, depth = impact(n, gap=gap)
        assert own.max() < 1.0 + 1e-12
        assert depth < 0.1
        lost.append(1.0 - own[-1])
        wrong.append(1.0 - means[-1, 1])
        # waves run through each half and back: together for 2L/c under ρ c v₀
        since = means[:, 0] - 0.5 * gap / 0.01
        assert np.abs(means[:, 1] - np.clip(since - 1.0, -1.0, 1.0)).max() < 0.15
        together = (since > 0.6) & (since < 1.4)
        assert pressure[-1] == 0.0
    assert np.abs(pressure[together] - 1.0).max() < 0.02
    assert max(lost[-1], wrong[-1]) < 0.02
    assert np.log2(lost[0] / lost[-1]) / 3.0 > 0.8  # first order
    assert np.log2(wrong[0] / wrong[-1]) / 3.0 > 0.6


@pytest.mark.parametrize(
    "given",
    [
        {"dim": 3, "tilt": 0.4, "step": 4.0},
        {"tilt": 0.5, "scheme": Trapezoidal},
        {"scheme": ImplicitEuler, "gap": 1e-3},
    ],
)
def test_no_impact_gains_energy(given):
    _, _, own, _ = impact(20, **given)
    assert own.max() < 1.0 + 1e-10
    assert own[-1] > 0.4


def test_schemes_without_contact_refuse_by_name():
    phantom = xfem.cut_mesh(xfem.rectangle_mesh((3, 3)), [xfem.Plane([0.4, 0.0], [1.0, 0.0])])
    mass = xfem.side_wise_mass(phantom, 1.0)
    faces = ClosingFaces(phantom, soft(2), moving=True)
    linear = xfem.InternalForce(phantom, soft(2), "linear")
    body = xfem.DynamicBody(linear, mass, contact=faces)
    for scheme in (xfem.CentralDifferences, SymplecticEuler, RealTimeEuler, GeneralisedAlpha):
        with pytest.raises(xfem.XfemError, match="no contact of the faces"):
            scheme(body, 1e-3)
    turning = xfem.InternalForce(phantom, soft(2))
    with pytest.raises(xfem.XfemError, match="linear kinematics with a force of corotational"):
        xfem.DynamicBody(turning, mass, contact=faces)
