"""What a scene measures and what it accepts."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from verify.scene.strict import Finite, Positive, Strict, Vector

__all__ = [
    "Acceptance",
    "BoundCheck",
    "DisplacementQuantity",
    "OpeningQuantity",
    "Quantity",
    "RateCheck",
    "RatioCheck",
    "StrainEnergyQuantity",
    "ValueCheck",
]

METRICS = ("displacement_l2", "energy_norm", "jump_l2", "strain_energy")


class StrainEnergyQuantity(Strict):
    """Strain energy of the whole body, J (2D: J per metre of thickness)."""

    kind: Literal["strain_energy"]

    @property
    def name(self) -> str:
        """Name under which it is reported."""
        return "strain_energy"


class DisplacementQuantity(Strict):
    """A displacement component at a point of the body, m."""

    kind: Literal["displacement"]
    name: str
    point: Vector = Field(description="material coordinates, m; not on a cut")
    component: Literal["x", "y", "z"]


class OpeningQuantity(Strict):
    """The displacement jump (positive minus negative side) at a point of a cut, m."""

    kind: Literal["opening"]
    name: str
    cut: str = "cut"
    at: float = Field(
        strict=True, ge=0.0, le=1.0, description="position as a fraction of the cut's length"
    )
    component: Literal["normal", "tangential"] = "normal"


Quantity = Annotated[
    StrainEnergyQuantity | DisplacementQuantity | OpeningQuantity, Field(discriminator="kind")
]


class _Check(Strict):
    solver: str = Field(default="xfem", description="the solver that is judged")
    metric: str = Field(
        description="displacement_l2, energy_norm, jump_l2 (relative errors), strain_energy, "
        "or the name of a quantity"
    )


class RateCheck(_Check):
    """The observed order of an error over the mesh levels."""

    check: Literal["rate"]
    at_least: Finite | None = None
    equals: Finite | None = None
    within: Positive | None = Field(default=None, description="tolerance of `equals`")

    @model_validator(mode="after")
    def _one_form(self) -> "RateCheck":
        if (self.at_least is None) == (self.equals is None):
            raise ValueError("a rate check has either at_least, or equals with within")
        if (self.equals is None) != (self.within is None):
            raise ValueError("equals and within go together")
        return self


class BoundCheck(_Check):
    """The relative error on the finest mesh."""

    check: Literal["error"]
    at_most: Positive


class RatioCheck(_Check):
    """The error over another solver's at equal mesh size, on every level."""

    check: Literal["ratio"]
    to: str = Field(default="conforming", description="the solver compared with")
    at_most: Positive | None = None
    within: Positive | None = Field(default=None, description="|ratio − 1| must not exceed it")

    @model_validator(mode="after")
    def _one_form(self) -> "RatioCheck":
        if (self.at_most is None) == (self.within is None):
            raise ValueError("a ratio check has either at_most or within")
        return self


class ValueCheck(_Check):
    """A quantity against a stated value (exact, or independent of this project)."""

    check: Literal["value"]
    equals: Finite
    relative_tolerance: Positive
    source: str = Field(description="where the value comes from")


Acceptance = Annotated[
    RateCheck | BoundCheck | RatioCheck | ValueCheck, Field(discriminator="check")
]
