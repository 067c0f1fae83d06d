"""A body cut further keeps its order of elimination; a cut alone is split as one among others."""

import numpy as np
from cut_bodies import material

from verify.accelerated.cholesky import Cholesky
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.xfem.cuts import ToolPath
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import side_wise_mass
from verify.xfem.structured_meshes import box_mesh

ROUND_OFF = 1e-10  # relative residual: thousands of operations on numbers within 1e4 of each other


def under_the_knife():
    """Block, and three strokes through it, one after the other."""
    cutter = SemiProgressiveCutter(box_mesh((6, 6, 2)))
    for k, x in enumerate((0.23, 0.51, 0.77)):
        tips = np.array([[x, -0.1, 1.1], [x + 0.07, 1.1, 1.1]])
        cutter.begin(ToolPath.of_tip(tips, [k, k + 1.0], [0.0, 0.0, -1.3]))
    return cutter


def system(cutter, rng):
    """Sparsity, and blocks of a stiffness with a mass: positive definite."""
    phantom = cutter.phantom_mesh()
    pattern = side_wise_mass(phantom, 1000.0).pattern(phantom)
    blocks = np.zeros((len(pattern.columns), 3, 3))
    force = InternalForce(phantom, material(3))
    force.evaluate(0.01 * rng.standard_normal((phantom.node_count, 3)))
    force.add_stiffness(pattern, blocks)
    blocks[pattern.diagonal] += np.abs(blocks).max() * 1e-3 * np.eye(3)
    return pattern, blocks


def test_a_solver_extended_at_every_cut_still_solves_its_system() -> None:
    cutter, rng = under_the_knife(), np.random.default_rng(5)
    solver = Cholesky(system(cutter, rng)[0], 3)
    cuts, worn = 0, False
    for time in np.linspace(0.1, 3.0, 24):
        increment = cutter.advance(time)
        if increment is None:
            continue
        pattern, blocks = system(cutter, rng)
        solver = solver.extended(pattern, increment.source)
        solver.factorize(blocks)
        load = rng.standard_normal((pattern.node_count, 3))
        error = pattern.matrix(blocks) @ solver.solve(load).ravel() - load.ravel()
        assert np.linalg.norm(error) < ROUND_OFF * np.linalg.norm(load)
        worn, cuts = worn or solver.is_worn, cuts + 1
    assert cuts > 12
    # kept too long an order costs more than another would, and the solver says so
    assert worn
    anew = Cholesky(pattern, 3)
    assert not anew.is_worn
    assert anew.factor_entries < solver.factor_entries
