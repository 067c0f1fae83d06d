"""Linear statics of a cut body."""

from dataclasses import dataclass
from time import perf_counter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from verify.xfem.assembly import body_pattern, constrain
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.elasticity import Material
from verify.xfem.errors import NotConvergedError, XfemError
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce
from verify.xfem.kernels import PLAIN, Kernels
from verify.xfem.linear_solvers import LinearSolver
from verify.xfem.supports import Supports, check_bodies
from verify.xfem.virtual import VirtualMesh

__all__ = ["ITERATE_FROM", "StaticSolution", "solve_static"]

_Floats = NDArray[np.float64]

ITERATE_FROM = 2000  # nodes in space: docs/theory/linear-solvers.md has the measurement
_ROUNDING = 1e-13  # relative residual that a factorisation leaves, too
_MOST = 2000  # iterations before a factorisation is the quicker way


@dataclass(frozen=True)
class StaticSolution:
    """Equilibrium of a cut body.

    Attributes
    ----------
    displacement : (N, d) float array
        At the unknown nodes, in metres.
    strain_energy : float
        ½ uᵀKu, in joules (per metre of thickness in 2D).
    reaction : (N, d) float array
        Forces of the supports, in newtons; zero where not supported.
    residual : float
        Largest unbalanced force over the largest force in the body.
    timings : dict of str to float
        Wall seconds of ``analysis`` (sparsity and symbolic factorisation), ``assembly``,
        ``factorisation`` and ``solve``.
    penalty_energy : float
        Energy of a ghost penalty, not part of the strain energy.
    solver : {"direct", "iterative"}
        What has solved it.
    """

    displacement: _Floats
    strain_energy: float
    reaction: _Floats
    residual: float
    timings: dict[str, float]
    penalty_energy: float = 0.0
    solver: str = "direct"


def solve_static(
    virtual: VirtualMesh,
    material: Material,
    supports: Supports,
    load: _Floats | None = None,
    solver: Literal["auto", "direct", "iterative"] = "auto",
    ghost: GhostPenalty | None = None,
    kernels: Kernels = PLAIN,
) -> StaticSolution:
    """Solve K u = f.

    Parameters
    ----------
    virtual : VirtualMesh
        With slivers as a policy of `verify.xfem.slivers` left them, or untreated.
    material : Material
    supports : Supports
    load : (N, d) float array, optional
        Nodal forces in newtons.
    solver : {"auto", "direct", "iterative"}
        Factorisation, or conjugate gradients down to the residual that a factorisation leaves.
        ``auto`` takes the faster one: the latter for solids
        of 2000 nodes and more, without a ghost penalty; and the former after all if the latter do
        not converge (thin bodies that bend).
    ghost : GhostPenalty, optional
        Added to the stiffness.
    kernels : Kernels
        Whose linear solvers are taken.

    Raises
    ------
    UnsupportedBodyError
        If a free piece can move rigidly.
    SingularStiffnessError
        If the stiffness is not positive definite for another reason.
    XfemError
        If shapes do not match or a load is not finite.
    """
    shape = virtual.node_points.shape
    force = np.zeros(shape) if load is None else np.asarray(load, dtype=float)
    if force.shape != shape or supports.fixed.shape != shape or not np.isfinite(force).all():
        raise XfemError(
            f"load {force.shape} and supports {supports.fixed.shape}; expected finite {shape}"
        )
    check_bodies(virtual, supports)
    method, limit = _method(solver, virtual, ghost)
    stiffness = InternalForce(virtual, material, "linear", kernels)
    clock = [perf_counter()]
    pattern = ghost.pattern() if ghost else body_pattern(virtual)
    inverse = _inverse(kernels, method, pattern, supports, limit)
    clock.append(perf_counter())
    blocks, right = _system(stiffness, ghost, pattern, supports, force)
    clock.append(perf_counter())
    inverse.factorize(blocks)
    clock.append(perf_counter())
    try:
        displacement = inverse.solve(right)
    except NotConvergedError:
        if solver != "auto":
            raise
        method = "direct"
        inverse = _inverse(kernels, method, pattern, supports, limit)
        inverse.factorize(blocks)
        displacement = inverse.solve(right)
    displacement += supports.values
    clock.append(perf_counter())
    phases = ("analysis", "assembly", "factorisation", "solve")
    timings = dict(zip(phases, np.diff(clock).tolist(), strict=True))
    return _solution(stiffness, ghost, supports, force, displacement, timings, method)


def _method(solver: str, virtual: VirtualMesh, ghost: GhostPenalty | None) -> tuple[str, int]:
    """Direct or iterative, and how many iterations that may take."""
    if solver not in ("auto", "direct", "iterative"):
        raise XfemError(f"solver '{solver}'; expected auto, direct or iterative")
    if solver != "auto":
        return solver, 5 * _MOST
    large = virtual.cells.shape[1] == 4 and virtual.node_count >= ITERATE_FROM
    return "iterative" if large and ghost is None else "direct", _MOST


def _system(
    stiffness: InternalForce,
    ghost: GhostPenalty | None,
    pattern: BlockPattern,
    supports: Supports,
    force: _Floats,
) -> tuple[_Floats, _Floats]:
    """Blocks of the matrix, and the right-hand side (N, d) for what is added to the supports."""
    blocks = stiffness.stiffness(pattern)
    internal, _ = stiffness.evaluate(supports.values)
    if ghost:
        ghost.add_stiffness(pattern, blocks)
        internal += ghost.force(supports.values)[0]
    constrain(pattern.starts, pattern.columns, supports.fixed, blocks)
    return blocks, np.where(supports.fixed, 0.0, force - internal)


def _inverse(
    kernels: Kernels, solver: str, pattern: BlockPattern, supports: Supports, limit: int
) -> LinearSolver:
    block = supports.fixed.shape[1]
    if solver == "iterative":
        return kernels.iterative(pattern, block, _ROUNDING, limit)
    return kernels.direct(pattern, block, supports.fixed.all(axis=1))


def _solution(
    stiffness: InternalForce,
    ghost: GhostPenalty | None,
    supports: Supports,
    force: _Floats,
    displacement: _Floats,
    timings: dict[str, float],
    solver: str,
) -> StaticSolution:
    """Energies, reactions (N) and residual of a displacement (N, d) under forces (N, d)."""
    internal, energy = stiffness.evaluate(displacement)
    penalty, penalty_energy = ghost.force(displacement) if ghost else (0.0, 0.0)
    internal += penalty
    unbalanced = internal - force
    scale = max(np.abs(internal).max(), np.abs(force).max(), np.finfo(float).tiny)
    return StaticSolution(
        displacement=displacement,
        strain_energy=energy,
        reaction=np.where(supports.fixed, unbalanced, 0.0),
        residual=float(np.abs(unbalanced[~supports.fixed]).max(initial=0.0) / scale),
        timings=timings,
        penalty_energy=penalty_energy,
        solver=solver,
    )
