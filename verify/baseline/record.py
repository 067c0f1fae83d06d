"""The baseline file: JSON, sorted, made to be committed and read in a review."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from verify.errors import InputError
from verify.files import read_json, write_json
from verify.scene.strict import Finite, NonNegative, Positive, Strict, first_fault


class _From(Strict):
    """Where a number comes from."""

    commit: str | None = None
    dirty: bool | None = None
    date: str | None = None
    meaning: int = Field(default=1, description="revision of what the number means")


class Own(_From):
    """First axis: the last own value."""

    value: Finite
    tolerance: NonNegative = Field(default=1e-6, description="relative to `value`")
    absolute: NonNegative = Field(default=0.0, description="added to it, in the unit")


class Independent(_From):
    """Second axis: a value that owes nothing to the solver. `update` never moves it."""

    value: Finite = Field(description="0 for an error, whose true value that is")
    uncertainty: NonNegative = Field(default=0.0, description="half-width, in the unit")
    tolerance: Positive | None = Field(
        default=None,
        description="relative to `value`, or absolute if that is 0; null: not judged",
    )
    source: str = Field(description="where it comes from")


class Quantity(Strict):
    """A metric of one solver on one mesh level."""

    unit: str
    own: Own
    independent: Independent | None = None


class Speed(_From):
    """Time of a solve over that of the calibration kernel in the same process."""

    ratio: Positive
    spread: NonNegative = Field(description="relative half-width of `ratio`")
    kernel: int = Field(default=1, description="number of that kernel; ratios to others differ")
    slower_at_most: Annotated[float, Field(strict=True, gt=1.0)] = 1.5
    cpu: str = ""


class CaseBaseline(Strict):
    """Quantities by ``solver/level/metric``, speeds by ``solver/level``."""

    physics: str = Field(description="digest of the scene without words and acceptance")
    quantities: dict[str, Quantity] = Field(default_factory=dict)
    speed: dict[str, Speed] = Field(default_factory=dict)


class Baseline(Strict):
    """What a project holds its runs against."""

    schema_: Literal[1] = Field(default=1, alias="schema")
    cases: dict[str, CaseBaseline] = Field(default_factory=dict)


def read_baseline(path: Path) -> Baseline:
    """Read a baseline file.

    Raises
    ------
    InputError
        If it is missing or not of this form; with the key and what was expected there.
    """
    content = read_json(path, "a baseline; `verify baseline save RUN --file FILE` makes one")
    try:
        return Baseline.model_validate(content)
    except ValidationError as error:
        schema = Baseline.model_json_schema(by_alias=True)
        raise InputError(first_fault(error, content, schema), str(path)) from None


def write_baseline(baseline: Baseline, path: Path) -> None:
    """Write `baseline` in one step, sorted, so that a diff shows what moved and nothing else."""
    content = baseline.model_dump(mode="json", by_alias=True)
    cases = {
        name: {
            "physics": case["physics"],
            "quantities": dict(sorted(case["quantities"].items())),
            "speed": dict(sorted(case["speed"].items())),
        }
        for name, case in sorted(content["cases"].items())
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json({"schema": content["schema"], "cases": cases}, path)
