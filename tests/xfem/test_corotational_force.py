"""Internal forces at finite rotation: polar rotations, energy, tangents, turned equilibria."""

from dataclasses import replace

import numpy as np
import pytest
from cut_bodies import cut_body, cut_cube, cut_membrane, cut_square, material, rotation
from test_cell_aggregation import near_nodes

from verify.accelerated import FAST
from verify.accelerated.one_pass import rotation_matrices
from verify.xfem import statics
from verify.xfem.block_pattern import block_pattern, body_pattern
from verify.xfem.element import isotropic
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce, inverted_cells
from verify.xfem.linear_solvers import PLAIN
from verify.xfem.polar import largest_eigenvector, nearest_rotations, rotations_in_space
from verify.xfem.slivers import treat_slivers


def _bodies():
    """Bodies of all dimensions, kinematics and laws, with a penalty, with aggregated slivers."""
    two, three, one_box = cut_body(2), cut_body(3), cut_cube(1, (0.5, 0.53, 0.47))
    solid = material(3, 1.0)
    aggregated, _ = treat_slivers(near_nodes(2, 1e-3))
    return {
        "plane": InternalForce(two, material(2, 1.0)),
        "space": InternalForce(one_box, solid),
        "linear": InternalForce(three, solid, "linear"),
        "stable": InternalForce(two, replace(material(2, 1.0), law="stable_neo_hookean")),
        "logarithmic": InternalForce(one_box, replace(solid, law="neo_hookean")),
        "penalised": InternalForce(three, solid, ghost=GhostPenalty(three, solid, 0.1)),
        "linear, penalised": InternalForce(
            three, solid, "linear", ghost=GhostPenalty(three, solid, 0.1)
        ),
        "aggregated": InternalForce(aggregated, material(2, 1.0)),
        "sheet": InternalForce(cut_membrane(), isotropic(1.0, 0.3, "plane stress")),
    }


BODIES = _bodies()


def _disturbed(force, size=0.1, seed=2):
    rng = np.random.default_rng(seed)
    X = force.phantom.node_points
    turned = X @ rotation(X.shape[1], 1.1).T - X if force.is_corotational else np.zeros_like(X)
    return turned + size * np.sqrt(force.phantom.mesh.measures.min()) * rng.normal(size=X.shape)


def _energy_by_svd(phantom, lam, mu, displacement):
    """Independent twin: singular values of each deformation gradient."""
    total = 0.0
    for piece, cell in enumerate(phantom.parent):
        X = phantom.mesh.points[phantom.mesh.cells[cell]]
        x = X + displacement[phantom.cells[piece]]
        F = np.linalg.solve((X[1:] - X[0]), x[1:] - x[0]).T
        s = np.linalg.svd(F)[1]
        s[-1] *= np.sign(np.linalg.det(F))
        total += phantom.volumes[piece] * (mu * ((s - 1) ** 2).sum() + lam / 2 * (s - 1).sum() ** 2)
    return total


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("size", [0.1, 1.5])
def test_energy_is_that_of_the_singular_values_also_where_pieces_are_inverted(dim, size):
    force = InternalForce(cut_body(dim), material(dim, 1.0))
    u = _disturbed(force, size)
    if size > 1.0:
        assert len(inverted_cells(force, u)) > 0
    expected = _energy_by_svd(force.phantom, force.elements.lam[0], force.elements.mu[0], u)
    assert force.evaluate(u)[1] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("force", BODIES.values(), ids=BODIES)
def test_force_and_stiffness_are_derivatives_of_an_energy_that_no_rotation_changes(force):
    u = _disturbed(force, 0.05)
    direction = np.random.default_rng(3).normal(size=u.shape)
    # fourth-order differences: truncation h⁴, round-off 1e-16/h
    step, weights = 2e-4, {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
    samples = {k: force.evaluate(u + k * step * direction) for k in weights}
    slope = sum(w * samples[k][1] for k, w in weights.items()) / step
    change = sum(w * samples[k][0] for k, w in weights.items()) / step
    f, energy = force.evaluate(u)
    assert np.sum(f * direction) == pytest.approx(slope, rel=1e-8)
    pattern = body_pattern(force.phantom, force.ghost and force.ghost.couplings)
    blocks = np.zeros((len(pattern.columns), *[u.shape[1]] * 2))
    assert force.add_stiffness(force.configuration(u), pattern, blocks, kind="consistent") == 0
    K = pattern.matrix(blocks)
    product = (K @ direction.ravel()).reshape(u.shape)
    assert np.abs(product - change).max() < 1e-8 * np.abs(change).max()
    assert np.abs(K - K.T).max() <= 1e-14 * np.abs(K).max()
    size, x = np.abs(f).sum(), force.phantom.node_points + u
    assert np.abs(f.sum(axis=0)).max() < 1e-14 * size
    if force.is_corotational:
        moment = np.einsum("ni,nj->ij", x, f)
        assert np.abs(moment - moment.T).max() < 1e-14 * size * np.abs(x).max()
        Q = rotation(u.shape[1], 2.0)
        turned, same = force.evaluate(x @ Q.T - force.phantom.node_points)
        assert same == pytest.approx(energy, rel=1e-11)
        assert np.abs(turned - f @ Q.T).max() < 1e-11 * np.abs(f).max()


@pytest.mark.parametrize("name", ["plane", "space", "linear", "sheet"])
def test_frozen_stiffness_has_no_negative_mode_and_equals_its_product(name):
    force = BODIES[name]
    u = _disturbed(force)
    pattern = block_pattern(force.phantom.cells, force.phantom.node_count)
    K = pattern.matrix(force.stiffness(pattern, u, "rotation-fixed"))
    values = np.linalg.eigvalsh(K.toarray())
    assert values[0] > -1e-13 * values[-1]
    product = np.zeros_like(u)
    force.add_tangent_product(force.configuration(u), u, 2.0, product)
    assert np.abs(product.ravel() - 2.0 * K @ u.ravel()).max() < 1e-13 * np.abs(product).max()


def test_the_stiffness_of_the_tension_of_a_membrane_equals_its_product():
    """Where it is slack too: there neither has any."""
    force = BODIES["sheet"]
    u = _disturbed(force)
    at, pattern = force.configuration(u), block_pattern(force.phantom.cells, len(u))
    blocks = np.zeros((len(pattern.columns), 3, 3))
    force.add_stiffness(at, pattern, blocks, kind="tension", least=0.0)
    product = np.zeros_like(u)
    force.add_tension_product(at, u, 2.0, product)
    expected = 2.0 * pattern.matrix(blocks) @ u.ravel()
    assert np.abs(expected).max() > 0.0
    assert np.abs(product.ravel() - expected).max() < 1e-13 * np.abs(expected).max()


def _upper_half_turned(v, angle):
    X = v.node_points
    dim = X.shape[1]
    above = v.node_side[:, 0] > 0
    moved = X @ rotation(dim, angle).T + np.linspace(0.2, 0.5, dim)
    return np.where(above[:, None], moved - X, 0.0)


def test_linear_kinematics_pays_for_the_same_rotation():
    force = InternalForce(cut_square(), material(2), "linear")
    for degrees, energy in ((30.0, 162.233085), (90.0, 9038.461538)):
        found = force.evaluate(_upper_half_turned(force.phantom, np.radians(degrees)))[1]
        assert found == pytest.approx(energy, abs=1e-6)  # the digits printed


def _rotation(F, start=None):
    """In space by Newton's method from a quaternion."""
    if len(F) == 2 or start is None:
        return nearest_rotations(F[None])[0]
    R = np.empty((1, 3, 3))
    rotations_in_space(F[None], start[None].copy(), R)
    return R[0]


def _by_eigenvector(F, _start=None):
    q, R = np.empty((1, 4)), np.empty((1, 3, 3))
    largest_eigenvector(F, q[0])
    rotation_matrices(q, R)
    return R[0]


def _by_svd(F):
    U, _, V = np.linalg.svd(F)
    flip = np.eye(len(F))
    flip[-1, -1] = np.sign(np.linalg.det(U @ V))
    return U @ flip @ V


@pytest.mark.parametrize(
    ("dim", "rotation"), [(2, _rotation), (3, _rotation), (3, _by_eigenvector)]
)
def test_rotation_equals_that_of_the_singular_value_decomposition_also_when_inverted(dim, rotation):
    rng = np.random.default_rng(7)
    for _ in range(300):
        F = rng.normal(size=(dim, dim))
        start = rng.normal(size=4)
        R = rotation(F, start / np.linalg.norm(start))
        s = np.linalg.svd(F)[1]
        # the rotation is as sensitive as 1/(σ₂ ± σ₃)
        gap = (s[-2] + np.sign(np.linalg.det(F)) * s[-1]) / s[0]
        assert np.abs(R - _by_svd(F)).max() * gap < 1e-13
        assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize(
    "stretches",
    [
        (0.0, 0.0, 0.0),
        (1.0, 0.0, 0.0),
        (1.0, 1.0, 0.0),
        (-1.0, -1.0, -1.0),
        (1.0, 1.0, -1.0),
        (1.0, 1e-12, -1e-12),
        (1.0, 1.0, -1.0 + 1e-9),
        (1e-200, 1e-200, 1e-200),
        (1e120, 1e120, -1e120),
    ],
)
@pytest.mark.parametrize("rotation", [_rotation, _by_eigenvector])
def test_collapsed_and_inverted_pieces_have_a_rotation_that_attains_the_largest_trace(
    stretches, rotation
):
    rng = np.random.default_rng(1)
    for _ in range(5):
        Q = [_by_svd(rng.normal(size=(3, 3))) for _ in range(2)]
        F = Q[0] @ np.diag(stretches) @ Q[1].T
        R = rotation(F)
        s = np.sort(np.abs(stretches))
        most = s[2] + s[1] + np.copysign(s[0], np.prod(np.sign(stretches)))
        assert np.abs(R.T @ R - np.eye(3)).max() < 1e-14
        assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-13)
        assert np.trace(R.T @ F) == pytest.approx(most, rel=1e-13, abs=1e-14 * s[2])


def test_newton_does_not_see_slivers():
    counts = []
    for epsilon in (0.5, 1e-2, 1e-12, 0.0):
        v = cut_square(8, (0.5, 0.5 + epsilon / 8.0), (0.0, 1.0))
        X = v.node_points
        ends = (X[:, 1] == 0.0) | (X[:, 1] == 1.0)
        fixed = np.repeat(ends[:, None], 2, axis=1)
        turned = np.where(v.node_side[:, :1] > 0, X @ rotation(2, 0.8).T - X, 0.0)
        turned[:, 0] += 0.2 * X[:, 1] * X[:, 0]
        force = InternalForce(v, material(2))
        counts.append(static_equilibrium(force, fixed, lambda s, u=turned: s * u).iterations[0])
    assert max(counts) <= 8
    assert max(counts) - min(counts) <= 2


@pytest.mark.parametrize(
    ("limit", "kernels", "large"), [(10_000, FAST, 1000), (10_000, FAST, 0), (3, PLAIN, 0)]
)
def test_iterated_corrections_find_the_equilibrium_that_factorised_ones_do(
    monkeypatch, limit, kernels, large
):
    """Also where the tangent is indefinite on the way, and where iterations run out."""
    v = cut_cube(3)
    X = v.node_points
    ends = (X[:, 0] < 1e-9) | (X[:, 0] > 1.0 - 1e-9)

    def twisted(s):
        turned = (X - 0.5) @ rotation(3, 1.5 * s, (1.0, 0.0, 0.0)).T - (X - 0.5)
        return np.where((X[:, 0] > 0.5)[:, None], turned, 0.0)

    fixed = np.repeat(ends[:, None], 3, axis=1)
    force = InternalForce(v, material(3))
    direct = static_equilibrium(force, fixed, twisted, load_steps=2)
    monkeypatch.setattr(statics, "ITERATE_FROM", 0)
    monkeypatch.setattr(statics, "LARGE_FROM", large)
    monkeypatch.setattr(statics, "_MOST", limit)
    iterated = static_equilibrium(
        InternalForce(v, material(3), kernels=kernels), fixed, twisted, load_steps=2
    )
    # both to 1e-10 of the forces
    np.testing.assert_allclose(iterated.displacement, direct.displacement, atol=1e-9)
    assert iterated.energy == pytest.approx(direct.energy, rel=1e-9)
