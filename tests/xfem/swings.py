"""Bodies held at one face and let go from a stretch of 15 %: what their energy does."""

import numpy as np
from cut_bodies import DENSITY, material, shaken

import verify.xfem as xfem
from verify.xfem.block_pattern import body_pattern
from verify.xfem.internal_force import inverted_cells

STRAIN, POISSON = 0.15, 0.3


def rest_step(phantom, mass, stuff):
    force = xfem.InternalForce(phantom, stuff, "linear")
    pattern = body_pattern(phantom)
    blocks = force.stiffness(pattern, np.zeros_like(phantom.node_points), "rotation-fixed")
    return xfem.critical_step(pattern.matrix(blocks), mass)


def stretched(points):
    """First mode of a bar of length 1 held at x = 0, its sides drawn in by ν: 15 % strain there.

    A start and no result, so that it may be that of the study of slivers, whose tables these tests
    of the library are read beside; energies and inversions are counted here on their own.
    """
    along = points[:, 0]
    displacement = np.zeros_like(points)
    displacement[:, 0] = STRAIN * np.sin(np.pi * along / 2) * 2 / np.pi
    contraction = -POISSON * STRAIN * np.cos(np.pi * along / 2)
    displacement[:, 1:] = contraction[:, None] * (points[:, 1:] - 0.5)
    displacement[along < 1e-9] = 0.0
    return displacement


def uniform(points):
    return 0.15 * points * np.eye(points.shape[1])[0]


def aggregated(phantom):
    """The body and the report of the default sliver policy, held where `let_go` holds it."""
    return xfem.treat_slivers(phantom, supported=phantom.node_points[:, 0] < 1e-9)


def let_go(phantom, share, steps, every=10, start=stretched):
    """Largest energy over that at the start, and at how many instants a piece was inverted."""
    stuff = material(phantom.mesh.dim)
    mass = xfem.side_wise_mass(phantom, DENSITY)
    force = xfem.InternalForce(phantom, stuff)
    supports = xfem.Supports.none(phantom).prescribe(phantom, phantom.mesh.points[:, 0] < 1e-9)
    dynamic = xfem.DynamicBody(force, mass, supports=supports)
    state = dynamic.rest()
    state.displacement[:] = start(phantom.node_points)
    before = force.evaluate(state.displacement)[1]
    integrator = xfem.CentralDifferences(dynamic, share * rest_step(phantom, mass, stuff))
    largest, inverted = 0.0, 0
    for step in range(steps):
        integrator.step(state)
        if step % every == 0:
            inverted += len(inverted_cells(force, state.displacement)) > 0
            kinetic = 0.5 * (mass.apply(state.velocity) * state.velocity).sum()
            largest = max(largest, (force.evaluate(state.displacement)[1] + kinetic) / before)
            if not largest < 100.0:
                break
    return largest, inverted


def plate(seed):
    random = np.random.default_rng(100 + seed)
    normal = random.normal(size=2)
    mesh = shaken(xfem.rectangle_mesh((8, 8)), seed, 0.1)
    return xfem.cut_mesh(mesh, [xfem.Plane(0.5 + 0.05 * random.uniform(-1.0, 1.0, 2), normal)])


def cube(seed):
    random = np.random.default_rng(100 + seed)
    normal = random.normal(size=3)
    cut = xfem.Plane(0.5 + 0.05 * random.uniform(-1.0, 1.0, 3), normal)
    return xfem.cut_mesh(xfem.box_mesh((3, 3, 3)), [cut])
