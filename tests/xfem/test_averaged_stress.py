"""Element loops in motion: averaged stress, crushed elements, force and stiffness in one pass."""

from itertools import product

import numpy as np
import pytest
from cut_bodies import DENSITY, SOFT, material
from time_schemes import SCHEMES

import verify.xfem as xfem
from verify.accelerated import FAST
from verify.xfem.block_pattern import body_pattern
from verify.xfem.element import Elements
from verify.xfem.energy_momentum import StepEnds, averaged_moduli, averaged_stress
from verify.xfem.hyperelastic import Law, averages, moduli_of_averages
from verify.xfem.polar import nearest_rotations

LAM, MU = 1.3, 0.7


def _rotation(F):
    return nearest_rotations(F[None])[0]


def _element(space, dim, normal):
    """One element; its stress reads no more than these."""
    one = np.zeros(1, dtype=np.int64)
    return Elements(
        cells=np.zeros((1, dim + 1), dtype=np.int64), parent=one, gradients=np.empty(0),
        volumes=np.ones(1), normals=normal[None], lam=np.array([LAM]), mu=np.array([MU]),
        axes=tuple(range(space)), corners=tuple(range(dim + 1)), is_membrane=dim < space,
    )  # fmt: skip


def _step(F0, F1):
    return StepEnds(*(X[None] for X in (F0, F1, _rotation(F0), _rotation(F1))))


def _stress(F0, F1, dim, normal, substituted):
    taken = np.array([substituted])
    P = averaged_stress(_element(len(F0), dim, normal), _step(F0, F1), taken)[0]
    return P, bool(taken[0])


def _energy(F, dim):
    t = np.sum(_rotation(F) * F)
    return MU * (np.sum(F * F) - 2.0 * t + dim) + 0.5 * LAM * (t - dim) ** 2


def _pairs(kind, size, seed=3):
    """Deformations at the start and at the end; of a membrane, without a normal component."""
    rng = np.random.default_rng(seed)
    dim = 2 if kind == "plane" else 3
    normal = np.zeros(3)
    if kind == "membrane":
        normal = np.array([2.0, -1.0, 2.0]) / 3.0
    across = np.outer(normal, normal)[:dim, :dim]
    for _ in range(20):
        F0, F1 = (np.eye(dim) + size * rng.normal(size=(dim, dim)) for _ in range(2))
        yield F0 @ (np.eye(dim) - across), F1 @ (np.eye(dim) - across), normal


@pytest.mark.parametrize("stable", [False, True])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_averaged_moduli_of_neo_hookean_pieces_are_the_derivative(dim, stable):
    law = Law(np.array([LAM]), np.array([MU]), stable)
    kind = "plane" if dim == 2 else "solid"
    for F0, F1, _ in (*_pairs(kind, 0.3), *_pairs(kind, 1e-4)):
        if min(np.linalg.det(F0), np.linalg.det(F1)) <= 0.1:
            continue
        found = moduli_of_averages(law, F0[None], F1[None])[0]
        step, way = 1e-5, np.random.default_rng(5).normal(size=F1.shape)
        ends = (F1 + sign * step * way for sign in (1.0, -1.0))
        more, less = (averages(law, F0[None], end[None]).stress[0] for end in ends)
        slope = np.einsum("knlm,lm->kn", found, way)
        assert slope == pytest.approx((more - less) / (2 * step), abs=1e-6 * np.abs(slope).max())


KINDS = ("plane", "membrane", "solid")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("substituted", "size"), [(False, 0.3), (True, 0.3), (False, 1.5)])
def test_the_averaged_stress_works_as_energy_changes_and_its_moduli_are_its_derivative(
    kind, substituted, size
):
    """Also of the substitute that inverted pieces take."""
    dim = 3 if kind == "solid" else 2
    taken_somewhere, compared = False, 0
    h, random = 1e-6, np.random.default_rng(6)
    for F0, F1, normal in _pairs(kind, size):
        P, taken = _stress(F0, F1, dim, normal, substituted)
        if size < 1.0:
            change = _energy(F1, dim) - _energy(F0, dim)
            assert np.sum(P * (F1 - F0)) == pytest.approx(change, abs=1e-13)
        taken_somewhere |= taken
        # the substitute is kept once taken, as it is in a step
        space = len(F0)
        element = _element(space, dim, normal)
        slope = averaged_moduli(element, _step(F0, F1), np.array([taken]))[0]
        # differences see curvature and round-off, both 1/gap³ times what they are at gap 1
        gap = min(np.linalg.svd(F)[1][:dim].min() for F in (F0 + F1, F1))
        if gap < 0.1:
            continue
        compared += 1
        across = np.outer(normal, normal)[:space, :space]
        D = random.normal(size=F1.shape) @ (np.eye(space) - across)
        plus, minus = (_stress(F0, F1 + s * h * D, dim, normal, taken)[0] for s in (1, -1))
        got, expected = np.einsum("knlm,lm->kn", slope, D), (plus - minus) / (2.0 * h)
        assert np.abs(got - expected).max() < 1e-7 * (1.0 + 1.0 / gap**3)
    assert compared >= 5
    assert taken_somewhere == (substituted and kind != "plane")


CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.2, 0.9, 0.3], [0.1, 0.2, 0.8]])
ELEMENTS = {
    "triangle": xfem.SimplexMesh(CORNERS[:3, :2], np.array([[0, 1, 2]])),
    "sheet": xfem.SimplexMesh(CORNERS[:3], np.array([[0, 1, 2]])),
    "tetrahedron": xfem.SimplexMesh(CORNERS, np.array([[0, 1, 2, 3]])),
}
# diagonals of the deformation gradient about the centre
CRUSHED = {
    "plane": [1.0, 1.0, 0.0],
    "line": [1.0, 0.0, 0.0],
    "point": [0.0, 0.0, 0.0],
    "reflection": [1.0, 1.0, -1.0],
    "reflection of the first axis": [-1.0, 1.0, 1.0],
    "reflection in the centre": [-1.0, -1.0, -1.0],
    "next to nothing": [1e-200, 1e-200, 1e-200],
}


def _body(name):
    v = xfem.cut_mesh(ELEMENTS[name], [])
    return xfem.DynamicBody(
        xfem.InternalForce(v, material(v.mesh.dim)), xfem.side_wise_mass(v, DENSITY)
    )


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_crushed_or_reflected_element_moves_on_with_a_rotation_and_a_closed_account(scheme):
    for name, (how, diagonal) in product(ELEMENTS, CRUSHED.items()):
        body = _body(name)
        X = body.force.phantom.node_points
        space = X.shape[1]
        diagonal = diagonal[-space:] if how == "reflection" else diagonal[:space]
        state = body.rest()
        state.displacement[:] = (X - X.mean(axis=0)) * (np.array(diagonal) - 1.0)
        account = xfem.run(scheme(body, 1e-3), body, state, 4)
        R = body.force.configuration(state.displacement).R[0]
        assert np.abs(R.T @ R - np.eye(space)).max() < 1e-14, (name, how)
        assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
        # half a turn stores nothing: there energies are round-off of that of a strain of one
        size = max(account.mechanical.max(), 1e-12 * float(body.force.elements.mu[0]))
        assert np.ptp(account.balance - account.unbalanced) < 1e-12 * size, (name, how)
        assert np.abs(account.unbalanced).max() < 1e-9 * size
        assert np.isfinite(state.displacement).all()


@pytest.mark.parametrize("policy", ["keep", "merge"])
def test_the_exact_stiffness_is_that_of_assembly(policy):
    """With another share of what frozen rotations give, as damping wants it."""
    cut = xfem.Plane([0.501, 0.501, 0.501], [1.0, 0.07, -0.03])
    phantom, report = xfem.treat_slivers(xfem.cut_mesh(xfem.box_mesh((4, 2, 2)), [cut]), policy)
    assert (report.aggregated > 0) == (policy == "merge")
    pattern = body_pattern(phantom)
    force = xfem.InternalForce(phantom, material(3, SOFT), kernels=FAST)
    other = xfem.InternalForce(phantom, material(3, SOFT))
    edge = phantom.mesh.measures.min() ** (1.0 / 3.0)
    u = 0.4 * edge * np.random.default_rng(4).normal(size=phantom.node_points.shape)
    found, wanted = np.zeros((2, len(pattern.columns), 3, 3))
    at = other.configuration(u)
    other.add_stiffness(at, pattern, wanted, 0.4)
    other.add_stiffness(at, pattern, wanted, 0.3, "consistent")
    row = np.repeat(np.arange(phantom.node_count), np.diff(pattern.starts))
    for whole in (True, False):
        found[:] = np.nan
        force.linearise(pattern, u, u, 0.0, 0.7, np.empty_like(u), found, whole, 0.3)
        read = whole | (pattern.columns >= row)
        assert np.abs(found - wanted)[read].max() < 1e-12 * np.abs(wanted).max()
