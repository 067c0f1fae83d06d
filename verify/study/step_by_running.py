"""The critical explicit step of a solver of which only solutions are known: bisection of runs."""

from typing import Any

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Analysis, Scene
from verify.solvers import Solver
from verify.solvers.interface import refusal_of

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
    if stable(guess):
        for _ in range(_DOUBLINGS):
            low, high = high, 2.0 * high
            if not stable(high):
                break
        else:
            raise InputError(
                f"no run blows up, up to a step of {high:.2g} s: it is implicit, or takes its own"
            )
    else:
        for _ in range(_DOUBLINGS):
            low, high = 0.5 * low, low
            if stable(low):
                break
        else:
            raise InputError(f"every run blows up, down to a step of {low:.2g} s")
    for _ in range(_BISECTIONS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low, high


def _motion(scene: Scene, step: float) -> Scene:
    analysis = Analysis(kind="dynamic", duration=_STEPS * step, time_step=step, outputs=2)
    moving = scene.model_copy(update={"analysis": analysis, "acceptance": []})
    return moving


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
