"""Stress-intensity factors at a point of the front of a plane crack in space, round or straight."""

from typing import Any

from verify.scene import Box, Material, Scene
from verify.scene.acceptance import StressIntensityQuantity
from verify.solution import Solution


def front_defect(scene: Scene, asked: StressIntensityQuantity) -> str | None:
    """Why a factor at a front cannot be had from any solution of a scene, or None."""
    if not isinstance(scene.geometry, Box):
        return "factors along a front are measured in boxes"
    from reference.fracture import front_reach

    if not front_reach(scene, asked) > 0.0:
        return f"the front of cut '{asked.cut}' leaves the body or meets another cut"
    return None


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
    order of the hat's width. At a straight front the hats reach to its nearer end.

    Raises
    ------
    InputError
        If the mesh is too coarse for the domains.
    """
    from reference.fracture import front_at, front_intensity, station_count

    front, radii = front_at(scene, asked)
    middle = 0 if front.closed else 1
    found = front_intensity(
        solution, material, front, radii, stations=station_count(front), fitted=False, **moving
    ).modes
    around = found[middle - 1] - 2.0 * found[middle] + found[middle + 1]
    k_1, k_2, k_3 = found[middle] - around / 12.0
    return float(k_1), float(k_2), float(k_3)
