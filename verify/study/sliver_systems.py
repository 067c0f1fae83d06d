"""Measurements of one row of a family of slivers: errors, condition, explicit step, frequency."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.printable import one_line, words_of
from verify.scene import Box, Rectangle, Scene, restore_scene
from verify.solvers import Solver
from verify.study.measured_scenes import Measurement, Variant, measurements
from verify.study.step_by_running import step_by_running
from verify.system import (
    CONDITION,
    FREQUENCY,
    SCALED,
    STEP,
    condition_numbers,
    critical_step,
    lowest_frequency,
    with_uncut_twin,
)

UNKNOWNS = "unknowns of the system"
Row = tuple[str, str, float | None, str]


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
    # another number of unknowns is another mesh: no curve passes from one to the other
    yield UNKNOWNS, "", float(own.stiffness.shape[0]), ""
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
