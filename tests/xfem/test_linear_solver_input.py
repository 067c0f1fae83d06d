"""Input that fits no linear solver is refused in one sentence; extreme loads are solved for."""

from contextlib import suppress
from functools import partial

import numpy as np
import pytest

from verify.accelerated.cholesky import Cholesky
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.accelerated.nearly_symmetric import NearlySymmetric
from verify.xfem.block_pattern import block_pattern
from verify.xfem.errors import NotConvergedError, SingularStiffnessError, XfemError
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


@pytest.mark.parametrize("kind", SOLVERS)
@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_load_that_is_not_finite_is_named_by_its_node(kind, wrong):
    """An infinite one was solved for by zero, without a word."""
    pattern, blocks, load = system("block")
    solver = SOLVERS[kind](pattern, 3)
    solver.factorize(blocks)
    load[7, 1] = wrong
    with pytest.raises(XfemError, match="right-hand side is not finite, first at dof node 7"):
        solver.solve(load)


@pytest.mark.parametrize("kind", SOLVERS)
def test_blocks_and_loads_of_another_body_are_refused(kind):
    """The kernels check no bounds: more loads than nodes overwrote memory of others."""
    pattern, blocks, load = system("block")
    solver = SOLVERS[kind](pattern, 3)
    with pytest.raises(RuntimeError, match="solve before factorize"):
        solver.solve(load)
    for wrong in (blocks[:-1], blocks[:, :, :2], blocks.astype("f4"), blocks.ravel()):
        with pytest.raises(XfemError, match="blocks of shape"):
            solver.factorize(wrong)
    solver.factorize(blocks)
    for wrong in (load[:-1], np.concatenate([load, load]), load.ravel(), load[:, :2]):
        with pytest.raises(XfemError, match="right-hand"):
            solver.solve(wrong)
    # whole numbers and any order in memory are welcome
    ones = np.ones(load.shape, dtype=int)
    assert np.array_equal(solver.solve(ones), solver.solve(np.asfortranarray(ones, dtype=float)))


@pytest.mark.parametrize("name", MESHES)
def test_conjugate_gradients_that_break_down_say_so(name):
    """Where the residual stagnates at round-off, their recurrence once divided by zero."""
    for seed, multiple in enumerate([1e-9, 1e-11, 1e-12, 1e-13, 1e-15, 3e-16]):
        pattern, blocks, _ = system(name, multiple)
        load = np.random.default_rng(seed).normal(size=(pattern.node_count, blocks.shape[1]))
        solver = ConjugateGradients(pattern, blocks.shape[1], 1e-10)
        solver.factorize(blocks)
        with suppress(NotConvergedError, SingularStiffnessError):
            found = solver.solve(load)
            left = pattern.matrix(blocks) @ found.ravel() - load.ravel()
            # the residual of the recurrence, and what round-off of K x leaves of it
            allowed = 1e-10 * np.linalg.norm(load) + 1e-14 * np.linalg.norm(found)
            assert np.linalg.norm(left) < 10.0 * allowed


def test_patterns_of_cells_that_make_no_sense_are_refused():
    for cells, nodes, message in (
        ([[0, 1, 7]], 3, "outside 0..2"),
        ([[0, 1, -1]], 3, "outside 0..2"),
        ([[0, 1, 2]], 5, "node"),
        ([[0.0, 1.0, 2.0]], 3, "expected integers"),
        ([0, 1, 2], 3, "expected integers"),
    ):
        with pytest.raises(XfemError, match=message):
            block_pattern(np.array(cells), nodes)
    pattern, _, _ = system("block")
    with pytest.raises(XfemError, match="held nodes"):
        Cholesky(pattern, 3, np.zeros(3, dtype=bool))
    with pytest.raises(XfemError, match="held nodes"):
        Cholesky(pattern, 3, np.zeros(pattern.node_count, dtype=int))
