"""The linear solver that an implicit step needs: factorise nodal blocks, solve."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.cholesky import SingularStiffnessError

__all__ = ["LinearSolver", "SparseLU"]

_Floats = NDArray[np.float64]


class LinearSolver(Protocol):
    """Solver whose analysis of the sparsity is kept between factorisations."""

    def factorize(self, blocks: _Floats) -> None:
        """Factorise the matrix with these nodal blocks (B, d, d)."""
        ...

    def solve(self, load: _Floats) -> _Floats:
        """Solution (N, d) for a right-hand side (N, d)."""
        ...


class SparseLU:
    """LU factorisation with pivoting, for matrices that are not symmetric.

    Parameters
    ----------
    pattern : BlockPattern
    """

    def __init__(self, pattern: BlockPattern) -> None:
        self._pattern = pattern
        self._factor: SuperLU | None = None

    def factorize(self, blocks: _Floats) -> None:
        """Factorise the matrix with these nodal blocks (B, d, d).

        Raises
        ------
        SingularStiffnessError
            If it is singular or not finite.
        """
        try:
            self._factor = splu(csc_array(self._pattern.matrix(blocks)))
        except RuntimeError as failure:
            raise SingularStiffnessError(None) from failure

    def solve(self, load: _Floats) -> _Floats:
        """Solution (N, d) for a right-hand side (N, d).

        Raises
        ------
        RuntimeError
            If nothing was factorised before.
        """
        if self._factor is None:
            raise RuntimeError("solve before factorize")
        return self._factor.solve(load.ravel()).reshape(load.shape)
