"""Stress-intensity factors at a point of the front of a round crack in space."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import Box, DiscCut, Material, Scene
from verify.scene.acceptance import StressIntensityQuantity
from verify.scene.cut_faces import distance_to_cuts
from verify.solution import Solution

__all__ = ["front_defect", "front_factors", "front_reach"]

Array = NDArray[np.float64]

_STATIONS = 12  # hats of 30 degrees along the front
_SHARES = (0.4, 0.5, 0.6)  # radii of the domains, of the reach
_AROUND = 64  # places on the front from which distances are taken


def front_defect(scene: Scene, asked: StressIntensityQuantity) -> str | None:
    """Why a factor at a front cannot be had from any solution of a scene, or None."""
    if not isinstance(scene.geometry, Box):
        return "factors along a front are measured in boxes"
    if not front_reach(scene, asked.cut) > 0.0:
        return f"the front of cut '{asked.cut}' leaves the body or meets another cut"
    return None


def front_reach(scene: Scene, name: str) -> float:
    """Distance (m) from the front of a disc to what a domain must not meet; 0 if it meets it."""
    cut = _disc(scene, name)
    assert isinstance(scene.geometry, Box)
    turn = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    first, second, _ = cut.axes()
    spokes = np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second)
    front = np.asarray(cut.centre) + (cut.radius or 0.0) * spokes
    walls = np.concatenate([front - scene.geometry.lower, scene.geometry.upper - front], axis=1)
    others = [one for one in scene.final_cuts if one.name != name]
    away = distance_to_cuts(others, front).min(initial=np.inf)
    # between two of these places the front may meet what is nearer than half their distance
    met = float(np.pi * (cut.radius or 0.0) / _AROUND)
    reach = min(float(cut.radius or 0.0), float(walls.min()), float(away))
    return reach if reach > met else 0.0


def front_factors(
    scene: Scene,
    solution: Solution,
    material: Material,
    asked: StressIntensityQuantity,
    **moving: Any,
) -> tuple[float, float, float]:
    """K_I, K_II and K_III (Pa √m) at the point of a front, from the field alone.

    Each station of the interaction integral gives the mean of K with a hat along the front; the
    second difference of three stations, over 12, makes it K at the middle but for the fourth
    order of the hat's width.

    Raises
    ------
    InputError
        If the mesh is too coarse for the domains.
    """
    from reference.fracture import CircularFront, front_intensity

    cut = _disc(scene, asked.cut)
    spoke = np.asarray(asked.point, dtype=float) - np.asarray(cut.centre)
    front = CircularFront(cut.centre, cut.normal, float(cut.radius or 0.0), towards=spoke)
    radii = front_reach(scene, asked.cut) * np.array(_SHARES)
    found = front_intensity(
        solution, material, front, radii, stations=_STATIONS, fitted=False, **moving
    ).modes
    k_1, k_2, k_3 = found[0] - (found[1] - 2.0 * found[0] + found[-1]) / 12.0
    return float(k_1), float(k_2), float(k_3)


def _disc(scene: Scene, name: str) -> DiscCut:
    cut = next(cut for cut in scene.final_cuts if cut.name == name)
    if not isinstance(cut, DiscCut):
        raise InputError(f"cut '{name}' is no disc")
    return cut
