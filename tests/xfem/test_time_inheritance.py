"""Cutting a body in motion changes neither its energy nor its momenta."""

import numpy as np
import pytest
from cut_bodies import material, rotation

from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.cuts import Plane, PolygonPatch, Polyline
from verify.xfem.energy_balance import BalanceRecorder
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import consistent_mass, side_wise_mass
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
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
        "in space, the second along faces": (box_mesh((2, 2, 2)), [[], [flat], [flat, upright]]),
    }


@pytest.mark.parametrize("mass", [side_wise_mass, consistent_mass])
@pytest.mark.parametrize("history", _histories())
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
            at = account.close()
            energies = [s.time, at.kinetic[0], at.strain[0]]
            rows.append(np.concatenate([energies, at.momentum[0], at.angular_momentum[0]]))
        assert np.allclose(rows[0], rows[1], rtol=1e-12, atol=1e-12 * np.abs(rows[0]).max())
        # then the two sides go their own ways, and the next cut inherits that
        after.displacement += rng.normal(scale=0.02, size=after.displacement.shape)
        old, state = new, after
