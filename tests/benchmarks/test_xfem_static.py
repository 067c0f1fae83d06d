"""Cost of cutting and of linear statics, single thread, compilation excluded.

Absolute times are for the reader; what is asserted are ratios on the same matrix in the same run.
"""

from time import perf_counter

import numpy as np
import pytest
import scipy.sparse as sparse
from scipy.sparse.linalg import splu

from verify.accelerated.cholesky import Cholesky
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.xfem.block_pattern import block_pattern, constrain
from verify.xfem.cuts import Plane, Polyline
from verify.xfem.element import isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import Supports, body_force
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

pytestmark = pytest.mark.timing

BODIES = {
    # the mesh of F3 at h = 1/64: 8668 unknowns
    "plate 64×64": (rectangle_mesh((64, 64)), Polyline([[-1.0, 0.0], [2.0, 1.0]])),
    # the size of the real-time target: 1014 tetrahedra, 1512 unknowns
    "slab of 1014": (
        box_mesh((13, 13, 1), (0, 0, 0), (13, 13, 1)),
        Plane([6.5, 6.5, 0.5], [1.0, 0.9, 0.4]),
    ),
    "cube of 10368": (box_mesh((12, 12, 12)), Plane([0.5, 0.5, 0.5], [-1.0, -2.0, 3.0])),
}


def prepare(name):
    mesh, cut = BODIES[name]
    phantom = cut_mesh(mesh, [cut])
    stiffness = InternalForce(phantom, isotropic(1.0, 0.3, "solid"), "linear")
    pattern = block_pattern(phantom.cells, phantom.node_count)
    blocks = stiffness.stiffness(pattern)
    first = mesh.points[:, 0]
    ends = (first == first.min()) | (first == first.max())
    supports = Supports.none(phantom).prescribe(phantom, ends)
    constrain(pattern, supports.fixed, blocks)
    load = np.where(supports.fixed, 0.0, body_force(phantom, -np.ones(mesh.dim)))
    return phantom, stiffness, pattern, blocks, load


def median_seconds(action, repetitions=15):
    action()
    times = []
    for _ in range(repetitions):
        start = perf_counter()
        action()
        times.append(perf_counter() - start)
    return float(np.median(times))


@pytest.mark.parametrize("name", BODIES)
def test_cutting_a_mesh(benchmark, name):
    mesh, cut = BODIES[name]
    cut_mesh(mesh, [cut])  # adjacency of the uncut mesh is kept
    phantom = benchmark(cut_mesh, mesh, [cut])
    benchmark.extra_info["split cells"] = len(np.unique(phantom.parent[phantom.split]))


@pytest.mark.parametrize("name", BODIES)
def test_assembly(benchmark, name):
    _, stiffness, pattern, *_ = prepare(name)
    benchmark(stiffness.stiffness, pattern)


@pytest.mark.parametrize("name", BODIES)
def test_symbolic_analysis(benchmark, name):
    _, _, pattern, blocks, _ = prepare(name)
    benchmark(Cholesky, pattern, blocks.shape[1])


@pytest.mark.parametrize("name", BODIES)
def test_refactorisation_and_solve(benchmark, name):
    _, _, pattern, blocks, load = prepare(name)
    solver = Cholesky(pattern, blocks.shape[1])

    def step():
        solver.factorize(blocks)
        return solver.solve(load)

    benchmark(step)


@pytest.mark.parametrize("name", BODIES)
def test_conjugate_gradients(benchmark, name):
    _, _, pattern, blocks, load = prepare(name)
    solver = ConjugateGradients(pattern, blocks.shape[1], tolerance=1e-8)

    def step():
        solver.factorize(blocks)
        return solver.solve(load)

    benchmark(step)
    benchmark.extra_info["iterations"] = solver.iterations


@pytest.mark.parametrize("name", ["plate 64×64", "slab of 1014"])
def test_refactorisation_and_solve_take_at_most_half_of_superlu_s_time(name):
    """Measured: a fifth to an eighth. Half leaves room for a noisy machine."""
    _, _, pattern, blocks, load = prepare(name)
    solver = Cholesky(pattern, blocks.shape[1])
    matrix = sparse.csc_matrix(pattern.matrix(blocks))
    right = load.ravel()

    def ours():
        solver.factorize(blocks)
        solver.solve(load)

    def superlu():
        options = {"SymmetricMode": True}
        splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options).solve(
            right
        )

    assert median_seconds(ours) < 0.5 * median_seconds(superlu)


def test_the_cost_of_cutting_stays_below_that_of_one_direct_solve():
    """F3 at h = 1/64: enrichment is not what one waits for."""
    mesh, cut = BODIES["plate 64×64"]
    _, _, pattern, blocks, load = prepare("plate 64×64")

    def solve():
        solver = Cholesky(pattern, 2)
        solver.factorize(blocks)
        solver.solve(load)

    assert median_seconds(lambda: cut_mesh(mesh, [cut])) < median_seconds(solve)
