"""Fields that are smooth on either side of a straight cut through the whole body."""

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array, ExactSolution
from verify.errors import InputError


def axes(parameters: Parameters, of: str = "") -> Array:
    """Take the direction of the cut: rows along (s) and normal (t), from `slope` or `angle`.

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


class StraightCutSolution(ExactSolution):
    """A field written in the axes of the cut: s along it, t normal to it.

    The side *above* is t > 0: left of the direction of the cut. Every per-side parameter is a
    pair (above, below).

    Parameters
    ----------
    law : Hooke
    parameters : Parameters
        ``point`` on the cut, where s = t = 0, and ``slope`` or ``angle`` (degrees).
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._origin = parameters.take("point", (2,))
        self._axes = axes(parameters)
        self._shift = parameters.take("shift", (2,), default=(0.0, 0.0))

    @abstractmethod
    def _local_displacement(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        """Components u_s and u_t, each (n,)."""

    @abstractmethod
    def _local_gradient(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array, Array, Array]:
        """Give the derivatives ∂s u_s, ∂t u_s, ∂s u_t, ∂t u_t, each (n,)."""

    def _local_body_force(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        return np.zeros_like(s), np.zeros_like(s)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, 2), m; see `ExactSolution`."""
        s, t, above = self._local(points, near)
        u_s, u_t = self._local_displacement(s, t, above)
        return np.column_stack([u_s, u_t + side(self._shift, above)]) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, 2, 2); see `ExactSolution`."""
        s, t, above = self._local(points, near)
        local = np.stack(np.broadcast_arrays(*self._local_gradient(s, t, above)), axis=1)
        turned: Array = self._axes.T @ local.reshape(-1, 2, 2) @ self._axes
        return turned

    def body_force(self, points: Array, near: Array | None = None) -> Array:
        """Body force (n, 2), N/m³; see `ExactSolution`."""
        return np.column_stack(self._local_body_force(*self._local(points, near))) @ self._axes

    def smooth_parts(self, outline: Array) -> list[tuple[Array, Array | None]]:
        """Give the parts of a polygon above and below the cut."""
        height = (outline - self._origin) @ self._axes[1]
        parts: list[tuple[Array, Array | None]] = []
        for sign in (1.0, -1.0):
            corners = _clip(outline, sign * height)
            if len(corners) > 2:
                size = float(np.ptp(outline, axis=0).max()) + float(np.abs(height).max())
                parts.append((corners, sign * size * self._axes[1]))
        return parts

    def _local(self, points: Array, near: Array | None) -> tuple[Array, Array, NDArray[np.bool_]]:
        s, t = ((np.asarray(points, dtype=float) - self._origin) @ self._axes.T).T
        decides = t if near is None else (np.asarray(near) - self._origin) @ self._axes[1]
        return s, t, decides >= 0.0


def side(pair: Array, above: NDArray[np.bool_]) -> Array:
    """Value (n,) of a per-side parameter (above, below) at points on those sides."""
    return np.where(above, pair[0], pair[1])


def _clip(corners: Array, height: Array) -> Array:
    """Corners of the part with height ≥ 0; parts of a non-convex polygon stay connected."""
    kept = []
    for i in range(len(corners)):
        j = (i + 1) % len(corners)
        if height[i] >= 0:
            kept.append(corners[i])
        if (height[i] > 0 > height[j]) or (height[i] < 0 < height[j]):
            share = height[i] / (height[i] - height[j])
            kept.append(corners[i] + share * (corners[j] - corners[i]))
    return np.array(kept).reshape(-1, 2)
