"""Linear statics of a cut body."""

from dataclasses import dataclass
from functools import cached_property, partial
from time import perf_counter
from typing import Literal

import numpy as np

from verify.xfem.arrays import Bools, Floats, check_choice, finite_array
from verify.xfem.block_pattern import BlockPattern, body_pattern, constrain
from verify.xfem.elasticity import Material
from verify.xfem.errors import NotConvergedError
from verify.xfem.internal_force import InternalForce, Penalty
from verify.xfem.linear_solvers import PLAIN, Kernels, LinearSolver
from verify.xfem.phantom import PhantomMesh
from verify.xfem.supports import Supports, check_bodies

Method = Literal["auto", "direct", "iterative"]

ITERATE_FROM = 2000  # nodes in space, from which iterations are faster (measured)
_ROUNDING = 1e-13  # relative residual that a factorisation leaves, too
_PHASES = ("analysis", "assembly", "factorisation", "solve")
_MOST = 2000  # iterations before a factorisation is the quicker way


@dataclass(frozen=True)
class StaticSolution:
    """Equilibrium of a cut body with linear kinematics.

    Attributes
    ----------
    displacement : (N, d) float array
        At the dof nodes, in metres.
    strain_energy : float
        ½ uᵀKu, in joules (per metre of thickness in 2D).
    reaction : (N, d) float array
        Forces of the supports, in newtons; zero where not supported.
    residual : float
        Largest unbalanced force over the largest force in the body, or the largest entry of K times
        the largest of u if that is larger.
    timings : dict of str to float
        Wall seconds of ``analysis`` (sparsity and symbolic factorisation), ``assembly``,
        ``factorisation`` and ``solve``.
    penalty_energy : float
        Energy of a ghost penalty, not part of the strain energy.
    solver : {"direct", "iterative"}
        What has solved it.
    """

    displacement: Floats
    strain_energy: float
    reaction: Floats
    residual: float
    timings: dict[str, float]
    penalty_energy: float = 0.0
    solver: str = "direct"


def solve_static(
    phantom: PhantomMesh,
    material: Material,
    supports: Supports,
    load: Floats | None = None,
    solver: Method = "auto",
    ghost: Penalty | None = None,
    kernels: Kernels = PLAIN,
) -> StaticSolution:
    """Solve K u = f.

    Parameters
    ----------
    phantom : PhantomMesh
        With slivers as a policy of `verify.xfem.slivers` left them, or untreated.
    material : Material
    supports : Supports
    load : (N, d) float array, optional
        Nodal forces in newtons.
    solver : {"auto", "direct", "iterative"}
        Factorisation, or conjugate gradients down to the residual that a factorisation leaves.
        ``auto`` takes the faster one: iterations for solids of 2000 nodes and more, without a ghost
        penalty; and the factorisation after all if they do not converge (thin bodies that bend).
    ghost : Penalty, optional
        A `verify.xfem.ghost_penalty`, added to the stiffness.
    kernels : Kernels
        Whose linear solvers are taken.

    Raises
    ------
    UnsupportedBodyError
        If a free body can move rigidly.
    SingularStiffnessError
        If the stiffness is not positive definite for another reason.
    XfemError
        If shapes do not match or a load is not finite.

    Examples
    --------
    Two halves that a cut leaves are pulled apart: both are rigid.

    >>> import verify.xfem as xfem
    >>> mesh = xfem.rectangle_mesh((4, 4))
    >>> phantom = xfem.cut_mesh(mesh, [xfem.Plane([0.6, 0.0], [1.0, 0.0])])
    >>> x = mesh.points[:, 0]
    >>> held = xfem.Supports.none(phantom).prescribe(phantom, x == 0.0)
    >>> held = held.prescribe(phantom, x == 1.0, [0.1, 0.0])
    >>> solution = xfem.solve_static(phantom, xfem.isotropic(1e4, 0.3, "plane strain"), held)
    >>> bool(solution.strain_energy < 1e-20), round(float(solution.displacement.max()), 12)
    (True, 0.1)
    """
    shape = phantom.node_points.shape
    force = finite_array(np.zeros(shape) if load is None else load, "load", shape)
    check_bodies(phantom, supports)
    check_choice(solver, Method, "solver")
    stiffness = InternalForce(phantom, material, "linear", kernels, ghost)
    clock = [perf_counter()]
    pattern = body_pattern(phantom, stiffness.couplings)
    inverse = StaticSolver(stiffness, pattern, supports.fixed, _ROUNDING, solver)
    clock.append(perf_counter())
    blocks = stiffness.stiffness(pattern)
    right = np.where(supports.fixed, 0.0, force - stiffness.evaluate(supports.values)[0])
    stiffest = float(np.abs(blocks).max())
    constrain(pattern, supports.fixed, blocks)
    clock.append(perf_counter())
    inverse.factorize(blocks)
    clock.append(perf_counter())
    displacement = inverse.solve(right) + supports.values
    clock.append(perf_counter())
    internal, energy = stiffness.evaluate(displacement)
    penalty = stiffness.penalty_energy(displacement)
    unbalanced = internal - force
    # in a rigid motion all forces are round-off of the products that they are sums of
    products = stiffest * np.abs(displacement).max()
    scale = max(np.abs(internal).max(), np.abs(force).max(), products, np.finfo(float).tiny)
    return StaticSolution(
        displacement=displacement,
        strain_energy=energy - penalty,
        reaction=np.where(supports.fixed, unbalanced, 0.0),
        residual=float(np.abs(unbalanced[~supports.fixed]).max(initial=0.0) / scale),
        timings=dict(zip(_PHASES, np.diff(clock).tolist(), strict=True)),
        penalty_energy=penalty,
        solver="direct" if "direct" in inverse.used else "iterative",
    )


class StaticSolver:
    """Iterations for a large body, a factorisation where they do not converge.

    Parameters
    ----------
    force : InternalForce
        Whose kernels are taken.
    pattern : BlockPattern
    fixed : (N, d) bool array
    tolerance : float
        Of the residual that iterations leave.
    method : {"auto", "direct", "iterative"}
        As for `solve_static`.

    Attributes
    ----------
    used : set of {"direct", "iterative"}
        What has solved systems so far.
    """

    def __init__(
        self,
        force: InternalForce,
        pattern: BlockPattern,
        fixed: Bools,
        tolerance: float,
        method: Method = "auto",
    ) -> None:
        kernels, block, phantom = force.kernels, fixed.shape[1], force.phantom
        self._make_direct = partial(kernels.direct, pattern, block, fixed.all(axis=1))
        is_large = phantom.mesh.dim == 3 and phantom.node_count >= ITERATE_FROM
        iterates = is_large and force.ghost is None if method == "auto" else method == "iterative"
        self._insists = method == "iterative"
        limit = 5 * _MOST if self._insists else _MOST
        self._iterative = kernels.iterative(pattern, block, tolerance, limit) if iterates else None
        self._first = self._iterative or self._direct
        self.used: set[str] = set()

    @cached_property
    def _direct(self) -> LinearSolver:
        return self._make_direct()

    def factorize(self, blocks: Floats) -> None:
        """Take the matrix with these nodal blocks; see `LinearSolver`."""
        self._blocks = blocks
        self._first.factorize(blocks)

    def solve(self, load: Floats) -> Floats:
        """Solve; by a factorisation where iterations that are optional do not converge."""
        if self._iterative is not None:
            try:
                found = self._iterative.solve(load)
                self.used.add("iterative")
                return found
            except NotConvergedError:
                if self._insists:
                    raise
            self._direct.factorize(self._blocks)
        self.used.add("direct")
        return self._direct.solve(load)
