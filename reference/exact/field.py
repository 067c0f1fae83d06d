"""Base of exact solutions: a field known at every point, a law, parameters."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import Material
from verify.scene.strict import nearest


@dataclass(frozen=True)
class Hooke:
    """Hooke's law, in the plane or in space.

    In plane stress `lame` is that of the plane law, 2λμ/(λ+2μ), so that one set of formulas
    serves both states.

    Parameters
    ----------
    lame : float
        First Lamé constant λ, Pa.
    shear : float
        Shear modulus μ, Pa.
    dimension : {2, 3}
    density : float, optional
        kg/m³; what moves needs it.
    """

    lame: float
    shear: float
    dimension: int
    density: float | None = None

    @property
    def eta(self) -> float:
        """η = λ/(λ+2μ): lateral contraction that keeps a plane free of normal stress."""
        return self.lame / (self.lame + 2 * self.shear)

    @property
    def plane_modulus(self) -> float:
        """E' = 4μ(λ+μ)/(λ+2μ): E/(1−ν²) in plane strain, E in plane stress, Pa."""
        lame, shear = self.lame, self.shear
        return 4 * shear * (lame + shear) / (lame + 2 * shear)

    @property
    def kolosov(self) -> float:
        """κ = (λ+3μ)/(λ+μ): 3−4ν in plane strain, (3−ν)/(1+ν) in plane stress."""
        return (self.lame + 3 * self.shear) / (self.lame + self.shear)

    def stress(self, gradient: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stress (…, d, d) in Pa of displacement gradients (…, d, d)."""
        strain = 0.5 * (gradient + gradient.swapaxes(-1, -2))
        trace = np.trace(strain, axis1=-2, axis2=-1)
        stress: NDArray[np.float64] = 2 * self.shear * strain
        stress += self.lame * trace[..., None, None] * np.eye(self.dimension)
        return stress


def hooke(material: Material) -> Hooke:
    """Hooke's law of a scene's material; in space where it names no plane state."""
    young, poisson = material.young, material.poisson
    shear = young / (2 * (1 + poisson))
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    if material.plane == "stress":
        lame = young * poisson / (1 - poisson**2)
    return Hooke(lame, shear, 3 if material.plane is None else 2, material.density)


_SHAPES = {
    (): "a number",
    (2,): "two numbers",
    (3,): "three numbers",
    (2, 2): "two rows of two numbers",
    (2, 3): "two rows of three numbers",
    (3, 3): "three rows of three numbers",
    (3, 4): "three rows of four numbers",
}


class Parameters:
    """What the case file says, until it has all been taken.

    Parameters
    ----------
    solution : str
        Name of the exact solution, for messages.
    given : mapping
        The parameters.
    """

    def __init__(self, solution: str, given: Mapping[str, Any]) -> None:
        self._solution = solution
        self._given = dict(given)
        self._known: list[str] = []
        self._missing: list[str] = []

    def has(self, name: str) -> bool:
        """Whether `name` is given."""
        self._known.append(name)
        return name in self._given

    def take(self, name: str, *shapes: tuple[int, ...], default: Any = None) -> NDArray[np.float64]:
        """Take the parameter `name`, which must have one of `shapes`.

        Raises
        ------
        InputError
            If it is not finite numbers of that shape. What is missing without a `default` is
            said by `close`.
        """
        self._known.append(name)
        if name not in self._given:
            if default is None:
                self._missing.append(f"parameters.{name} is missing; expected {_words(shapes)}")
                return np.full(shapes[0], 1.0)  # `close` refuses it
            return np.asarray(default, dtype=float)
        try:
            value = np.asarray(self._given[name], dtype=float)
        except (TypeError, ValueError):
            value = np.array([np.nan] * 99)
        if value.shape not in shapes or not np.isfinite(value).all():
            raise InputError(
                f"parameters.{name} = {self._given[name]}; '{self._solution}' expects "
                f"{_words(shapes)}"
            )
        return value

    def positive(self, name: str) -> float:
        """Take the positive number `name`."""
        value = float(self.take(name, ()))
        if value <= 0.0:
            raise InputError(f"parameters.{name} = {value:g}; expected a positive number")
        return value

    def close(self) -> None:
        """Say that all has been taken.

        Raises
        ------
        InputError
            If something is left that the solution does not know, or something was missing.
        """
        # first what is left: a misspelt name explains the one that is missing
        for name in self._given:
            if name not in self._known:
                hint = nearest(name, self._known)
                raise InputError(f"'{self._solution}' has no parameter '{name}'{hint}")
        if self._missing:
            raise InputError(self._missing[0])


def _words(shapes: tuple[tuple[int, ...], ...]) -> str:
    return " or ".join(_SHAPES[shape] for shape in shapes)


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
    time: float = 0.0  # s, of a field that moves

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
        if not self.moves:
            return self
        other = copy(self)
        other.time = float(time)
        return other

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

    def smooth(self, points: Array, reach: Array | float) -> NDArray[np.bool_]:
        """Whether (n,) stress is smooth within a distance of points, m: no front of a wave is."""
        return np.ones(len(points), dtype=bool)

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Parameters in (0, 1) at which the field jumps on the segment from `start` to `end`.

        In the plane; not across `cut_plane`.
        """
        return []
