"""The state in which a dynamic analysis begins."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from verify.scene.strict import Finite, Point3, Strict, Vector

__all__ = ["AtRest", "Equilibrium", "Initial", "Moving"]


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

    @model_validator(mode="after")
    def _moves(self) -> "Moving":
        if self.velocity is None and self.spin is None:
            raise ValueError("a moving body needs a velocity, a spin, or both")
        if self.centre is not None and self.spin is None:
            raise ValueError("centre belongs to a spin")
        return self

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


Initial = Annotated[AtRest | Equilibrium | Moving, Field(discriminator="kind")]
