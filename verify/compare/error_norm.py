"""The norm of an error with the norm that it is divided by."""

from dataclasses import dataclass
from math import inf

__all__ = ["ErrorNorm"]


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
