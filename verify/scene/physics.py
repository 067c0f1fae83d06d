"""Material, supports, loads and the analysis of a scene. SI units."""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from verify.scene.strict import Count, Finite, NonNegative, Positive, Strict, Vector

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

_OUTPUTS = 11

Values = Annotated[list[Finite], Field(min_length=1, max_length=3)]


def _ordered(history: list[tuple[float, float]]) -> list[tuple[float, float]]:
    times = [time for time, _ in history]
    if times != sorted(times) or any(a == b for a, b in zip(times, times[2:], strict=False)):
        raise ValueError("times must ascend; two equal ones are a jump, three are too many")
    return history


History = Annotated[
    list[tuple[NonNegative, Finite]],
    Field(
        min_length=1,
        description="dynamic: [[time in s, factor], …]; the value times the factor, linear between "
        "the times and constant before and after them; two equal times make a jump",
    ),
    AfterValidator(_ordered),
]


class Material(Strict):
    """Homogeneous isotropic elasticity."""

    young: Positive = Field(description="Young's modulus E, Pa")
    poisson: float = Field(strict=True, gt=-1.0, lt=0.5, description="Poisson's ratio")
    density: Positive | None = Field(default=None, description="density, kg/m³")
    plane: Literal["strain", "stress"] | None = Field(
        default=None, description="2D only: plane strain or plane stress"
    )
    thickness: Positive | None = Field(default=None, description="membranes only: thickness, m")


class Support(Strict):
    """Prescribed displacement on a part of the boundary."""

    where: str = Field(description="name of a boundary part, 'boundary', or an inequality")
    displacement: Values | Literal["exact"] = Field(
        description="values in m, one per component held; or 'exact' (see [exact])"
    )
    components: list[Literal["x", "y", "z"]] | None = Field(
        default=None, description="which components are held; default all"
    )
    history: History | None = None

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
    history: History | None = None


class Traction(Strict):
    """Force per area on a part of the boundary (dead load)."""

    kind: Literal["traction"]
    where: str = Field(description="name of a boundary part, 'boundary', or an inequality")
    traction: Vector | Literal["exact"] = Field(description="Pa, or 'exact'")
    history: History | None = None


Load = Annotated[Gravity | BodyForce | Traction, Field(discriminator="kind")]


class Exact(Strict):
    """An exact solution by name; it can prescribe supports and loads, and judge results."""

    solution: str = Field(description="name; `verify list --exact` shows them")
    parameters: dict[str, Finite | list[Finite] | list[list[Finite]]] = Field(
        default_factory=dict, description="parameters of that solution, SI units"
    )


def _one_name(given: Any) -> Any:
    """Both names mean the energy μ‖U − I‖² + ½λ tr²(U − I) at any rotation."""
    return "corotational" if given == "finite_rotation" else given


Kinematics = Annotated[
    Literal["linear", "corotational"],
    BeforeValidator(_one_name),
    WithJsonSchema({"enum": ["linear", "corotational", "finite_rotation"], "type": "string"}),
]


class Analysis(Strict):
    """What is solved for."""

    kind: Literal["static", "dynamic"] = "static"
    kinematics: Kinematics = Field(
        default="linear", description="corotational, also called finite_rotation: large rotations"
    )
    duration: Positive | None = Field(default=None, description="dynamic: end time, s")
    time_step: Positive | None = Field(default=None, description="dynamic: largest step, s")
    outputs: Count | None = Field(
        default=None,
        ge=2,
        description="dynamic: number of output times, 0 and the end among them (default 11)",
    )
    damping: tuple[NonNegative, NonNegative] = Field(
        default=(0.0, 0.0), description="Rayleigh: mass (1/s) and stiffness (s) factors"
    )

    @model_validator(mode="after")
    def _times_belong(self) -> "Analysis":
        if self.kind == "dynamic" and self.duration is None:
            raise ValueError("a dynamic analysis needs a duration")
        if self.kind == "static" and (self.duration or self.time_step or self.outputs):
            raise ValueError("duration, time_step and outputs belong to a dynamic analysis")
        if self.kind == "static" and any(self.damping):
            raise ValueError("damping belongs to a dynamic analysis")
        return self

    @property
    def output_times(self) -> tuple[float, ...]:
        """Output times in s, evenly spaced from 0 to the duration; ``(0.0,)`` if static."""
        if self.duration is None:
            return (0.0,)
        count = self.outputs or _OUTPUTS
        return tuple(self.duration * k / (count - 1) for k in range(count))
