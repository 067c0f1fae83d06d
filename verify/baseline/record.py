"""The file of a baseline, and a finished run as a baseline reads it.

The file is JSON, sorted, made to be committed and read in a review.
"""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from statistics import median
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError

from verify.errors import InputError
from verify.files import read_json, write_json
from verify.judge.intervals import ERROR_METRICS
from verify.provenance import KERNEL, seconds_of_note
from verify.result import (
    HANDED_OVER,
    REFERENCE,
    CaseResult,
    Metric,
    SolveRecord,
    Status,
    finest_of,
    read_result,
    repeated_totals,
)
from verify.runner.fingerprint import digest_of
from verify.scene import Scene
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
    """Time of a solve over the time of the calibration kernel in the same process."""

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


# errors below this are round-off; how large round-off is says nothing
_ROUND_OFF = 1e-10


def finest(result: CaseResult) -> list[SolveRecord]:
    """Return the finest level of each solver, solved or not."""
    return list(finest_of(result.solves).values())


def solve_at(result: CaseResult, place: str) -> SolveRecord | None:
    """Find the solve ``solver/level`` in a result."""
    return next((s for s in result.solves if f"{s.solver}/{s.level}" == place), None)


def metric_of(result: CaseResult, name: str) -> tuple[Metric | None, str]:
    """Find ``solver/level/metric`` in a result, or say why it is not there."""
    place, _, metric_name = name.rpartition("/")
    solve = solve_at(result, place)
    if solve is None:
        solver, _, level = place.rpartition("/")
        return None, f"'{solver}' level {level} was not run"
    metric = solve.metric(metric_name)
    if metric is not None:
        return (metric, "") if isfinite(metric.value) else (None, "it is not finite")
    why = solve.reason or solve.notes.get(metric_name, "it was not measured")
    return None, f"{solve.status}: {why}" if solve.status is not Status.SOLVED else why


def quantities_of(result: CaseResult, origin: dict[str, Any]) -> dict[str, Quantity]:
    """Return every metric of the finest solved levels, with both its axes."""
    found = {}
    for solve in finest(result):
        if solve.status is not Status.SOLVED:
            continue
        for metric in solve.metrics:
            if not isfinite(metric.value):
                continue
            absolute = _ROUND_OFF if metric.name in ERROR_METRICS else 0.0
            found[f"{solve.solver}/{solve.level}/{metric.name}"] = Quantity(
                unit=metric.unit,
                own=Own(value=float(metric.value), absolute=absolute, **origin),
                independent=_independent(result, solve.solver, metric, origin),
            )
    return found


def _independent(
    result: CaseResult, solver: str, metric: Metric, origin: dict[str, Any]
) -> Independent | None:
    """Take the independent value and tolerance that the case states, else the reference's value."""
    checks = [
        check
        for check in result.scene.get("acceptance", [])
        if check["solver"] in (None, solver) and check["metric"] == metric.name
    ]
    for check in checks:
        if check["check"] == "value":
            return Independent(
                value=check["equals"],
                tolerance=check["relative_tolerance"],
                source=check["source"],
                **origin,
            )
    asked = (c for c in checks if c["check"] == "error" and (c["solver"] or solver != REFERENCE))
    bound = next((check["at_most"] for check in asked), None)
    if metric.name in ERROR_METRICS:
        return Independent(value=0.0, tolerance=bound, source=metric.source, **origin)
    if metric.reference is None:
        return None
    return Independent(
        value=metric.reference,
        uncertainty=metric.uncertainty,
        tolerance=bound,
        source=metric.source,
        **origin,
    )


def speed_of(solve: SolveRecord, cpu: str, origin: dict[str, Any]) -> Speed | str:
    """Return the time of one solve, over all its phases, in units of the calibration kernel.

    Or why there is none.
    """
    kernel = seconds_of_note(solve.notes.get("calibration", ""))
    if solve.status is not Status.SOLVED:
        return f"{solve.status}: {solve.reason}"
    own = {name: times for name, times in solve.timings.items() if name != HANDED_OVER}
    totals = repeated_totals(own)
    if not totals:
        return "the solver gives no timings"
    if solve.notes.get("timing", "").startswith("contended"):
        return solve.notes["timing"]
    if len(totals) < 3:
        return f"{len(totals)} repetitions; a spread needs 3"
    if kernel is None:
        return "the calibration kernel was not timed beside it"
    if not median(totals) > 0.0:
        return "its times are zero"
    spread, ratio = _half_width(totals) + _half_width(kernel), median(totals) / median(kernel)
    return Speed(ratio=ratio, spread=spread, kernel=KERNEL, cpu=cpu, **origin)


def _half_width(seconds: list[float]) -> float:
    """Half the range over the median; a range, because the few values are no normal sample."""
    return 0.5 * (max(seconds) - min(seconds)) / median(seconds)


@dataclass(frozen=True)
class FinishedRun:
    """Results of a run by case, and where it comes from (commit, dirty, date, cpu)."""

    directory: Path
    results: dict[str, CaseResult]
    provenance: dict[str, Any]

    @property
    def origin(self) -> dict[str, Any]:
        """What a baseline keeps of the provenance: commit, dirty flag, date, meaning."""
        kept = {key: self.provenance.get(key) for key in ("commit", "dirty", "date")}
        return kept | {"meaning": self.meaning}

    @property
    def meaning(self) -> int:
        """Revision of what its numbers mean; 1 before revisions were kept."""
        found = self.provenance.get("meaning", 1)
        return found if isinstance(found, int) else 1


def read_run(directory: Path) -> FinishedRun:
    """Read a run that `verify run` or `verify import` has finished.

    Raises
    ------
    InputError
        If there is none, it has not finished, or a result is missing or damaged.
    """
    if not (directory / "run.json").is_file():
        raise InputError("not a run (it has no run.json)", str(directory))
    record = read_json(directory / "run.json")
    if not record.get("finished"):
        raise InputError("the run has not finished; its own command resumes it", str(directory))
    files = sorted((directory / "cases").glob("*/result.json"))
    results = [read_result(file) for file in files]
    by_case = {result.case: result for result in results}
    for name in record.get("cases", []):
        if name not in by_case:
            raise InputError(f"no result of '{name}'; run it again", str(directory))
    return FinishedRun(directory, by_case, record.get("provenance") or {})


def physics_of(result: CaseResult) -> str:
    """Digest of what was asked: the scene without its words and its acceptance.

    Defaults are left out, so that a key that the schema gains later changes nothing. A mesh file
    enters by the hash of the whole scene, which contains its bytes.

    Raises
    ------
    InputError
        If the scene in the result is not one of this version.
    """
    given = result.scene
    if all(cut.get("kind") != "tool_path" for cut in given.get("cuts") or []):
        analysis = {key: x for key, x in (given.get("analysis") or {}).items() if key != "opening"}
        given = {**given, "analysis": analysis}  # its default was another one
    try:
        scene = Scene.model_validate(given)
    except ValidationError:
        raise InputError("its scene is not of this version; run it again", result.case) from None
    words = {*scene.words, "acceptance", "known_findings"} - {"adequacy"}
    content: list[Any] = [
        scene.model_dump(mode="json", by_alias=True, exclude=words, exclude_defaults=True)
    ]
    if result.scene.get("geometry", {}).get("kind") == "file":
        content.append(result.scene_hash)
    return digest_of(content)
