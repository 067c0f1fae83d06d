"""Motion with known answers: a prestrained bar that is cut, the tones of a split cantilever, spin.

The thesis' material (E = 1e4 Pa, ν = .3, ρ = 1000 kg/m³): c_d = 3.668997 m/s.
"""

import numpy as np
import pytest
from cut_bodies import DENSITY, cut_body, material, rotation
from scipy.sparse import kron
from scipy.sparse.linalg import eigsh

from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane, Polyline
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import consistent_mass, side_wise_mass
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

HALF, STRAIN = 0.5, 0.01


def bar(dim, cells):
    """A bar on rollers all along (uniaxial strain), its ends held apart."""
    width = 2.0 * HALF / cells * np.ones(dim - 1)
    lower, upper = [-HALF, *(0.0 * width)], [HALF, *width]
    if dim == 2:
        return rectangle_mesh((cells, 1), lower, upper)
    return box_mesh((cells, 1, 1), lower, upper)


WHOLE, SPLIT, HALF_SPLIT = 0.65408379, 0.33435932, 0.603212


def tones(rows, cuts, mass, columns, count):
    """Lowest angular frequencies of a cantilever of length 1 and depth .2, in 1/s."""
    mesh = rectangle_mesh((columns, rows), upper=(1.0, 0.2))
    v = cut_mesh(mesh, cuts)
    pattern = block_pattern(v.cells, v.node_count)
    K = pattern.matrix(InternalForce(v, material(2), "linear").stiffness(pattern)).tocsc()
    M = kron(mass(v, DENSITY).matrix, np.eye(2)).tocsc()
    free = np.flatnonzero(np.repeat(v.node_points[:, 0] > 1e-12, 2))
    values = eigsh(
        K[free][:, free], k=count, M=M[free][:, free], sigma=0.0, return_eigenvectors=False
    )
    return np.sqrt(np.sort(values))


@pytest.mark.parametrize("mass", [side_wise_mass, consistent_mass])
@pytest.mark.parametrize(
    "cut,exact,count,rate",
    [
        ("none", WHOLE, 1, 1.75),
        ("full", SPLIT, 2, 1.75),
        ("half", HALF_SPLIT, 1, 1.4),  # towards 1: the tip is not enriched
    ],
)
def test_the_lowest_tone_of_a_cantilever_converges_whole_split_and_half_split(
    mass, cut, exact, count, rate
):
    """From above (the whole and the split one: nearly h²), cut through the middle of elements."""
    cuts = {
        "none": [],
        "full": [Plane([0.5, 0.1], [0.0, 1.0])],
        "half": [Polyline([[0.5, 0.1], [1.1, 0.1]])],
    }[cut]
    errors = []
    for rows in (9, 17):
        columns = 5 * rows + 1  # even: the half cut ends on edges
        errors.append(tones(rows, cuts, mass, columns, count) / exact - 1.0)
    coarse, fine = errors
    assert (fine > 0.0).all()
    assert (np.log(coarse / fine) / np.log(17.0 / 9.0) > rate).all()
    assert (fine < 0.03).all()
    # the two halves have the same tone up to their share of the mesh
    assert np.ptp(fine) < 0.1 * fine.max()


def spinning(dim, mass=side_wise_mass):
    """A cut body on its way, turning as a rigid one at 1 rad/s."""
    v = cut_body(dim)
    body = DynamicBody(InternalForce(v, material(dim)), mass(v, DENSITY))
    state, X = body.rest(), v.node_points
    W = (rotation(dim, 0.5 * np.pi) - rotation(dim, -0.5 * np.pi)) / 2.0
    state.velocity[:] = (X - 0.5) @ W.T + 0.1 * np.arange(1, dim + 1)
    return body, state


@pytest.mark.parametrize("dim", [2, 3])
def test_a_rigid_turn_at_constant_rate_stores_nothing_and_keeps_every_momentum(dim):
    """Displacements of a rigid spin, prescribed: no force, no energy, at any angle.

    The exact mass: every axis of a square or cube is a principal one, none of its lumped nodes'.
    """
    body, state = spinning(dim, consistent_mass)
    X = body.force.phantom.node_points - 0.5
    W = (rotation(dim, 0.5 * np.pi) - rotation(dim, -0.5 * np.pi)) / 2.0
    first = None
    for angle in np.linspace(0.0, 2.0 * np.pi, 9):
        R = rotation(dim, angle)
        state.displacement[:] = X @ R.T - X
        state.velocity[:] = X @ R.T @ W.T
        force, energy = body.force.evaluate(state.displacement)
        assert np.abs(force).max() < 1e-10
        assert energy < 1e-12
        where = body.force.phantom.node_points + state.displacement - 0.5
        momenta = body.mass.apply(state.velocity)
        turning = (
            np.cross(where, momenta).sum(axis=0)
            if dim == 3
            else where[:, 0] @ momenta[:, 1] - where[:, 1] @ momenta[:, 0]
        )
        kept = np.concatenate([[np.sum(momenta * state.velocity)], np.atleast_1d(turning)])
        first = kept if first is None else first
        assert np.abs(kept - first).max() < 1e-12 * np.abs(first).max()
