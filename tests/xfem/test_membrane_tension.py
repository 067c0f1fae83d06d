"""A stretched membrane resists across its plane, in semi-implicit steps of any size too."""

import numpy as np
import pytest
from cut_bodies import rotation

from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane
from verify.xfem.elasticity import isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.structured_meshes import rectangle_mesh
from verify.xfem.supports import Supports

MATERIAL = isotropic(1e3, 0.3, "plane stress")  # E times thickness, N/m


def _membrane(divisions=6):
    flat = rectangle_mesh((divisions, divisions))
    points = np.column_stack([flat.points, np.zeros(len(flat.points))])
    return cut_mesh(SimplexMesh(points, flat.cells), [Plane([0.5, 0.53, 0.0], [0.0, 1.0, 0.0])])


def _matrices(v, displacement, kinds):
    force = InternalForce(v, MATERIAL)
    pattern = block_pattern(v.cells, v.node_count)
    return [
        pattern.matrix(force.stiffness(pattern, displacement, kind)).toarray() for kind in kinds
    ]


def _turned(v, stretches, angle):
    Q, X = rotation(3, angle), v.node_points
    return X @ np.diag([*stretches, 1.0]) @ Q.T - X, Q[:, 2]


@pytest.mark.parametrize("angle", [0.0, 1.1])
def test_across_the_plane_of_a_stretched_membrane_the_stiffness_is_the_exact_one(angle):
    v = _membrane()
    u, normal = _turned(v, (1.2, 1.05), angle)
    exact, tensioned, frozen = _matrices(v, u, ("consistent", "geometric", "rotation-fixed"))
    across = np.kron(np.random.default_rng(0).normal(size=v.node_count), normal)
    size = np.abs(exact @ across).max()
    assert size > 1.0
    assert np.abs((exact - tensioned) @ across).max() < 1e-12 * size
    assert np.abs(frozen @ across).max() < 1e-12 * size


def test_only_the_pulled_direction_of_a_membrane_that_is_pushed_in_the_other_gets_stiffer():
    v = _membrane()
    u, normal = _turned(v, (1.2, 0.8), 0.4)
    (tensioned,) = _matrices(v, u, ("geometric",))
    stiffness = []
    for axis in (0, 1):
        wave = np.kron(np.sin(2.0 * np.pi * v.node_points[:, axis]), normal)
        stiffness.append(wave @ tensioned @ wave)
    # S₁ = E/(1 − ν²) (0.2 − 0.3·0.2)/1.2; the wave's gradient is 2π on each of the sides' area
    pull = 1e3 / 0.91 * 0.14 / 1.2
    assert stiffness[0] == pytest.approx(pull * 2.0 * np.pi**2, rel=0.15)  # six cells to a wave
    assert abs(stiffness[1]) < 1e-10 * stiffness[0]


@pytest.mark.parametrize("stretches", [(0.7, 0.8), (0.3, 1.0), (1e-7, 1e-7)])
def test_a_membrane_without_tension_gets_nothing(stretches):
    v = _membrane()
    u, _ = _turned(v, stretches, 0.4)
    tensioned, frozen = _matrices(v, u, ("geometric", "rotation-fixed"))
    assert np.abs(tensioned - frozen).max() < 1e-13 * np.abs(frozen).max()


def test_no_mode_is_negative_whatever_the_deformation():
    v = _membrane(3)
    rng = np.random.default_rng(1)
    for size in (0.05, 0.5, 3.0):
        u = size * rng.normal(size=v.node_points.shape) / 3.0
        (tensioned,) = _matrices(v, u, ("geometric",))
        values = np.linalg.eigvalsh(tensioned)
        assert values[0] > -1e-12 * values[-1]


@pytest.mark.parametrize("step", [1e-3, 1e-2, 0.1])
def test_a_stretched_membrane_that_is_plucked_comes_to_rest_in_steps_of_any_size(step):
    """Without tension in the matrix the amplitude at the longest step grows ten-thousandfold."""
    v = _membrane()
    ends = np.isin(v.mesh.points[:, 0], (0.0, 1.0))
    held = Supports.none(v).prescribe(v, ends)
    pulled = 0.2 * v.node_points * [1.0, 0.0, 0.0]
    held = held.prescribe(v, ends, pulled[held.fixed[:, 0]])
    body = DynamicBody(InternalForce(v, MATERIAL), side_wise_mass(v, 1.0), supports=held)
    scheme, state = RealTimeEuler(body, step), body.rest()
    state.displacement[:] = pulled
    pluck = 1e-3 * np.random.default_rng(0).normal(size=v.node_count)
    state.velocity[:, 2] = np.where(body.fixed[:, 2], 0.0, pluck)
    before = body.mass.diagonal @ state.velocity[:, 2] ** 2
    most = 0.0
    for count in range(300):
        if count == 3:
            forces = scheme.step(state)
            assert np.isfinite(forces.internal).all()
        else:
            scheme.advance(state)
        most = max(most, np.abs(state.displacement[:, 2]).max())
    # tension 183 N/m, density 1: the energy of the pluck, kept, lifts a wave by no more than this
    assert most < 10.0 * np.sqrt(before / 183.0)
    assert body.mass.diagonal @ state.velocity[:, 2] ** 2 < before
