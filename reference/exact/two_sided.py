"""Fields that are smooth on either side of a straight or plane cut through the whole body."""

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array, ExactSolution, Plane
from verify.errors import InputError

Above = NDArray[np.bool_]


def line_axes(parameters: Parameters, of: str = "") -> Array:
    """Take the direction of a line: rows along (s) and normal (t), from `slope` or `angle`.

    With `of`, that of something else: the names of its parameters begin so.
    """
    slope, degrees = f"{of}slope", f"{of}angle"
    if parameters.has(slope) and parameters.has(degrees):
        raise InputError(f"parameters: {slope} and {degrees} are both given; expected one of them")
    if parameters.has(degrees):
        angle = np.deg2rad(float(parameters.take(degrees, ())))
    else:
        angle = np.arctan(float(parameters.take(slope, ())))
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def plane_axes(parameters: Parameters) -> Array:
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


class TwoSidedSolution(ExactSolution):
    """A field written in the axes of the cut: along it, and last t, normal to it.

    The side *above* is t > 0: in the plane, left of the direction of the cut. Every per-side
    parameter comes as above, then below.

    Parameters
    ----------
    law : Hooke
    parameters : Parameters
        ``point`` on the cut, where the axes begin. In the plane ``slope`` or ``angle`` (degrees),
        and the ``shift`` of each side along t. In space its ``normal``, the direction ``axis`` of
        the first axis (default: any), and the ``shift`` in local axes of each side.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        plane = law.dimension == 2
        self._origin = parameters.take("point", (law.dimension,))
        self._axes = line_axes(parameters) if plane else plane_axes(parameters)
        shape = (2,) if plane else (2, 3)
        shift = parameters.take("shift", shape, default=np.zeros(shape))
        self._shift = np.column_stack([np.zeros(2), shift]) if plane else shift

    @property
    def cut_plane(self) -> Plane | None:
        """The cut: a point on it and its normal."""
        return self._origin, self._axes[-1]

    @abstractmethod
    def _local_displacement(self, s: Array, above: Above) -> Array:
        """Displacement (n, d) in local axes at local points (n, d)."""

    @abstractmethod
    def _local_gradient(self, s: Array, above: Above) -> Array:
        """Give the gradient (n, d, d) in local axes."""

    def _local_body_force(self, s: Array, above: Above) -> Array:
        return np.zeros_like(s)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d), m; see `ExactSolution`."""
        s, above = self._local(points, near)
        return (self._local_displacement(s, above) + side(self._shift, above)) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d); see `ExactSolution`."""
        turned: Array = self._axes.T @ self._local_gradient(*self._local(points, near)) @ self._axes
        return turned

    def body_force(self, points: Array, near: Array | None = None) -> Array:
        """Body force (n, d), N/m³; see `ExactSolution`."""
        return self._local_body_force(*self._local(points, near)) @ self._axes

    def _local(self, points: Array, near: Array | None) -> tuple[Array, Above]:
        s = (np.asarray(points, dtype=float) - self._origin) @ self._axes.T
        decides = s[:, -1] if near is None else (np.asarray(near) - self._origin) @ self._axes[-1]
        return s, decides >= 0.0


def side(pair: Array, above: Above) -> Array:
    """Values (n, …) of a per-side parameter (2, …) at points on those sides."""
    return np.asarray(pair[np.where(above, 0, 1)])


def matrices(rows: list[list[Array]]) -> Array:
    """Matrices (n, d, d) from rows of entries (n,)."""
    return np.moveaxis(np.array(rows), 2, 0)
