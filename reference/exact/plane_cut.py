"""Fields in space that are smooth on either side of a plane cut through the whole body."""

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array, ExactSolution, Plane
from verify.errors import InputError

Above = NDArray[np.bool_]


def axes_of(parameters: Parameters) -> Array:
    """Take `normal` and `axis` (default: any): rows s1, s2 along and t normal to a plane."""
    normal = parameters.take("normal", (3,))
    size = float(np.linalg.norm(normal))
    if size == 0.0:
        raise InputError("parameters.normal is zero; expected a direction")
    normal = normal / size
    guide = np.eye(3)[np.argmin(np.abs(normal))]
    first = parameters.take("axis", (3,), default=guide)
    first = first - (first @ normal) * normal
    if float(np.linalg.norm(first)) <= 1e-9:
        raise InputError("parameters.axis is zero or parallel to the normal")
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first), normal])


class PlaneCutSolution(ExactSolution):
    """A field written in the axes of the cut: s1 and s2 along it, t normal to it.

    The side *above* is t > 0. Every per-side parameter comes as above, then below.

    Parameters
    ----------
    law : Hooke
    parameters : Parameters
        ``point`` on the cut, where s1 = s2 = t = 0, its ``normal``, the direction ``axis`` of s1
        (default: any), and the ``shift`` in local axes of each side (default: none).
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._origin = parameters.take("point", (3,))
        self._axes = axes_of(parameters)
        self._shift = parameters.take("shift", (2, 3), default=np.zeros((2, 3)))

    @property
    def cut_plane(self) -> Plane | None:
        """The cut: a point on it and its normal."""
        return self._origin, self._axes[2]

    @abstractmethod
    def _local_displacement(self, s: Array, above: Above) -> Array:
        """Displacement (n, 3) in local axes at local points (n, 3)."""

    @abstractmethod
    def _local_gradient(self, s: Array, above: Above) -> Array:
        """Give the gradient (n, 3, 3) in local axes."""

    def _local_body_force(self, s: Array, above: Above) -> Array:
        return np.zeros_like(s)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, 3), m; see `ExactSolution`."""
        s, above = self._local(points, near)
        shift = np.where(above[:, None], self._shift[0], self._shift[1])
        return (self._local_displacement(s, above) + shift) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, 3, 3); see `ExactSolution`."""
        turned: Array = self._axes.T @ self._local_gradient(*self._local(points, near)) @ self._axes
        return turned

    def body_force(self, points: Array, near: Array | None = None) -> Array:
        """Body force (n, 3), N/m³; see `ExactSolution`."""
        return self._local_body_force(*self._local(points, near)) @ self._axes

    def _local(self, points: Array, near: Array | None) -> tuple[Array, Above]:
        s = (np.asarray(points, dtype=float) - self._origin) @ self._axes.T
        decides = s[:, 2] if near is None else (np.asarray(near) - self._origin) @ self._axes[2]
        return s, decides >= 0.0
