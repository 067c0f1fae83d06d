"""The state in which a dynamic analysis begins."""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from verify.errors import InputError
from verify.scene.physics import field_values
from verify.scene.strict import Components, Finite, Point3, Rules, Strict, Vector

_LARGEST = 30.0  # of a velocity like r^-½: a tip less than 1/1000 of a cell away


class AtRest(Strict):
    """Undeformed and at rest."""

    kind: Literal["rest"]


class Equilibrium(Strict):
    """Static equilibrium, at rest. Supports and loads have the first factor of their history."""

    kind: Literal["equilibrium"]
    cuts: Literal["closed", "open"] = Field(
        default="closed",
        description="whether the cuts that open at the time 0 are open in it; closed: it is the "
        "equilibrium of the uncut body",
    )


class Moving(Strict):
    """Undeformed, and moving as a rigid body."""

    kind: Literal["moving"]
    velocity: Vector | None = Field(default=None, description="translation, m/s; default none")
    spin: Finite | Point3 | None = Field(
        default=None, description="angular velocity, rad/s: a number in 2D, a vector in 3D"
    )
    centre: Vector | None = Field(
        default=None, description="point about which it spins, m; default the origin"
    )

    rules: ClassVar[Rules] = (
        ("", lambda m: m.velocity is None and m.spin is None,
         "a moving body needs a velocity, a spin, or both"),
        ("", lambda m: m.centre is not None and m.spin is None, "centre belongs to a spin"),
    )  # fmt: skip

    def velocities(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Velocity (n, d) of points (n, d), m/s."""
        n, d = points.shape
        velocity = np.tile(np.asarray(self.velocity or (0.0,) * d, dtype=float), (n, 1))
        if self.spin is None:
            return velocity
        arm = points - np.asarray(self.centre or (0.0,) * d)
        if d == 2:
            return velocity + self.spin * np.column_stack([-arm[:, 1], arm[:, 0]])
        return velocity + np.cross(np.asarray(self.spin, dtype=float), arm)


class InitialField(Strict):
    """Displacement and velocity by formulas, or those of the exact solution at the time 0."""

    kind: Literal["field"]
    displacement: Components | Literal["exact"] | None = Field(
        default=None, description="m, a number or a formula in x, y, z per component; or 'exact'"
    )
    velocity: Components | Literal["exact"] | None = Field(
        default=None, description="m/s, a number or a formula in x, y, z per component; or 'exact'"
    )

    rules: ClassVar[Rules] = (
        ("", lambda f: f.displacement is None and f.velocity is None,
         "an initial field needs a displacement, a velocity, or both"),
    )  # fmt: skip

    def state(
        self, points: NDArray[np.float64], near: NDArray[np.float64], exact: Any
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Displacement and velocity (n, d) of points (n, d), m and m/s.

        Parameters
        ----------
        points : (n, d) array
        near : (n, d) array
            Points of the material that they move: on which side of a cut they are.
        exact : ExactSolution or None

        Raises
        ------
        InputError
            If a point lies at the tip of a crack, where the exact velocity is unbounded.
        """
        at_start = None if exact is None else exact.at(0.0)
        fields = []
        for given, name in ((self.displacement, "displacement"), (self.velocity, "velocity")):
            if given == "exact":
                values = getattr(at_start, name)
                fields.append(_bounded(values(points, near), values(near, near), points, name))
            else:
                fields.append(field_values(given or [0.0] * points.shape[1], points))
        return fields[0], fields[1]


def _bounded(
    values: NDArray[np.float64], beside: NDArray[np.float64], points: NDArray[np.float64], name: str
) -> NDArray[np.float64]:
    """Refuse values (n, d) that stand out from all of those beside the points."""
    size = np.linalg.norm(values, axis=1)
    most = _LARGEST * float(np.linalg.norm(beside, axis=1).max(initial=0.0))
    wrong = np.flatnonzero(~(size <= most) & (most > 0.0))
    if len(wrong):
        at = ", ".join(f"{x:.6g}" for x in points[wrong[0]])
        raise InputError(
            f"initial.{name}: the exact field is unbounded at the node ({at}); expected no node at "
            "the tip at the time 0: another mesh, or another place of the tip"
        )
    return np.asarray(values)


Initial = Annotated[AtRest | Equilibrium | InitialField | Moving, Field(discriminator="kind")]


def starts_open(initial: Initial) -> bool:
    """Whether the cuts that open at the time 0 or before are open in the initial state.

    A field has a value on each side of them; what else moves or stands still is the uncut body.
    """
    if isinstance(initial, Equilibrium):
        return initial.cuts == "open"
    return isinstance(initial, InitialField)
