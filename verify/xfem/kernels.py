"""Operations of the solver that faster ones may replace: the seam to `verify.accelerated`.

Every implementation of an operation gives the same result to round-off. `PLAIN` is what this
package does alone, with NumPy, SciPy and plain loops; whoever builds a body may pass another set.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.element import Elements
from verify.xfem.linear_solvers import BlockJacobiCG, LinearSolver, SparseLU

_Floats = NDArray[np.float64]
_Bools = NDArray[np.bool_]

_SMALL = 1500  # nodes of a solid, up to which a factorisation is quicker than iterations


class OnePass(Protocol):
    """Force and stiffness of corotational tetrahedra in one pass over the elements.

    `InternalForce.linearise` and `linearise_average` of `verify.xfem.internal_force` ask for it.
    """

    pattern: BlockPattern

    def __call__(
        self,
        displacement: _Floats,
        velocity: _Floats,
        implicit: float,
        scale: float,
        force: _Floats,
        blocks: _Floats,
        whole: bool = True,
        rotational: float = 0.0,
    ) -> int:
        """Overwrite force (N, 3) and blocks (B, 3, 3); return the cells without rotational part."""
        ...

    def average(
        self,
        start: _Floats,
        end: _Floats,
        scale: float,
        rotational: float,
        substituted: _Bools,
        force: _Floats,
        blocks: _Floats,
        whole: bool = True,
    ) -> int:
        """Overwrite the force averaged over a step, and the stiffness at its end."""
        ...

    def write_rotations(self, rotations: _Floats) -> None:
        """Write the rotations (p, 3, 3) of the last pass."""
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
        (pattern, block, held, solid, tolerance) → whichever of the two is quicker for a step in
        time; `solid` says whether the body fills space, where factors are large.
    general : callable
        (pattern, block) → solver for any regular matrix, nearly symmetric as a rule.
    one_pass : callable, optional
        (elements, pattern, corotational) → `OnePass`; without it force and stiffness are found one
        after the other.
    """

    direct: Callable[[BlockPattern, int, _Bools | None], LinearSolver]
    iterative: Callable[[BlockPattern, int, float, int], LinearSolver]
    step: Callable[[BlockPattern, int, _Bools, bool, float], LinearSolver]
    general: Callable[[BlockPattern, int], LinearSolver]
    one_pass: Callable[[Elements, BlockPattern, bool], OnePass] | None = None


def _direct(pattern: BlockPattern, block: int, held: _Bools | None) -> LinearSolver:
    return SparseLU(pattern, block, definite=True)


def _step(
    pattern: BlockPattern, block: int, held: _Bools, solid: bool, tolerance: float
) -> LinearSolver:
    if solid and pattern.node_count > _SMALL:
        return BlockJacobiCG(pattern, block, tolerance)
    return _direct(pattern, block, held)


PLAIN = Kernels(_direct, BlockJacobiCG, _step, SparseLU)
