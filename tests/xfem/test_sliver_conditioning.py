"""Condition numbers against the size of a sliver, in every basis, and what a ghost penalty does.

The table is that of the reference-case catalogue: 8×8 squares, diagonals alternating, the first
one falling, plane strain, both edges held. Smallest eigenvalues are taken from the inverse of
the scaled matrix, because round-off hides those of the raw one.
"""

import numpy as np
import pytest
import xfem_exact_fields as exact
from scipy.sparse import csr_array, identity, kron
from test_slivers import body, clamped
from xfem_bodies import boundary_nodes, relative_l2_error, sparse_stiffness

from verify.xfem.bases import transformed_matrix
from verify.xfem.critical_step import critical_step
from verify.xfem.cuts import Plane
from verify.xfem.elasticity import isotropic
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import solve_static
from verify.xfem.structured_meshes import rectangle_mesh
from verify.xfem.supports import Supports

SIZES = [0.5, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6]
SHIFTED_RAW = [6.6e2, 9.4e2, 4.7e4, 4.7e6, 4.7e8, 4.7e12]


def alternating(count):
    points = rectangle_mesh((count, count)).points
    cells = []
    for j in range(count):
        for i in range(count):
            a = i + (count + 1) * j
            b, c, d = a + 1, a + count + 2, a + count + 1
            rising = [[a, b, c], [a, c, d]]
            cells += rising if (i + j) % 2 else [[a, b, d], [b, c, d]]
    return SimplexMesh(points, cells)


def condition_numbers(phantom, basis):
    """Raw and with Jacobi scaling."""
    matrix, held = sparse_stiffness(phantom, 1e4), clamped(phantom).fixed
    if basis != "sidewise":
        matrix = transformed_matrix(phantom, basis, csr_array(matrix))
        nodes = held[: len(phantom.mesh.points)]
        held = np.concatenate([nodes, nodes[phantom.enriched_nodes]])
    free = ~held.ravel()
    dense = matrix.toarray()[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(np.diag(dense))
    scaled = scale[:, None] * dense * scale
    inverse = scale[:, None] * np.linalg.inv(scaled) * scale
    values = np.linalg.eigvalsh(scaled)
    raw = np.linalg.eigvalsh(dense)[-1] * np.linalg.eigvalsh(inverse)[-1]
    return raw, values[-1] / values[0]


def table(basis):
    mesh = alternating(8)
    cuts = [Plane([0.0, 0.5 + size / 8], [0.0, 1.0]) for size in SIZES]
    return np.transpose([condition_numbers(cut_mesh(mesh, [cut]), basis) for cut in cuts])


def test_shifted_unknowns_have_the_condition_numbers_of_the_catalogue():
    """Raw ∝ ε⁻²; with Jacobi scaling from 349 up to 468. As exact as the digits given."""
    raw, scaled = table("shifted")
    assert raw == pytest.approx(SHIFTED_RAW, rel=0.01)
    assert scaled[[0, -1]] == pytest.approx([349.0, 468.0], abs=0.5)
    assert (np.diff(scaled) > 0.0).all()


def test_side_wise_unknowns_have_the_smallest_scaled_condition_numbers_and_they_fall():
    """Towards the conforming mesh's, where the cut runs along the nodes."""
    raw, scaled = table("sidewise")
    limit = condition_numbers(cut_mesh(alternating(8), [Plane([0.0, 0.5], [0.0, 1.0])]), "sidewise")
    assert raw[-1] / raw[-2] == pytest.approx(1e4, rel=0.01)
    assert (np.diff(scaled) < 0.0).all()
    assert scaled[-1] == pytest.approx(limit[1], rel=1e-3)
    assert (scaled < table("shifted")[1]).all()


def ghost_stiffness(phantom, ghost):
    return sparse_stiffness(phantom) + kron(ghost.matrix, identity(phantom.mesh.dim))


@pytest.mark.parametrize("dim", [2, 3])
def test_a_ghost_penalty_bounds_the_raw_condition_number(dim):
    """At most three times that of the cut through the middle of the elements."""
    raw = []
    for size in (0.5, 1e-2, 1e-6, 1e-12):
        phantom = body(dim, size)
        ghost = GhostPenalty(phantom, isotropic(1.0, 0.3, "plane strain"), 0.1)
        free = ~clamped(phantom).fixed.ravel()
        values = np.linalg.eigvalsh(ghost_stiffness(phantom, ghost).toarray()[np.ix_(free, free)])
        raw.append(values[-1] / values[0])
    assert max(raw) < 3.0 * raw[0]


@pytest.mark.parametrize("dim", [2, 3])
def test_a_ghost_penalty_keeps_the_explicit_step_only_with_its_mass(dim):
    """With its mass the penalty's own waves are no faster than those of the elements."""
    uncut = cut_mesh(body(dim, 0.5).mesh, [])
    whole = critical_step(csr_array(sparse_stiffness(uncut)), side_wise_mass(uncut, 1.0))
    for size in (0.5, 1e-2, 1e-6, 1e-12):
        phantom = body(dim, size)
        ghost = GhostPenalty(phantom, isotropic(1.0, 0.3, "plane strain"), 0.01)
        lumped = side_wise_mass(phantom, 1.0)
        stiffness = csr_array(ghost_stiffness(phantom, ghost))
        with_mass = ghost.mass(lumped, 1.0)
        assert critical_step(stiffness, with_mass) > 0.99 * whole
        assert with_mass.matrix.sum() == pytest.approx(1.0, rel=1e-12)
    assert critical_step(stiffness, lumped) < 1e-6 * whole


def test_a_ghost_penalty_costs_less_than_half_a_percent_of_accuracy_and_nothing_if_linear():
    mesh = alternating(16)
    phantom = cut_mesh(mesh, [Plane([0.5, 0.5], [-1.0, 3.0])])
    material = isotropic(1.0, 0.3, "plane strain")
    ghost = GhostPenalty(phantom, material)
    linear = phantom.node_points @ np.array([[0.1, 0.7], [-0.4, 0.2]])
    assert np.abs(ghost.force(linear)[0]).max() < 1e-14
    supports = Supports.none(phantom).prescribe(phantom, boundary_nodes(mesh), exact.f3)
    plain = solve_static(phantom, material, supports)
    errors = [relative_l2_error(phantom, plain.displacement, exact.f3)]
    for solver in ("direct", "iterative"):
        solution = solve_static(phantom, material, supports, solver=solver, ghost=ghost)
        errors.append(relative_l2_error(phantom, solution.displacement, exact.f3))
        assert solution.residual < 1e-9
        assert 0.0 < solution.penalty_energy < 1e-3 * solution.strain_energy
    assert errors[1:] == pytest.approx([errors[0]] * 2, rel=5e-3)
