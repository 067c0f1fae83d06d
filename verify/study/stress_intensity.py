"""Stress-intensity factors of any solver's solution, by the reference's interaction integral."""

from typing import Any

import numpy as np

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import ArcCut, BodyForce, Gravity, PolylineCut, Scene, is_uniform
from verify.scene.acceptance import StressIntensityQuantity
from verify.solution import Solution

__all__ = ["exact_intensity", "solution_intensity"]


def solution_intensity(scene: Scene, solution: Solution, asked: StressIntensityQuantity) -> float:
    """K_I or K_II in Pa √m at an end of a straight cut, from the field alone.

    The mean over domains around the end as asked: a tip that a solver has put elsewhere shows.

    Raises
    ------
    UnsupportedSceneError
        If the scene is not plane and linear, the end is no tip, or the mesh is too coarse for a
        domain around it.
    """
    if scene.dimension != 2 or scene.analysis.kinematics != "linear":
        raise UnsupportedSceneError(
            "stress-intensity factors are measured in plane scenes of linear kinematics"
        )
    from reference.fracture import stress_intensity, tips

    tip = next((t for t in tips(scene) if (t.cut, t.end) == (asked.cut, asked.end)), None)
    if tip is None:
        raise UnsupportedSceneError(
            f"the {asked.end} of cut '{asked.cut}' is no tip: it is not inside the body, or meets "
            "another cut"
        )
    try:
        found = stress_intensity(
            solution, scene.material, tip.point, tip.direction, tip.radii(), _body_force(scene)
        )
    except InputError as problem:
        raise UnsupportedSceneError(str(problem)) from None
    return found.mode_1 if asked.mode == "I" else found.mode_2


def exact_intensity(scene: Scene, exact: Any, asked: StressIntensityQuantity) -> float | None:
    """Factor that an exact solution states, Pa √m; None if it states none."""
    if hasattr(exact, "intensity_at"):  # its tips differ
        cut = next(cut for cut in scene.cuts if cut.name == asked.cut)
        assert isinstance(cut, PolylineCut | ArcCut)  # the scene is plane
        stated = exact.intensity_at(cut.vertices()[0 if asked.end == "start" else -1])
    else:
        stated = getattr(exact, "stress_intensity", None)
    return None if stated is None else float(stated[0 if asked.mode == "I" else 1])


def _body_force(scene: Scene) -> np.ndarray | None:
    """Force per volume (2,) in N/m³, if there is any."""
    total = np.zeros(scene.dimension)
    for load in scene.loads:
        if isinstance(load, Gravity):
            total += (scene.material.density or 0.0) * np.asarray(load.acceleration)
        elif isinstance(load, BodyForce):
            if load.force == "exact" or not is_uniform(load.force):
                raise UnsupportedSceneError(
                    "stress-intensity factors are measured with uniform body forces only"
                )
            total += np.asarray(load.force)
    return total if total.any() else None
