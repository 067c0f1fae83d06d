"""Measurements of one row of a family of slivers: errors, condition, explicit step, frequency.

The step of a solver of which only solutions are known is bisected by runs.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.printable import one_line, words_of
from verify.scene import Analysis, Box, Rectangle, Scene, restore_scene
from verify.solvers import Solver
from verify.solvers.interface import refusal_of
from verify.study.measured_scenes import Measurement, Variant, measurements, variant_of
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


def measured_row(variant: str, content: dict[str, Any]) -> list[Measurement]:
    """Measure a scene as `measured_scene` does, and the system of its solver."""
    return measurements(variant_of(variant), restore_scene(content), _further)


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


_STEPS = 300  # 1 % beyond the critical step a mode grows by e^(0.28 · 300)
_BLOWN_UP = 1e3  # sizes of the body that something moves
_DOUBLINGS, _BISECTIONS = 7, 7


def step_by_running(
    solver: Solver, scene: Scene, level: int, guess: float, parameters: dict[str, Any]
) -> tuple[float, float]:
    """Bracket the largest `time_step` at which a motion of `scene` does not blow up.

    The body starts at rest, and its supports and loads act at once. A run has blown up if a
    displacement is not finite or above a thousand times the body's size. An ArithmeticError,
    ValueError or RuntimeError of the solver counts as a blow-up too; other errors are raised.

    Parameters
    ----------
    guess : float
        s; a first step, from which it is doubled or halved up to 7 times.

    Returns
    -------
    stable, unstable : float
        s; about 1 % apart.

    Raises
    ------
    InputError
        If the solver refuses the motion, no step blows up (it is implicit, or chooses its own
        step), or every step does.
    """
    if scene.material.density is None:
        raise InputError("the scene states no density")
    if refusal := refusal_of(solver, _motion(scene, guess)):
        raise InputError(f"it refuses the motion: {refusal}")

    def stable(step: float) -> bool:
        return _is_stable(solver, _motion(scene, step), level, parameters)

    low = high = guess
    rising = stable(guess)
    for _ in range(_DOUBLINGS):
        low, high = (high, 2.0 * high) if rising else (0.5 * low, low)
        if stable(high if rising else low) is not rising:
            break
    else:
        if rising:
            text = (
                f"no run blows up, up to a step of {high:.2g} s: it is implicit, or takes its own"
            )
            raise InputError(text)
        raise InputError(f"every run blows up, down to a step of {low:.2g} s")
    for _ in range(_BISECTIONS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low, high


def _motion(scene: Scene, step: float) -> Scene:
    analysis = Analysis(kind="dynamic", duration=_STEPS * step, time_step=step, outputs=2)
    return scene.model_copy(update={"analysis": analysis, "acceptance": []})


def _is_stable(solver: Solver, scene: Scene, level: int, parameters: dict[str, Any]) -> bool:
    try:
        with np.errstate(all="ignore"):
            solution = solver.solve(scene, level, repetitions=1, **parameters)
    except UnsupportedSceneError as refusal:
        raise InputError(f"it refuses the motion: {refusal}") from None
    except InputError:
        raise
    except (ArithmeticError, ValueError, RuntimeError):  # of a solver that notices it itself
        return False
    size = float(np.ptp(np.asarray(solution.points), axis=0).max())
    largest = np.abs(np.asarray(solution.displacement)).max()
    return bool(np.isfinite(largest) and largest < _BLOWN_UP * size)
