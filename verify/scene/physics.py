"""Material, supports, loads and the analysis of a scene. SI units."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from verify.scene.strict import Finite, NonNegative, Positive, Strict, Vector

__all__ = [
    "Analysis",
    "BodyForce",
    "Exact",
    "Gravity",
    "Load",
    "Material",
    "Support",
    "Traction",
]

Values = Annotated[list[Finite], Field(min_length=1, max_length=3)]


class Material(Strict):
    """Homogeneous isotropic elasticity."""

    young: Positive = Field(description="Young's modulus E, Pa")
    poisson: float = Field(strict=True, gt=-1.0, lt=0.5, description="Poisson's ratio")
    density: Positive | None = Field(default=None, description="density, kg/m³")
    plane: Literal["strain", "stress"] | None = Field(
        default=None, description="2D only: plane strain or plane stress"
    )


class Support(Strict):
    """Prescribed displacement on a part of the boundary."""

    where: str = Field(description="name of a boundary part, 'boundary', or an inequality")
    displacement: Values | Literal["exact"] = Field(
        description="values in m, one per component held; or 'exact' (see [exact])"
    )
    components: list[Literal["x", "y", "z"]] | None = Field(
        default=None, description="which components are held; default all"
    )

    @model_validator(mode="after")
    def _lengths_agree(self) -> "Support":
        if self.components is not None:
            if len(set(self.components)) != len(self.components) or not self.components:
                raise ValueError(f"components {self.components} must name each component once")
            if self.displacement != "exact" and len(self.displacement) != len(self.components):
                raise ValueError(
                    f"displacement has {len(self.displacement)} values for components "
                    f"{self.components}; expected one per component"
                )
        return self

    def held(self, dimension: int) -> tuple[int, ...]:
        """Return the indices of the components held."""
        if self.components is None:
            return tuple(range(dimension))
        return tuple("xyz".index(name) for name in self.components)


class Gravity(Strict):
    """Acceleration acting on the density."""

    kind: Literal["gravity"]
    acceleration: Vector = Field(description="m/s²")


class BodyForce(Strict):
    """Force per volume, uniform, or that of the exact solution."""

    kind: Literal["body_force"]
    force: Vector | Literal["exact"] = Field(description="N/m³, or 'exact'")


class Traction(Strict):
    """Force per area on a part of the boundary (dead load)."""

    kind: Literal["traction"]
    where: str = Field(description="name of a boundary part, 'boundary', or an inequality")
    traction: Vector | Literal["exact"] = Field(description="Pa, or 'exact'")


Load = Annotated[Gravity | BodyForce | Traction, Field(discriminator="kind")]


class Exact(Strict):
    """An exact solution by name; it can prescribe supports and loads, and judge results."""

    solution: str = Field(description="name; `verify list --exact` shows them")
    parameters: dict[str, Finite | list[Finite] | list[list[Finite]]] = Field(
        default_factory=dict, description="parameters of that solution, SI units"
    )


class Analysis(Strict):
    """What is solved for."""

    kind: Literal["static", "dynamic"] = "static"
    kinematics: Literal["linear", "corotational"] = "linear"
    duration: Positive | None = Field(default=None, description="dynamic: end time, s")
    time_step: Positive | None = Field(default=None, description="dynamic: largest step, s")
    damping: tuple[NonNegative, NonNegative] = Field(
        default=(0.0, 0.0), description="Rayleigh: mass (1/s) and stiffness (s) factors"
    )

    @model_validator(mode="after")
    def _times_belong(self) -> "Analysis":
        if self.kind == "dynamic" and self.duration is None:
            raise ValueError("a dynamic analysis needs a duration")
        if self.kind == "static" and (self.duration or self.time_step):
            raise ValueError("duration and time_step belong to a dynamic analysis")
        return self
