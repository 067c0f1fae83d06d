"""The base of all scene models: strict, frozen, unknown keys are errors."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Finite", "NonNegative", "Point2", "Point3", "Positive", "Strict", "Vector"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Point2 = tuple[Finite, Finite]
Point3 = tuple[Finite, Finite, Finite]
Vector = Annotated[list[Finite], Field(min_length=2, max_length=3)]


class Strict(BaseModel):
    """A part of a scene. Unknown keys are refused; values do not change after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)
