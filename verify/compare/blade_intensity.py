"""Stress-intensity factor of mode III at the blade of a tool path, at a time."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody
from verify.compare.cut_profile import cut_place
from verify.compare.cut_rule import CutRule
from verify.compare.error_norm import displacement_jump
from verify.compare.locate import Field
from verify.compare.motion import Motion
from verify.compare.solid import SolidBody
from verify.errors import UnsupportedSceneError
from verify.scene import Material, Scene, ToolPathCut
from verify.scene.acceptance import StressIntensityQuantity

Array = NDArray[np.float64]
_NEAREST, _PLACES = 0.25, 12  # first place over the radius, number of places


@dataclass(frozen=True)
class BladeFront:
    """A straight front in space at an instant.

    Parameters
    ----------
    point : (3,) array
        In the middle of what of it lies in the body, m.
    ahead : (3,) array
        Unit vector of its advance.
    blade : (3,) array
        Unit vector along it; the positive side of the cut is that of ahead × blade.
    speed : float
        m/s.
    """

    point: Array
    ahead: Array
    blade: Array
    speed: float

    @property
    def along(self) -> Array:
        """Third axis: K_III is positive where the positive face slides along it."""
        return np.cross(self.ahead, np.cross(self.ahead, self.blade))


def tearing_intensity(
    field: Field, body: AnyBody, cut: str, front: BladeFront, radius: float, material: Material
) -> float:
    """K_III in Pa √m by displacement correlation, extrapolated to the front.

    Near a front that advances at v the jump is (4 K/(μ g)) √(r/2π) (1 + k r), g² = 1 − ρv²/μ, with
    r the distance behind it. K and k are fitted by least squares at places from a quarter of the
    radius to the radius, evenly spaced in √r.

    Parameters
    ----------
    field : Field
        At that time.
    body : Body or SolidBody
    cut : str
        Its name.
    front : BladeFront
    radius : float
        m; within it the cut is plane and open, and nothing else disturbs the field.
    material : Material
        With a density, if the front moves.
    """
    root = np.linspace(np.sqrt(_NEAREST * radius), np.sqrt(radius), _PLACES)
    places = [cut_place(body, cut, (front.point - r * front.ahead).tolist()) for r in root**2]
    rule = CutRule.joined(places, 3)
    jump = displacement_jump(field, rule) @ front.along
    columns = np.column_stack([root, root**3])
    first = np.linalg.lstsq(columns, jump, rcond=None)[0][0]
    shear = material.young / (2 * (1 + material.poisson))
    contraction = np.sqrt(1.0 - front.speed**2 * (material.density or 0.0) / shear)
    return float(first * shear * contraction * np.sqrt(2 * np.pi) / 4)


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
