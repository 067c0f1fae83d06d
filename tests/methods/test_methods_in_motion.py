"""Every method moves: the cut body falls, turns and swings by the integrators of the library."""

import numpy as np
import pytest
from method_bodies import CUTTING, held_at

from verify.methods import cut_by
from verify.methods.springs import SpringForce
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Polyline
from verify.xfem.element import isotropic
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.explicit import CentralDifferences
from verify.xfem.implicit import ImplicitEuler
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import rectangle_mesh

MATERIAL = isotropic(1e4, 0.3, "plane strain")
CUT = Polyline([[-1.0, 0.47], [2.0, 0.53]])
LAWS = {"elements": InternalForce, "springs": SpringForce}


def clamped(points):
    return points[:, 1] > 1 - 1e-9


def moved(body, law, scheme, step, also_held=None):
    """Displacement after 20 steps under the weight."""
    phantom = body.phantom
    mass = side_wise_mass(phantom, 1000.0)
    supports = held_at(phantom, clamped)
    if also_held is not None:
        supports.fixed[also_held] = True
    force = LAWS[law](body.resisting, MATERIAL)
    moving = DynamicBody(force, mass, mass.weight([0.0, -9.8]), supports=supports)
    state = moving.rest()
    integrator = scheme(moving, step)
    for _ in range(20):
        integrator.step(state)
    return state.displacement


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("scheme", [CentralDifferences, ImplicitEuler])
@pytest.mark.parametrize("method", CUTTING)
def test_the_freed_half_falls_with_g_and_the_clamped_half_does_not_notice(method, scheme, law):
    body = cut_by(method, rectangle_mesh((4, 4)), [CUT])
    phantom, step = body.phantom, 1e-3
    lower = phantom.bodies == phantom.bodies[np.argmin(phantom.node_points[:, 1])]
    displacement = moved(body, law, scheme, step)
    time = 20 * step
    # the discrete parabolas: t²/2 of central differences, t(t + h)/2 of implicit Euler
    fall = 0.5 * time * (time + (step if scheme is ImplicitEuler else 0.0))
    wanted = np.tile([0.0, -9.8 * fall], (lower.sum(), 1))
    assert displacement[lower] == pytest.approx(wanted, abs=1e-9)
    alone = moved(body, law, scheme, step, also_held=lower)
    # the same to the tolerance of Newton's method, 1e-8 of the largest force
    assert displacement[~lower] == pytest.approx(alone[~lower], abs=1e-9)


@pytest.mark.parametrize("method", CUTTING)
def test_a_half_that_is_turned_by_any_angle_stores_nothing(method):
    body = cut_by(method, rectangle_mesh((5, 5)), [CUT])
    phantom = body.phantom
    boundary = held_at(phantom, lambda points: np.ones(len(points), dtype=bool))
    upper = phantom.bodies == phantom.bodies[np.argmax(phantom.node_points[:, 1])]
    centre = np.array([0.3, 0.8])

    def turned(share):
        angle = share * np.pi / 2
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        arm = phantom.node_points - centre
        moved = arm @ turn.T - arm
        return np.where(upper[:, None], moved, 0.0)

    found = static_equilibrium(
        InternalForce(body.resisting, body.material(MATERIAL)), boundary.fixed, turned,
        load_steps=6,
    )  # fmt: skip
    # round-off of E times the area; 162 J and more with linear kinematics at 30°
    assert found.energy < 1e-16 * 1e4
    assert found.displacement == pytest.approx(turned(1.0), abs=1e-9)
