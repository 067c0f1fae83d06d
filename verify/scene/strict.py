"""The base of all scene models: strict, frozen, unknown keys are errors; and the form of a rule.

A rule is a row of a table: the key that it is about, what breaks it, and the text of the message.
"""

from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

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

#: key that the rule is about (empty: the part as a whole), what breaks it, and the message
Rule = tuple[str, Callable[..., Any], str]
Rules = tuple[Rule, ...]


def first_broken(rules: Rules, *parts: Any, place: str = "") -> str | None:
    """Say in one line which rule is broken first, or None if all hold.

    Parameters
    ----------
    rules : Rules
        What breaks a rule is asked of the parts. It answers with nothing (None, False) if the rule
        holds; else with what stands in the braces of the message, a tuple if that are several.
    parts
        What the rules are on.
    place : str
        Where it stands, before the key.
    """
    for key, broken, text in rules:
        if found := broken(*parts):
            said = text.format(*found) if isinstance(found, tuple) else text.format(found)
            where = ".".join(filter(None, (place, key)))
            return f"{where}: {said}" if where else said
    return None


def none_or_both(one: str, other: str) -> Callable[[Any], bool]:
    """Break a rule where neither of two keys is given, or both are."""
    return lambda part: (getattr(part, one) is None) == (getattr(part, other) is None)


def one_alone(one: str, other: str) -> Callable[[Any], bool]:
    """Break a rule where one of two keys is given without the other."""
    return lambda part: (getattr(part, one) is None) != (getattr(part, other) is None)


class Strict(BaseModel):
    """A part of a scene. Unknown keys are refused; values do not change after validation."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    rules: ClassVar[Rules] = ()

    @model_validator(mode="after")
    def _keeps_its_rules(self) -> Self:
        if fault := first_broken(self.rules, self):
            raise ValueError(fault)
        return self
