"""Plain and fast kernels give one answer, to round-off: plates, blocks, membranes, slivers."""

from dataclasses import replace

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_membrane, isotropic
from turned_bodies import random_mesh

import verify.xfem as xfem
from verify.accelerated import FAST
from verify.accelerated.cholesky import Cholesky
from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.body import RayleighDamping
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.linear_solvers import PLAIN
from verify.xfem.real_time import RealTimeEuler

# the plain one otherwise, of bodies as small as these
KERNELS = {"plain": PLAIN, "fast": replace(FAST, direct=Cholesky)}


def _stuff(phantom):
    mesh = phantom.mesh
    kind = "solid" if mesh.dim == 3 else "plane strain" if mesh.space == 2 else "plane stress"
    return isotropic(1e4, 0.3, kind)


def _cut(mesh, fraction=0.43):
    """Across in a general position, or beside the nodes of a plane of them."""
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    normal = np.array([1.0, 0.37, -0.21])[: mesh.space]
    if fraction < 0.1:
        normal[1:] = 0.0
    return xfem.cut_mesh(mesh, [xfem.Plane(low + (0.4 + fraction) * (high - low), normal)])


BODIES = {
    "plate": lambda: _cut(random_mesh(3, 2, 5)),
    "membrane": cut_membrane,
    "block": lambda: _cut(random_mesh(4, 3, 3)),
    "block with slivers": lambda: _cut(xfem.box_mesh((3, 3, 3)), 1e-6),
    "block with aggregated slivers": lambda: xfem.treat_slivers(
        _cut(xfem.box_mesh((3, 3, 3)), 1e-3)
    )[0],
}


def _held(phantom):
    points = phantom.mesh.points
    low, high = points[:, 0].min(), points[:, 0].max()
    ends = (points[:, 0] == low) | (points[:, 0] == high)
    held = xfem.Supports.none(phantom).prescribe(phantom, ends)
    if phantom.mesh.dim < phantom.mesh.space:  # resists in its plane alone
        whole = np.ones(len(points), dtype=bool)
        held = held.prescribe(phantom, whole, components=(2,))
    return held


def _load(phantom):
    return xfem.body_force(phantom, [30.0, -20.0, 10.0][: phantom.mesh.space])


def test_linear_statics_with_a_ghost_penalty():
    phantom = BODIES["block with slivers"]()
    stuff, held, load = _stuff(phantom), _held(phantom), _load(phantom)
    ghost = GhostPenalty(phantom, stuff)
    plain, fast = (
        xfem.solve_static(phantom, stuff, held, load, ghost=ghost, kernels=kernels)
        for kernels in KERNELS.values()
    )
    assert plain.strain_energy == pytest.approx(fast.strain_energy, rel=1e-11)


@pytest.mark.parametrize(
    ("scheme", "name"),
    [
        *((RealTimeEuler, name) for name in BODIES),
        *((xfem.EnergyMomentum, name) for name in BODIES),
        *((scheme, "block") for scheme in (ImplicitEuler, Trapezoidal, GeneralisedAlpha)),
    ],
)
def test_motion(scheme, name):
    phantom = BODIES[name]()
    moved = []
    for kernels in KERNELS.values():
        mass = xfem.side_wise_mass(phantom, DENSITY)
        body = xfem.DynamicBody(
            xfem.InternalForce(phantom, _stuff(phantom), kernels=kernels),
            mass,
            weight=mass.weight([3.0, -2.0, 1.0][: phantom.mesh.space]),
            supports=_held(phantom),
        )
        integrator, state = scheme(body, 0.02), body.rest()
        for _ in range(3):
            integrator.step(state)
        moved.append(state)
    plain, fast = moved
    # each step is solved to 1e-10 of its forces
    for one, other in ((plain.displacement, fast.displacement), (plain.velocity, fast.velocity)):
        assert np.abs(one - other).max() < 1e-7 * np.abs(other).max()


@pytest.mark.parametrize("kernels", KERNELS.values(), ids=KERNELS)
@pytest.mark.parametrize(
    "scheme", [ImplicitEuler, Trapezoidal, GeneralisedAlpha, xfem.EnergyMomentum]
)
def test_bodies_that_share_their_elements_do_not_see_one_another_move(scheme, kernels):
    """Damping of the stiffness and tangents take the rotations of their own body."""
    phantom = BODIES["block"]()
    mass, damping = xfem.side_wise_mass(phantom, DENSITY), RayleighDamping(0.0, 0.01)

    def motion(with_another):
        force = xfem.InternalForce(phantom, _stuff(phantom), kernels=kernels)
        body = xfem.DynamicBody(force, mass, mass.weight([3.0, -2.0, 1.0]), damping=damping)
        one, other = body.held_by(_held(phantom)), body.held_by(xfem.Supports.none(phantom))
        state, turning = one.rest(), other.rest()
        turning.velocity[:] = np.cross([20.0, 0.0, 0.0], phantom.node_points)
        schemes = scheme(one, 0.02), scheme(other, 0.02)
        for _ in range(2):
            schemes[0].step(state)
            if with_another:
                schemes[1].step(turning)
        return state.displacement

    alone, beside = motion(False), motion(True)
    # rotations start from others, and end within round-off; a step amplifies it by the tolerance
    assert np.abs(beside - alone).max() < 1e-9 * np.abs(alone).max()
