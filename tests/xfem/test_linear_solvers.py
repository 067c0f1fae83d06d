"""The sparse Cholesky factorisation and conjugate gradients against scipy, and their refusals."""

from functools import partial

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.sparse.linalg import spsolve

from verify.accelerated.cholesky import Cholesky
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.accelerated.direct_by_size import DirectBySize
from verify.xfem.block_pattern import block_pattern
from verify.xfem.errors import NotConvergedError, SingularStiffnessError
from verify.xfem.linear_solvers import BlockJacobiCG, SparseLU
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh

LU = partial(SparseLU, definite=True)


def random_system(cells, nodes, block, seed=0):
    """A symmetric positive definite matrix on the pattern of these cells."""
    rng = np.random.default_rng(seed)
    pattern = block_pattern(cells, nodes)
    blocks = np.zeros((len(pattern.columns), block, block))
    corners = cells.shape[1]
    for cell in range(len(cells)):
        half = rng.normal(size=(corners * block, corners * block))
        element = (half @ half.T).reshape(corners, block, corners, block)
        for a in range(corners):
            for b in range(corners):
                blocks[pattern.targets[cell, a, b]] += element[a, :, b]
    blocks[pattern.diagonal] += 0.1 * np.eye(block)
    return pattern, blocks, rng.normal(size=(nodes, block))


MESHES = {
    "plate": rectangle_mesh((9, 7)),
    "long plate": rectangle_mesh((40, 2)),
    "block": box_mesh((3, 4, 3)),
}


@pytest.mark.parametrize("block", [1, 2, 3])
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("method", [Cholesky, ConjugateGradients, LU, BlockJacobiCG])
def test_solutions_equal_those_of_superlu(method, name, block):
    mesh = MESHES[name]
    pattern, blocks, load = random_system(mesh.cells, len(mesh.points), block)
    solver = method(pattern, block)
    solver.factorize(blocks)
    want = spsolve(sparse.csc_matrix(pattern.matrix(blocks)), load.ravel()).reshape(load.shape)
    tolerance = 1e-11 if method in (Cholesky, LU) else 1e-7
    assert np.abs(solver.solve(load) - want).max() < tolerance * np.abs(want).max()


def test_a_badly_scaled_matrix_loses_no_digits():
    """D A D with D over 24 decades: a factorisation's error does not depend on diagonal scaling."""
    mesh = MESHES["plate"]
    pattern, blocks, _ = random_system(mesh.cells, len(mesh.points), 2)
    rng = np.random.default_rng(1)
    scale = 10.0 ** rng.uniform(-12, 12, (len(mesh.points), 2))
    rows = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
    scaled = scale[rows][:, :, None] * blocks * scale[pattern.columns][:, None, :]
    x = rng.normal(size=scale.shape)
    load = (pattern.matrix(blocks) @ x.ravel()).reshape(scale.shape)
    for solver in (Cholesky(pattern, 2), LU(pattern, 2)):
        solver.factorize(scaled)
        got = solver.solve(load * scale) * scale
        assert np.abs(got - x).max() < 1e-10


def test_an_indefinite_matrix_is_refused_by_the_node_where_it_shows():
    mesh = MESHES["plate"]
    pattern, blocks, _ = random_system(mesh.cells, len(mesh.points), 2)
    blocks[pattern.diagonal[17]] *= -1.0
    for method in (Cholesky, ConjugateGradients, DirectBySize, LU, BlockJacobiCG):
        solver = method(pattern, 2)
        with pytest.raises(SingularStiffnessError, match="not positive definite"):
            solver.factorize(blocks)
    blocks[pattern.diagonal[17]] = np.nan
    with pytest.raises(SingularStiffnessError):
        Cholesky(pattern, 2).factorize(blocks)


def _solve(solver, blocks, load):
    solver.factorize(blocks)
    return solver.solve(load)


@pytest.mark.parametrize("method", [Cholesky, ConjugateGradients, LU, BlockJacobiCG])
@pytest.mark.parametrize("name", MESHES)
def test_a_matrix_with_a_null_space_or_a_negative_mode_is_refused(method, name):
    """A chain of springs without support, and one whose stiffness is of the wrong sign inside."""
    mesh = MESHES[name]
    pattern = block_pattern(mesh.cells, len(mesh.points))
    rows = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
    load = np.random.default_rng(0).normal(size=(pattern.node_count, 2))
    for shift in (0.0, -0.3):
        blocks = np.zeros((len(pattern.columns), 2, 2))
        blocks[:] = -np.eye(2)
        count = np.diff(pattern.starts)[rows[pattern.diagonal]] - 1.0 + shift
        blocks[pattern.diagonal] = count[:, None, None] * np.eye(2)
        solver = method(pattern, 2)
        iterates = method in (ConjugateGradients, BlockJacobiCG)
        # iterations see a null space by their residual, a negative mode by its curvature
        wanted = NotConvergedError if iterates and shift == 0.0 else SingularStiffnessError
        with pytest.raises((SingularStiffnessError, wanted)):
            _solve(solver, blocks, load)
