"""Input that fits no linear solver is refused in one sentence; extreme loads are solved for."""

from functools import partial

import numpy as np
import pytest

from verify.accelerated.cholesky import Cholesky
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.accelerated.nearly_symmetric import NearlySymmetric
from verify.xfem.block_pattern import block_pattern
from verify.xfem.linear_solvers import BlockJacobiCG, SparseLU
from verify.xfem.mesh import SimplexMesh
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh

SOLVERS = {
    "Cholesky": Cholesky,
    "ConjugateGradients": ConjugateGradients,
    "SparseLU": SparseLU,
    "definite SparseLU": partial(SparseLU, definite=True),
    "BlockJacobiCG": BlockJacobiCG,
    "NearlySymmetric": NearlySymmetric,
}
TWO = SimplexMesh(
    np.concatenate([np.eye(4)[:, 1:], np.eye(4)[:, 1:] + 5.0]), np.arange(8).reshape(2, 4)
)
MESHES = {
    "one tetrahedron": SimplexMesh(np.eye(4)[:, 1:], np.array([[0, 1, 2, 3]])),
    "two apart": TWO,
    "block": box_mesh((2, 2, 2)),
    "plate": rectangle_mesh((4, 4)),
}


def system(name, multiple=1.0):
    """A stiffness without supports (of springs between nodes) and a multiple of the identity."""
    mesh = MESHES[name]
    pattern = block_pattern(mesh.cells, len(mesh.points))
    blocks = np.zeros((len(pattern.columns), mesh.dim, mesh.dim))
    for cell, nodes in enumerate(mesh.cells):
        for a in range(len(nodes)):
            for b in range(a):
                along = mesh.points[nodes[a]] - mesh.points[nodes[b]]
                spring = np.outer(along, along) / (along @ along)
                for i, j in ((a, b), (b, a)):
                    blocks[pattern.targets[cell, i, i]] += spring
                    blocks[pattern.targets[cell, i, j]] -= spring
    blocks[pattern.diagonal] += multiple * np.eye(mesh.dim)
    load = np.random.default_rng(0).normal(size=mesh.points.shape)
    return pattern, blocks, load


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("kind", SOLVERS)
def test_a_free_body_that_its_mass_alone_holds_is_solved_at_any_step_and_size_of_load(kind, name):
    """The mass over the square of the step is 1e-3 to 1e16 of the stiffness; loads scale.

    Conjugate gradients used to return zero, as converged, for loads whose square leaves the range
    of floating-point numbers.
    """
    for multiple in (1e-3, 1.0, 1e16):
        pattern, blocks, load = system(name, multiple)
        solver = SOLVERS[kind](pattern, blocks.shape[1])
        solver.factorize(blocks)
        K = pattern.matrix(blocks).toarray()
        for size in (1.0, 1e-200, 1e200) if kind in ("Cholesky", "ConjugateGradients") else (1.0,):
            found = solver.solve(size * load) / size
            left = np.linalg.norm(K @ found.ravel() - load.ravel()) / np.linalg.norm(load)
            assert left < 1e-9
        assert not solver.solve(np.zeros_like(load)).any()
        if kind == "ConjugateGradients":
            assert solver.iterations == 0
