"""Static equilibrium at large rotations against exact solutions of the potential."""

import numpy as np
import pytest
from cut_bodies import cut_cube, cut_square, material, rotation

from verify.accelerated import FAST
from verify.xfem import static_newton, statics
from verify.xfem.cuts import Plane
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.internal_force import InternalForce
from verify.xfem.linear_solvers import PLAIN
from verify.xfem.phantom import cut_mesh
from verify.xfem.structured_meshes import rectangle_mesh


def test_a_turned_problem_has_the_turned_equilibrium():
    found = []
    for angle in (0.0, 2.1):
        Q = rotation(2, angle)
        mesh = rectangle_mesh((6, 6))
        mesh = type(mesh)(mesh.points @ Q.T, mesh.cells)
        v = cut_mesh(mesh, [Plane(Q @ [0.5, 0.47], Q @ [0.2, 1.0])])
        X = v.node_points @ Q
        fixed = np.repeat((X[:, :1] < 1e-9), 2, axis=1)
        load = np.zeros_like(X)
        load[X[:, 0] > 1.0 - 1e-9] = Q @ [0.0, -0.002]
        result = static_equilibrium(InternalForce(v, material(2, 1.0)), fixed, load=load)
        found.append((result.energy, result.displacement @ Q))
    assert np.abs(found[0][1]).max() > 0.1
    assert found[1][0] == pytest.approx(found[0][0], rel=1e-9)
    assert np.abs(found[1][1] - found[0][1]).max() < 1e-9


def test_newton_does_not_see_slivers():
    counts = []
    for epsilon in (0.5, 1e-2, 1e-6, 1e-12, 0.0):
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


@pytest.mark.parametrize("limit", [10_000, 3])
@pytest.mark.parametrize("kernels", [PLAIN, FAST])
def test_iterated_corrections_find_the_equilibrium_that_factorised_ones_do(
    monkeypatch, limit, kernels
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
    monkeypatch.setattr(static_newton, "_MOST", limit)
    iterated = static_equilibrium(
        InternalForce(v, material(3), kernels=kernels), fixed, twisted, load_steps=2
    )
    # both to 1e-10 of the forces
    np.testing.assert_allclose(iterated.displacement, direct.displacement, atol=1e-9)
    assert iterated.energy == pytest.approx(direct.energy, rel=1e-9)
