"""A displacement field known at every point, with what it takes to integrate it exactly."""

from abc import ABC, abstractmethod
from typing import Self

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke

Array = NDArray[np.float64]
Plane = tuple[Array, Array]


class ExactField(ABC):
    """A displacement field that solves the equations of linear elasticity exactly.

    Points are (n, d) arrays in metres. `near` (n, d) are points on the wanted side of the cut,
    close to `points`: a point on the cut, or off it by round-off, belongs to the side on which
    its `near` lies. Without `near` a point on the cut belongs to the positive (left) side.

    A field that moves says so (`moves`), gives itself at another time (`at`) and has velocities;
    as it is made it is the field at the time 0. It solves the equations of motion: its
    `body_force` balances stress and inertia.

    Parameters
    ----------
    law : Hooke
    """

    has_body_force: bool = False
    moves: bool = False

    def __init__(self, law: Hooke) -> None:
        self.law = law

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return self.law.dimension

    @property
    def singular_points(self) -> Array:
        """Points (k, d) near which derivatives are unbounded."""
        return np.zeros((0, self.dimension))

    @property
    def cut_plane(self) -> Plane | None:
        """Point and normal of the line or plane through the body across which the field jumps.

        None if there is none. It is smooth on either side, and the field of a side beyond it.
        """
        return None

    def at(self, time: float) -> Self:
        """Return the field at a time, s: itself, if it stands still."""
        return self

    @abstractmethod
    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d), m."""

    @abstractmethod
    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d): entry i, j is ∂u_i/∂x_j."""

    def velocity(self, points: Array, near: Array | None = None) -> Array:
        """Velocity (n, d), m/s: zero, if it stands still."""
        return np.zeros_like(points, dtype=float)

    def body_force(self, points: Array, near: Array | None = None) -> Array:
        """Force per volume (n, d), N/m³, that keeps the field in equilibrium."""
        return np.zeros_like(points, dtype=float)

    def stress(self, points: Array, near: Array | None = None) -> Array:
        """Stress (n, d, d), Pa."""
        return self.law.stress(self.gradient(points, near))

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Parameters in (0, 1) at which the field jumps on the segment from `start` to `end`.

        In the plane; not across `cut_plane`.
        """
        return []
