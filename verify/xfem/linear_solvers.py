"""Linear solvers of nodal blocks, and the operations of this package that faster ones may replace.

The solvers are SciPy's: sparse LU factorisation, conjugate gradients. `Kernels` is the seam to
`verify.accelerated`: every implementation of an operation gives the same result to round-off.
`PLAIN` uses NumPy, SciPy and plain loops alone; the caller who builds a body may pass another set.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, diags_array, sparray
from scipy.sparse.linalg import LinearOperator, cg, splu

from verify.xfem.arrays import (
    Bools,
    Floats,
    NotConvergedError,
    SingularStiffnessError,
    XfemError,
    check_floats,
)
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.element import Elements

_ROUND_OFF = 1e-14  # of the diagonal entry from which a pivot comes
_SMALL = 1500  # nodes of a solid, up to which a factorisation is quicker than iterations
_IN_ITS_ORDER: dict[str, Any] = {  # of SuperLU: pivots on the diagonal, rows as columns
    "permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}
}  # fmt: skip


class LinearSolver(Protocol):
    """Solver of K x = b in nodal blocks, whose analysis of the sparsity is kept.

    Attributes
    ----------
    reads_half : bool
        Whether blocks below the diagonal of the next matrix are not read.
    tolerance : float
        Of the residual that iterations leave, relative to the right-hand side; direct solvers read
        none.
    is_iterative : bool
        Whether the last solution was by iterations.
    """

    reads_half: bool = False
    tolerance: float = 0.0
    is_iterative: bool = False

    def learn(self, former: "LinearSolver") -> None:
        """Take over measured costs from a solver of nearly the same matrices."""
        return

    def factorize(self, blocks: Floats) -> None:
        """Take the matrix with these nodal blocks (B, d, d), kept by reference.

        Raises
        ------
        SingularStiffnessError
            If it is seen not to be positive definite (of general matrices: not to be regular).
        XfemError
            If the blocks do not fit the pattern.
        """
        ...

    def solve(self, load: Floats, x: Floats | None = None) -> Floats:
        """Solve for a right-hand side (N, d).

        Parameters
        ----------
        load : (N, d) float array
        x : (N, d) float array, optional
            First guess of iterations, overwritten with the solution; zero without it.

        Raises
        ------
        SingularStiffnessError
            If the matrix turns out not to be positive definite.
        NotConvergedError
            If iterations run out.
        XfemError
            If a shape is wrong or a number is not finite.
        RuntimeError
            If nothing was factorised before.
        """
        ...


class SparseLU(LinearSolver):
    """LU factorisation by SuperLU, as `scaled_inverse`.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.
    definite : bool
        Whether the matrix must be symmetric and positive definite: pivots are then on the
        diagonal. Otherwise rows are exchanged, and any regular matrix will do.
    """

    def __init__(self, pattern: BlockPattern, block: int, definite: bool = False) -> None:
        self._pattern, self._block, self._definite = pattern, block, definite
        self._inverse: Callable[[Floats], Floats] | None = None

    def factorize(self, blocks: Floats) -> None:
        """Factorise; see `LinearSolver`."""
        check_floats("blocks", blocks, (len(self._pattern.columns), self._block, self._block))
        self._inverse = scaled_inverse(self._pattern.matrix(blocks), self._definite, self._block)

    def solve(self, load: Floats, x: Floats | None = None) -> Floats:
        """Solve; see `LinearSolver`."""
        if self._inverse is None:
            raise RuntimeError("solve before factorize")
        load = nodal_vector(load, "right-hand side", self._pattern.node_count, self._block)
        x = np.empty(load.shape) if x is None else x
        x[:] = self._inverse(load.ravel()).reshape(load.shape)
        return x


def scaled_inverse(
    matrix: sparray, definite: bool = True, block: int = 1
) -> Callable[[Floats], Floats]:
    """Factorise a matrix (n, n); the result multiplies (n,) or (n, k) by its inverse.

    Rows and columns are scaled by the diagonal before: the entries of a sliver are many orders
    smaller than others, and a pivot among numbers of both sizes would lose them.

    Parameters
    ----------
    matrix : (n, n) sparse array
    definite : bool
        Whether it must be symmetric and positive definite, as of `SparseLU`.
    block : int
        Unknowns of a node, for the message.

    Raises
    ------
    SingularStiffnessError
        If the matrix is singular, or to be positive definite and is not, to round-off.
    """
    diagonal = matrix.diagonal()
    if definite and not (diagonal > 0.0).all():
        raise SingularStiffnessError(int(np.argmin(diagonal > 0.0)) // block)
    size = np.abs(diagonal)
    scale = 1.0 / np.sqrt(np.where(size > 0.0, size, 1.0))
    scaled = csc_array(diags_array(scale) @ matrix @ diags_array(scale))
    try:
        factor = splu(scaled, **(_IN_ITS_ORDER if definite else {}))
    except RuntimeError as failure:
        raise SingularStiffnessError(None) from failure
    if definite:
        small = ~(factor.U.diagonal() > _ROUND_OFF) | (factor.perm_r != factor.perm_c)
        if small.any():
            place = int(np.argmax(small))
            raise SingularStiffnessError(int(np.argmax(factor.perm_c == place)) // block)
    return lambda load: (scale * factor.solve((scale * load.T).T).T).T


class BlockJacobiCG(LinearSolver):
    """Conjugate gradients, preconditioned by the nodal blocks on the diagonal.

    Scaling by nodal blocks bounds the condition number of the phantom-node basis whatever the size
    of the slivers.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.
    tolerance : float
        Of the residual relative to the right-hand side, 2-norm.
    limit : int
        Most iterations.
    """

    is_iterative = True

    def __init__(
        self, pattern: BlockPattern, block: int, tolerance: float = 1e-10, limit: int = 10_000
    ) -> None:
        if not 0.0 < tolerance < 1.0 or limit < 1:
            raise XfemError(f"tolerance {tolerance:g}, limit {limit}; expected in (0, 1) and ≥ 1")
        self._pattern, self._block, self.tolerance, self._limit = pattern, block, tolerance, limit
        self._blocks: Floats | None = None

    def factorize(self, blocks: Floats) -> None:
        """Take the matrix and invert its diagonal blocks; see `LinearSolver`."""
        check_floats("blocks", blocks, (len(self._pattern.columns), self._block, self._block))
        own = blocks[self._pattern.diagonal]
        scale = 1.0 / np.sqrt(np.abs(np.einsum("nii->ni", own)).max(axis=1, initial=1e-300))
        positive = np.linalg.eigvalsh(own * scale[:, None, None] ** 2)[:, 0] > _ROUND_OFF
        if not positive.all():
            raise SingularStiffnessError(int(np.argmin(positive)))
        self._blocks, self._inverse = blocks, np.linalg.inv(own)

    def solve(self, load: Floats, x: Floats | None = None) -> Floats:
        """Solve; see `LinearSolver`."""
        if self._blocks is None:
            raise RuntimeError("solve before factorize")
        nodes, size = self._pattern.node_count, self._pattern.node_count * self._block
        load = nodal_vector(load, "right-hand side", nodes, self._block)
        x = np.zeros(load.shape) if x is None else x
        start = nodal_vector(x, "first guess", nodes, self._block)
        matrix = self._pattern.matrix(self._blocks)

        def product(vector: Floats) -> Floats:
            image = matrix @ vector
            if vector.any() and not vector @ image > 0.0:
                raise SingularStiffnessError(None)
            return image

        def precondition(residual: Floats) -> Floats:
            return np.einsum("nij,nj->ni", self._inverse, residual.reshape(load.shape)).ravel()

        found, failed = cg(
            LinearOperator((size, size), product), load.ravel(), start.ravel(),
            rtol=self.tolerance, maxiter=self._limit,
            M=LinearOperator((size, size), precondition),
        )  # fmt: skip
        if failed:
            residual = np.linalg.norm(load.ravel() - matrix @ found) / np.linalg.norm(load)
            raise NotConvergedError(
                f"conjugate gradients: residual {residual:.3g} after {self._limit} iterations; "
                f"expected {self.tolerance:g}"
            )
        x[:] = found.reshape(load.shape)
        return x


def nodal_vector(values: ArrayLike, name: str, nodes: int, size: int) -> Floats:
    """Copy a right-hand side or first guess to a contiguous float array (N, d).

    Raises
    ------
    XfemError
        If its shape is another, or a number is not finite.
    """
    found = np.ascontiguousarray(values, dtype=float)
    if found.shape != (nodes, size):
        raise XfemError(f"{name} of shape {found.shape}; expected {(nodes, size)}")
    # one pass that allocates nothing tells, but of numbers whose squares overflow
    if not np.vdot(found, found) < np.inf and not np.isfinite(found).all():
        first = int(np.argmin(np.isfinite(found).all(axis=1)))
        raise XfemError(f"the {name} is not finite, first at dof node {first}")
    return found


class OnePass(Protocol):
    """Force and stiffness of corotational tetrahedra in one pass over the elements.

    `InternalForce.linearise` of `verify.xfem.internal_force` says what the arguments are; where
    corners follow others, nodes and blocks belong to the corners.
    """

    pattern: BlockPattern

    def __call__(
        self,
        displacement: Floats,
        velocity: Floats,
        implicit: float,
        scale: float,
        force: Floats,
        blocks: Floats,
        whole: bool = True,
        rotational: float = 0.0,
    ) -> object:
        """Overwrite force (N, 3) and blocks (B, 3, 3)."""
        ...

    def average(
        self,
        start: Floats,
        end: Floats,
        scale: float,
        rotational: float,
        substituted: Bools,
        force: Floats,
        blocks: Floats,
        whole: bool = True,
    ) -> object:
        """Overwrite the force averaged over a step, and the stiffness at its end.

        The stiffness is `scale` K_R + `rotational` (K_C − K_R), as of `InternalForce.linearise`.
        `start` and `end` (N, 3) are displacements, `substituted` (p,) cells that have taken the
        substitute for the averaged stress, which is updated.
        """
        ...


@dataclass(frozen=True)
class Kernels:
    """One implementation of each operation.

    Attributes
    ----------
    direct : callable
        (pattern, block, held) → factorisation of a symmetric positive definite matrix. `held`
        (N,) are nodes of which every component is fixed, or None.
    iterative : callable
        (pattern, block, tolerance, limit) → iterations with such a matrix.
    step : callable
        (pattern, block, held, solid, tolerance) → whichever of the two is quicker for steps in
        time and large statics; `solid` says whether the body fills space, where factors are large.
    large : callable, optional
        (pattern, points, fixed, tolerance, limit) → iterations with such a matrix of blocks of
        three, whose number does not grow with the body: for the statics of large solids, with
        nodes `points` (N, 3) and components (N, 3) that are `fixed`. Without it `step` is taken.
    general : callable
        (pattern, block) → solver for any regular matrix, nearly symmetric as a rule.
    one_pass : callable, optional
        (elements, pattern, corotational) → `OnePass`; without it force and stiffness are found one
        after the other.
    """

    direct: Callable[[BlockPattern, int, Bools | None], LinearSolver]
    iterative: Callable[[BlockPattern, int, float, int], LinearSolver]
    step: Callable[[BlockPattern, int, Bools, bool, float], LinearSolver]
    general: Callable[[BlockPattern, int], LinearSolver]
    one_pass: Callable[[Elements, BlockPattern, bool], OnePass] | None = None
    large: Callable[[BlockPattern, Floats, Bools, float, int], LinearSolver] | None = None


def _direct(pattern: BlockPattern, block: int, held: Bools | None) -> LinearSolver:
    return SparseLU(pattern, block, definite=True)


def _step(
    pattern: BlockPattern, block: int, held: Bools, solid: bool, tolerance: float
) -> LinearSolver:
    if solid and pattern.node_count > _SMALL:
        return BlockJacobiCG(pattern, block, tolerance)
    return _direct(pattern, block, held)


PLAIN = Kernels(_direct, BlockJacobiCG, _step, SparseLU)
