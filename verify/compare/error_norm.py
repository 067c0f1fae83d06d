"""The norm of an error with the norm that it is divided by."""

from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ErrorNorm:
    """An error norm, and the same norm of the reference.

    Parameters
    ----------
    absolute : float
        Norm of the difference.
    scale : float
        Norm of the reference.
    """

    absolute: float
    scale: float

    @property
    def relative(self) -> float:
        """Relative error; infinite where something differs from a reference that is zero."""
        if self.absolute == 0.0:
            return 0.0
        return self.absolute / self.scale if self.scale > 0.0 else inf


@dataclass(frozen=True)
class Squares:
    """Integrands of the squares of both norms at the points of a rule.

    What is near a tip and what is far from it are the same integrands with other weights.

    Parameters
    ----------
    difference, expected : (n,) arrays
        Of the difference and of the reference.
    """

    difference: Array
    expected: Array

    def norm(self, weights: Array, whole: Array | None = None) -> ErrorNorm:
        """Norms with the weights (n,) of the points; with those of the `whole`, of the scale."""
        of_scale = weights if whole is None else whole
        return ErrorNorm(
            float(np.sqrt(weights @ self.difference)), float(np.sqrt(of_scale @ self.expected))
        )
