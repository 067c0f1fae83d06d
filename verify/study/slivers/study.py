"""The sliver study: families of scenes whose cuts come ever nearer to nodes, by any solver."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from time import perf_counter
from typing import Any

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.judge.system_numbers import (
    CONDITION,
    FREQUENCY,
    SCALED,
    STEP,
    condition_numbers,
    critical_step,
    lowest_frequency,
    with_uncut_twin,
)
from verify.printable import one_line, words_of
from verify.scene import Box, Rectangle, Scene, restore_scene
from verify.solvers import Solver
from verify.study.measured_scenes import (
    Making,
    MeasuredStudy,
    Measurement,
    Variant,
    measured_families,
    measurements,
)
from verify.study.slivers.findings import findings, growth
from verify.study.slivers.step_by_running import step_by_running

_FITTED = (CONDITION, SCALED, STEP)
Row = tuple[str, str, float | None, str]


@dataclass(frozen=True, kw_only=True)
class SliverStudy(MeasuredStudy):
    """What the study found.

    Attributes
    ----------
    growths : list of dict
        Exponent of each series over small ε, with its uncertainty and reason.
    """

    growths: list[dict[str, Any]]


def sliver_study(
    scenes: Sequence[Scene],
    variants: Sequence[Variant],
    making: Making,
    quick: bool = False,
) -> SliverStudy:
    """Solve every row of every family with every solver, and measure.

    Parameters
    ----------
    scenes : sequence of Scene
        Rows of families.
    variants : sequence of Variant
    making : Making
        Side by side; nothing that is measured is a time.
    quick : bool
        For the record.

    Raises
    ------
    InputError
        If no scene is a row of a family.
    """
    families: dict[str, list[Scene]] = {}
    for scene in scenes:
        if scene.row is not None:
            families.setdefault(scene.row.family, []).append(scene)
    if not families:
        raise InputError("no case with a list of values for a parameter; see `verify list`")
    start = perf_counter()
    every = measured_families(measured_row, families, variants, making)
    growths = _growths(every)
    return SliverStudy(
        findings=list(findings(every, growths)), seconds=perf_counter() - start, quick=quick,
        measurements=every, growths=growths,
    )  # fmt: skip


def measured_row(variant: dict[str, Any], content: dict[str, Any]) -> list[Measurement]:
    """Measure a scene as `measured_scene` does, and the system of its solver."""
    return measurements(Variant(**variant), restore_scene(content), _further)


def _further(solver: Solver, variant: Variant, scene: Scene, level: int) -> Iterator[Row]:
    """Measure condition, critical step and lowest frequency, from the system or by running."""
    if scene.analysis.kinematics != "linear" or scene.analysis.kind != "static":
        return
    system: Any = getattr(solver, "system", None)
    if system is None and getattr(solver, "implicit", False):
        yield STEP, "s", None, "its time integration is implicit: no step is critical"
        return
    if system is None:
        yield _by_running(solver, variant, scene, level)
        return
    try:
        own, whole = with_uncut_twin(system, scene, level, variant.parameters)
    except Exception as problem:  # a guest may raise anything
        refused = isinstance(problem, UnsupportedSceneError | InputError)
        why = str(problem) if refused else f"{type(problem).__name__}: {problem}"
        yield STEP, "s", None, one_line(why)
        return
    try:
        raw, scaled = condition_numbers(own)
        yield CONDITION, "", raw, ""
        yield SCALED, "", scaled, ""
    except InputError as problem:
        yield SCALED, "", None, str(problem)
    for name, unit, measure, one in (
        (STEP, "s", critical_step, own),
        (f"{STEP}, uncut", "s", critical_step, whole),
        (FREQUENCY, "1/s", lowest_frequency, own),
    ):
        try:
            yield name, unit, measure(one), ""
        except InputError as problem:
            yield name, unit, None, str(problem)


def _by_running(solver: Solver, variant: Variant, scene: Scene, level: int) -> Row:
    try:
        low, high = step_by_running(solver, scene, level, _guess(scene, level), variant.parameters)
    except InputError as problem:
        return STEP, "s", None, one_line(str(problem))
    except Exception as problem:  # a guest may raise anything
        return STEP, "s", None, words_of(problem)
    return STEP, "s", float((low * high) ** 0.5), f"by running: {low:.4g} to {high:.4g} s"


def _guess(scene: Scene, level: int) -> float:
    """Time in which a pressure wave crosses about a third of an element, s."""
    cells, box = scene.mesh.cells, scene.geometry
    material = scene.material
    assert material.density is not None
    speed = (material.young / material.density) ** 0.5
    if cells is None:
        assert scene.mesh.sizes is not None
        return scene.mesh.sizes[level] / speed / 3.0
    assert isinstance(box, Rectangle | Box)
    sides = np.subtract(box.upper, box.lower) / cells[level]
    return float(sides.min() / speed / 3.0)


def _growths(found: Sequence[Measurement]) -> list[dict[str, Any]]:
    series: dict[tuple[str, str, str], list[Measurement]] = {}
    for one in found:
        if one.quantity in _FITTED and one.size is not None:
            series.setdefault((one.family, one.solver, one.quantity), []).append(one)
    return [
        {"family": family, "solver": solver, "quantity": quantity}
        | asdict(growth([m.size or 0.0 for m in own], [m.value for m in own]))
        for (family, solver, quantity), own in series.items()
    ]
