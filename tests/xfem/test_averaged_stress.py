"""Element loops in motion: averaged stress, crushed elements, force and stiffness in one pass."""

import numpy as np
import pytest
from cut_bodies import DENSITY, SOFT, material
from time_schemes import SCHEMES

from verify.accelerated import FAST
from verify.xfem.block_pattern import body_pattern
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane
from verify.xfem.element import Elements
from verify.xfem.energy_balance import run
from verify.xfem.energy_momentum import StepEnds, averaged_moduli, averaged_stress
from verify.xfem.hyperelastic import Law, averages, moduli_of_averages
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.polar import nearest_rotations
from verify.xfem.slivers import treat_slivers

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


def _hyperelastic(stable, dim):
    """Energy density of one piece, and its law."""
    law = Law(np.array([LAM]), np.array([MU]), stable)

    def energy(F):
        J = np.linalg.det(F)
        volume = (LAM + MU) / 2 * (J - 1) ** 2 - MU * (J - 1)
        if not stable:
            volume = LAM / 2 * np.log(J) ** 2 - MU * np.log(J)
        return MU / 2 * (np.sum(F**2) - dim) + volume

    return law, energy


@pytest.mark.parametrize("stable", [False, True])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_averaged_stress_of_neo_hookean_pieces_keeps_energy_and_angular_momentum(dim, stable):
    law, energy = _hyperelastic(stable, dim)
    turn, sound = _rotation(np.random.default_rng(7).normal(size=(dim, dim))), 0
    for F0, F1, _ in _pairs("plane" if dim == 2 else "solid", 0.35):
        if min(np.linalg.det(F0), np.linalg.det(F1)) <= 0.0:
            if stable:  # inside out: the energy is kept all the same
                P = averages(law, F0[None], F1[None]).stress[0]
                assert np.sum(P * (F1 - F0)) == pytest.approx(energy(F1) - energy(F0), abs=1e-12)
            continue
        sound += 1
        for start, end in ((F0, F1), (turn @ F0, turn @ F1), (F0, turn @ F0)):
            P = averages(law, start[None], end[None]).stress[0]
            change = energy(end) - energy(start)
            assert np.sum(P * (end - start)) == pytest.approx(change, abs=1e-12)
            torque = P @ (start + end).T
            assert torque == pytest.approx(torque.T, abs=1e-12 * np.abs(torque).max())
    assert sound >= 10


@pytest.mark.parametrize("stable", [False, True])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("size", [0.3, 1e-4])
def test_the_averaged_moduli_of_neo_hookean_pieces_are_the_derivative(dim, stable, size):
    law, _ = _hyperelastic(stable, dim)
    for F0, F1, _ in _pairs("plane" if dim == 2 else "solid", size):
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
@pytest.mark.parametrize("substituted", [False, True])
def test_the_work_of_the_averaged_stress_is_the_change_of_energy(kind, substituted):
    dim = 3 if kind == "solid" else 2
    for F0, F1, normal in _pairs(kind, 0.3):
        P, _ = _stress(F0, F1, dim, normal, substituted)
        change = _energy(F1, dim) - _energy(F0, dim)
        assert np.sum(P * (F1 - F0)) == pytest.approx(change, abs=1e-13)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("substituted", "size"), [(False, 0.3), (True, 0.3), (False, 1.5)])
def test_the_derivative_of_the_averaged_stress_equals_central_differences(kind, substituted, size):
    """Also of the substitute that inverted pieces take."""
    dim = 3 if kind == "solid" else 2
    taken_somewhere, compared = False, 0
    h = 1e-6
    for F0, F1, normal in _pairs(kind, size):
        _, taken = _stress(F0, F1, dim, normal, substituted)
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
        for l in range(space):
            for m in range(space):
                D = np.zeros_like(F1)
                D[l, m] = h
                D = D @ (np.eye(space) - across)
                if not D.any():
                    continue
                plus, minus = (_stress(F0, F1 + s * D, dim, normal, taken)[0] for s in (1, -1))
                expected = (plus - minus) / (2.0 * h)
                got = np.einsum("knlm,lm->kn", slope, D / h)
                assert np.abs(got - expected).max() < 1e-8 * (1.0 + 1.0 / gap**3) * 10.0
    assert compared >= 5
    assert taken_somewhere == (substituted and kind != "plane")


CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.1], [0.2, 0.9, 0.3], [0.1, 0.2, 0.8]])
ELEMENTS = {
    "triangle": SimplexMesh(CORNERS[:3, :2], np.array([[0, 1, 2]])),
    "sheet": SimplexMesh(CORNERS[:3], np.array([[0, 1, 2]])),
    "tetrahedron": SimplexMesh(CORNERS, np.array([[0, 1, 2, 3]])),
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
    v = cut_mesh(ELEMENTS[name], [])
    return DynamicBody(InternalForce(v, material(v.mesh.dim)), side_wise_mass(v, DENSITY))


@pytest.mark.parametrize("how", CRUSHED)
@pytest.mark.parametrize("name", ELEMENTS)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_crushed_or_reflected_element_moves_on_with_a_rotation_and_a_closed_account(
    scheme, name, how
):
    body = _body(name)
    X = body.force.phantom.node_points
    space = X.shape[1]
    diagonal = CRUSHED[how][-space:] if how == "reflection" else CRUSHED[how][:space]
    state = body.rest()
    state.displacement[:] = (X - X.mean(axis=0)) * (np.array(diagonal) - 1.0)
    account = run(scheme(body, 1e-3), body, state, 20)
    R = body.force.configuration(state.displacement).R[0]
    assert np.abs(R.T @ R - np.eye(space)).max() < 1e-14
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
    # half a turn stores nothing: there energies are round-off of that of a strain of one
    size = max(account.mechanical.max(), 1e-12 * float(body.force.elements.mu[0]))
    assert np.ptp(account.balance - account.unbalanced) < 1e-12 * size
    assert np.abs(account.unbalanced).max() < 1e-9 * size
    assert np.isfinite(state.displacement).all()


@pytest.mark.parametrize("policy", ["keep", "merge"])
@pytest.mark.parametrize("size", [0.0, 0.05, 0.4])
def test_the_exact_stiffness_is_that_of_assembly(size, policy):
    """With another share of what frozen rotations give, as damping wants it."""
    cut = Plane([0.501, 0.501, 0.501], [1.0, 0.07, -0.03])
    phantom, report = treat_slivers(cut_mesh(box_mesh((4, 2, 2)), [cut]), policy)
    assert (report.aggregated > 0) == (policy == "merge")
    pattern = body_pattern(phantom)
    force = InternalForce(phantom, material(3, SOFT), kernels=FAST)
    other = InternalForce(phantom, material(3, SOFT))
    edge = phantom.mesh.measures.min() ** (1.0 / 3.0)
    u = size * edge * np.random.default_rng(4).normal(size=phantom.node_points.shape)
    found, wanted = np.full((2, len(pattern.columns), 3, 3), np.nan)
    for whole in (True, False):
        force.linearise(pattern, u, u, 0.0, 0.7, np.empty_like(u), found, whole, 0.3)
        wanted[:] = 0.0
        at = other.configuration(u)
        other.add_stiffness(at, pattern, wanted, 0.4)
        other.add_stiffness(at, pattern, wanted, 0.3, "consistent")
        read = np.ones(len(wanted), dtype=bool)
        if not whole:
            row = np.repeat(np.arange(phantom.node_count), np.diff(pattern.starts))
            read = pattern.columns >= row
        assert np.abs(found - wanted)[read].max() < 1e-12 * np.abs(wanted).max()
        found[:] = np.nan
