"""The base of all scene models: strict, frozen, unknown keys are errors."""

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

# `strict`: a number is a number; "1e4" and true are not
# and none is so large, or so small above zero, that its powers are not
_LARGEST = 1e60
_SMALLEST = 1e-60


def _not_tiny(value: float) -> float:
    if value < _SMALLEST:
        raise ValueError(f"expected a number ≥ {_SMALLEST:g}, got {value:g}")
    return value


Finite = Annotated[float, Field(strict=True, ge=-_LARGEST, le=_LARGEST, allow_inf_nan=False)]
Positive = Annotated[
    float,
    Field(strict=True, gt=0, le=_LARGEST, allow_inf_nan=False),
    AfterValidator(_not_tiny),
]
NonNegative = Annotated[float, Field(strict=True, ge=0, le=_LARGEST, allow_inf_nan=False)]
Count = Annotated[int, Field(strict=True, ge=1, le=10**9)]
# of what is printed: no escapes of the terminal, no marks of direction
Line = Annotated[
    str,
    Field(
        min_length=1,
        max_length=2000,
        pattern=r"^[^\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]*$",
    ),
]
Point2 = tuple[Finite, Finite]
Point3 = tuple[Finite, Finite, Finite]
Vector = Annotated[list[Finite], Field(min_length=2, max_length=3)]
# a number, or a formula in x, y, z, t that `verify.scene.regions.parse_expression` reads
Formula = Annotated[str, Field(min_length=1, max_length=1000)]
Components = Annotated[list[Finite | Formula], Field(min_length=1, max_length=3)]


class Strict(BaseModel):
    """A part of a scene. Unknown keys are refused; values do not change after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)
