"""Stress-intensity factor of mode III at the blade of a tool path, at a time."""

import numpy as np

from verify.compare.body import AnyBody
from verify.compare.motion import Motion
from verify.compare.solid import SolidBody
from verify.compare.tearing import BladeFront, tearing_intensity
from verify.errors import UnsupportedSceneError
from verify.scene import Scene, ToolPathCut
from verify.scene.acceptance import StressIntensityQuantity

_SAMPLES = 401  # points of the blade, of which those in the body count


def blade_intensity(
    scene: Scene, motion: Motion, body: AnyBody, asked: StressIntensityQuantity
) -> float:
    """K_III in Pa √m at the place where the blade is, wherever a solver has its tip.

    Raises
    ------
    UnsupportedSceneError
        If the blade does not advance through the body at that time, at finite rotation, or where
        materials differ by region.
    """
    if scene.analysis.kinematics != "linear" or not scene.material.is_uniform:
        raise UnsupportedSceneError(
            "K_III at a blade is measured in linear kinematics and one material"
        )
    cut = next(cut for cut in scene.cuts if cut.name == asked.cut)
    assert isinstance(cut, ToolPathCut)  # the scene was checked
    assert asked.radius is not None
    assert isinstance(body, SolidBody)
    time = scene.analysis.output_times[-1] if asked.time is None else asked.time
    front = blade_front(cut, body, float(time))
    field = motion.at(float(time))
    return tearing_intensity(field, body, asked.cut, front, asked.radius, scene.material)


def blade_front(cut: ToolPathCut, body: SolidBody, time: float) -> BladeFront:
    """Front at a time, on the move that leads there.

    Raises
    ------
    UnsupportedSceneError
        If the blade is outside the body then, or does not advance.
    """
    tips, moments, blades = np.array(cut.points, dtype=float), cut.moments, cut.blade
    move = min(max(int(np.searchsorted(moments, time)), 1), len(moments) - 1)
    lasts, way = float(moments[move] - moments[move - 1]), tips[move] - tips[move - 1]
    share = (time - moments[move - 1]) / lasts if lasts > 0.0 else 2.0
    length = float(np.linalg.norm(way))
    if not 0.0 <= share <= 1.0 + 1e-9 or length == 0.0:
        raise UnsupportedSceneError(f"the blade of '{cut.name}' does not advance at {time:.6g} s")
    blade = blades[move - 1] + share * (blades[move] - blades[move - 1])
    tip = tips[move - 1] + share * way
    along = tip + np.linspace(0.0, 1.0, _SAMPLES)[:, None] * blade
    inside = body.inside(along)
    if not inside.any():
        raise UnsupportedSceneError(f"the blade of '{cut.name}' is outside at {time:.6g} s")
    blade = blade / np.linalg.norm(blade)
    across = way - (way @ blade) * blade  # a blade that slides along itself cuts nothing
    speed = float(np.linalg.norm(across)) / lasts
    return BladeFront(along[inside].mean(axis=0), across / np.linalg.norm(across), blade, speed)
