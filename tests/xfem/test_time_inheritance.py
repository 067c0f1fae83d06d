"""Cutting a body in motion changes neither its energy nor its momenta; turning it, nothing."""

import numpy as np
import pytest
from cut_bodies import DENSITY, GRAVITY, material, rotation

from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.cuts import Plane, PolygonPatch, Polyline
from verify.xfem.energy_balance import BalanceRecorder
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.explicit import CentralDifferences
from verify.xfem.implicit import Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports
from verify.xfem.mass import consistent_mass, side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.release import inherit_state


def _histories():
    """Cuts that grow, cross, branch and pass through nodes, one list after another."""
    plate = rectangle_mesh((6, 6))
    grown = [[Polyline([[-0.1, 0.45], [end, 0.47 + 0.2 * end]])] for end in (0.3, 0.7, 1.1)]
    crossing = Plane((0.47, 0.5), (1.0, 0.2))
    branch = Polyline([[0.6, 0.5], [0.9, 1.1]])
    flat = PolygonPatch([[-1, -1, 0.52], [0.6, -1, 0.52], [0.6, 2, 0.52], [-1, 2, 0.52]])
    upright = Plane((0.5, 0.5, 0.5), (1.0, 0.0, 0.0))
    return {
        "a growing cut": (plate, [[], *grown]),
        "then one that crosses it": (plate, [grown[1], [grown[2][0], crossing]]),
        "and one that branches": (
            plate,
            [[grown[2][0], crossing], [grown[2][0], crossing, branch]],
        ),
        "in space, the second along faces": (box_mesh((4, 4, 4)), [[], [flat], [flat, upright]]),
    }


@pytest.mark.parametrize("history", _histories())
@pytest.mark.parametrize("mass", [side_wise_mass, consistent_mass])
def test_energy_and_momenta_are_continuous_when_a_moving_body_is_cut(history, mass):
    mesh, stages = _histories()[history]
    dim = mesh.dim
    rng = np.random.default_rng(0)
    old = cut_mesh(mesh, stages[0])
    state = MotionState(*rng.normal(scale=0.05, size=(2, old.node_count, dim)), time=0.3)
    state.displacement += old.node_points @ rotation(dim, 0.8).T - old.node_points
    for cuts in stages[1:]:
        new = cut_mesh(mesh, cuts)
        assert new.node_count > old.node_count
        after = inherit_state(old, new, state)
        rows = []
        for v, s in ((old, state), (new, after)):
            account = BalanceRecorder(DynamicBody(InternalForce(v, material(dim)), mass(v, 1e3)), s)
            ledger = account.close()
            rows.append(
                np.concatenate(
                    [
                        [s.time, ledger.kinetic[0], ledger.strain[0]],
                        ledger.momentum[0],
                        ledger.angular_momentum[0],
                    ]
                )
            )
        assert np.allclose(rows[0], rows[1], rtol=1e-12, atol=1e-12 * np.abs(rows[0]).max())
        # then the two sides go their own ways, and the next cut inherits that
        after.displacement += rng.normal(scale=0.02, size=after.displacement.shape)
        old, state = new, after


def _hanging(angle, order=None):
    """A cut square, clamped at its top side and released, turned by an angle."""
    Q = rotation(2, angle)
    mesh = rectangle_mesh((5, 5))
    points, cells = mesh.points @ Q.T, mesh.cells
    if order is not None:
        shuffled = np.empty_like(points)
        shuffled[order] = points
        points, cells = shuffled, order[cells][::-1]
    v = cut_mesh(SimplexMesh(points, cells), [Polyline(np.array([[-0.1, 0.4], [0.7, 0.6]]) @ Q.T)])
    top = np.abs((v.mesh.points @ Q)[:, 1] - 1.0) < 1e-9
    mass = side_wise_mass(v, DENSITY)
    body = DynamicBody(
        InternalForce(v, material(2)),
        mass,
        weight=mass.weight(Q @ [0.0, -GRAVITY]),
        supports=Supports.none(v).prescribe(v, top),
    )
    return body, Q


@pytest.mark.parametrize("scheme", [RealTimeEuler, CentralDifferences, Trapezoidal, EnergyMomentum])
def test_motion_turns_with_the_problem_and_does_not_see_the_numbering(scheme):
    order = np.random.default_rng(4).permutation(36)
    ends = []
    for angle, shuffle in ((0.0, None), (2.3, None), (0.0, order)):
        body, Q = _hanging(angle, shuffle)
        state, integrator = body.rest(), scheme(body, 0.01)
        for _ in range(40):
            integrator.step(state)
        u = state.displacement[: len(body.force.phantom.mesh.points)] @ Q
        ends.append(u if shuffle is None else u[shuffle])
    assert np.abs(ends[0]).max() > 0.05
    # round-off and Newton's tolerance, over 40 steps
    assert np.abs(ends[1] - ends[0]).max() < 1e-10
    assert np.abs(ends[2] - ends[0]).max() < 1e-10
