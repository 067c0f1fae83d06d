"""Measurements of the study of the thesis, before they are judged.

Slivers: explicit step and condition of bodies whose cut comes ever nearer to nodes. Methods: error,
energy, step and time of each against one conforming reference or exact solution.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.judge.cost import work_points
from verify.judge.intervals import error_interval
from verify.result import CaseResult, Metric, SolveRecord, Status
from verify.scene import load_scenes, restore_scene
from verify.simulator.thesis import Delay, FaceCount, Frames, RealTime, StepTime, StripCount
from verify.solvers import find_solver
from verify.study.measured_scenes import variant_of
from verify.system import condition_numbers, critical_step, with_uncut_twin

METHODS = (
    "xfem", "xfem mass=consistent", "virtual_node", "subdivision", "snapping_subdivision",
    "snapping",
)  # fmt: skip


@dataclass(frozen=True)
class SliverSystem:
    """One method with slivers of one size.

    Attributes
    ----------
    dimension : int
    method : str
        As a study of slivers takes it.
    size : float
        Distance of the cut from a layer of nodes, in element sizes.
    ratio : float
        Critical explicit step over the step of the uncut body.
    condition, scaled : float
        Condition number of the stiffness, and of the stiffness scaled by its diagonal.
    unknowns : int
        Of the system; others where the method has moved nodes onto the cut, or the cut onto nodes.
    """

    dimension: int
    method: str
    size: float
    ratio: float
    condition: float
    scaled: float
    unknowns: int


def sliver_systems(family: str, method: str) -> list[SliverSystem]:
    """Measure the systems of a method on a family of slivers, the row of ε = 0 left out."""
    variant = variant_of(method)
    system: Any = getattr(variant.found(), "system", None)
    found = []
    for scene in load_scenes(family):
        if scene.row is None or not 0.0 < scene.row.value < 0.5:
            continue
        try:
            own, whole = with_uncut_twin(system, scene, 0, variant.parameters)
        except UnsupportedSceneError:
            continue
        ratio = critical_step(own) / critical_step(whole)
        raw, scaled = condition_numbers(own)
        count, size = own.stiffness.shape[0], scene.row.value
        found.append(SliverSystem(scene.dimension, method, size, ratio, raw, scaled, count))
    return found


def exponent(steps: Sequence[SliverSystem]) -> float:
    """Slope of log(critical step) over log(size) where the step falls to its least.

    It lies between the size of the least step and the next larger one, or the next smaller if there
    is no larger. Beyond the least a method has moved the cut onto nodes: no slope leads there.
    """
    rows = sorted(steps, key=lambda step: -step.size)
    if len(rows) < 2:
        return float("nan")
    at = max(rows.index(min(rows, key=lambda step: step.ratio)), 1)
    one, two = rows[at - 1], rows[at]
    return float(np.log(two.ratio / one.ratio) / np.log(two.size / one.size))


@dataclass(frozen=True)
class MethodOnCase:
    """One method on one mesh of one case.

    Attributes
    ----------
    case, solver : str
    level : int
    size : float or None
        Of the elements, m.
    unknowns : int or None
    displacement, energy_norm, jump : (value, low, high) or None
        Relative errors with the intervals in which they lie.
    energy : float or None
        Relative error of the strain energy.
    critical_step : float or None
        Over the step of the uncut mesh; None where the method has none or its mesh is not the
        background mesh.
    seconds : float or None
        Wall time of what each cut costs anew, median.
    reason : str
        Why there is no answer or no comparison.
    changed : str
        What the method moved, removed or left out: the largest of each kind.
    """

    case: str
    solver: str
    level: int
    size: float | None
    unknowns: int | None
    displacement: tuple[float, float, float] | None
    energy_norm: tuple[float, float, float] | None
    jump: tuple[float, float, float] | None
    energy: float | None
    critical_step: float | None
    seconds: float | None
    reason: str
    changed: str


@dataclass(frozen=True)
class CriticalStep:
    """Critical explicit step of a solver on a level of a case, over the uncut mesh's."""

    case: str
    solver: str
    level: int
    ratio: float


def compare_methods(
    results: Sequence[CaseResult], steps: Sequence[CriticalStep]
) -> list[MethodOnCase]:
    """Sum up what the runner has solved and measured, beside critical steps."""
    known = {(one.case, one.solver, one.level): one.ratio for one in steps}
    found = []
    for result in results:
        times = {
            (point.solver, point.level): point.seconds
            for metric in ("displacement_l2", "energy_norm")
            for point in work_points(result.solves, metric)
        }
        for record in result.solves:
            if record.solver != "reference":
                key = record.solver, record.level
                step = known.get((result.case, *key))
                found.append(_summed_up(result.case, record, times.get(key), step))
    return found


def _summed_up(
    case: str, record: SolveRecord, seconds: float | None, step: float | None
) -> MethodOnCase:
    displacement, energy_norm, jump = (
        _interval(record.metric(name)) for name in ("displacement_l2", "energy_norm", "jump_l2")
    )
    reason = record.reason if record.status is not Status.SOLVED else ""
    if not reason and displacement is None:
        reason = record.notes.get("comparison", "not compared")
    changed = "; ".join(
        f"{one.kind}: {one.count}, {one.size:.2g} {one.unit}"
        for one in record.regularisations
        if one.size
    )
    return MethodOnCase(
        case, record.solver, record.level, record.size, record.unknowns, displacement,
        energy_norm, jump, _relative(record.metric("strain_energy")), step, seconds, reason,
        changed,
    )  # fmt: skip


def _interval(metric: Metric | None) -> tuple[float, float, float] | None:
    if metric is None:
        return None
    found = error_interval(metric)
    return found.value, found.low, found.high


def _relative(metric: Metric | None) -> float | None:
    if metric is None or not metric.reference:
        return None
    return metric.value / metric.reference - 1.0


def critical_steps(content: dict[str, Any], solvers: Sequence[str]) -> list[CriticalStep]:
    """Measure those solvers that hand over their system.

    Parameters
    ----------
    content : dict
        Scene, as `verify.scene.scene_content` writes it.
    solvers : sequence of str
    """
    scene = restore_scene(content)
    name = scene.name
    # any density does: the ratio does not depend on it
    heavy = scene.material.model_copy(update={"density": scene.material.density or 1.0})
    scene = scene.model_copy(update={"material": heavy})
    found = []
    for solver in solvers:
        system: Any = getattr(find_solver(solver), "system", None)
        for level in range(scene.mesh.count) if system is not None else ():
            try:
                own, whole = with_uncut_twin(system, scene, level, {})
                ratio = critical_step(own) / critical_step(whole)
            except (UnsupportedSceneError, InputError):
                continue  # the solve has the reason
            found.append(CriticalStep(name, solver, level, ratio))
    return found


@dataclass(frozen=True)
class Measured:
    """Numbers of all tables.

    Attributes
    ----------
    strips, face : Table 4.3, Figure 4.11
    steps : Tables 4.4 and 4.5, Figure 4.25
    delays, frames : Table 4.6, Figure 4.26
    hand : real time
    methods : accuracy
    slivers : stability, and what goes wrong
    contended : str
        Why times may be too long, if they may.
    """

    strips: list[StripCount]
    face: list[FaceCount]
    steps: list[StepTime]
    delays: list[Delay]
    frames: list[Frames]
    hand: RealTime
    methods: list[MethodOnCase]
    slivers: list[SliverSystem]
    contended: str = ""
