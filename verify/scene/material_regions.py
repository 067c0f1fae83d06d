"""Checks of the regions of a scene's materials: they can be read, and lie in the body."""

import numpy as np
from numpy.typing import NDArray

from verify.geometry.planar import inside_polygon
from verify.scene.geometry import Box, Polygon, Rectangle
from verify.scene.regions import parse_region
from verify.scene.tables import SceneTables

Array = NDArray[np.float64]

_SAMPLES = 2**16  # of the body: a region of less than about 1e-4 of it may be missed
# steps of an additive recurrence that fills a square or a cube evenly (Roberts 2018)
_STEPS = {2: (0.75487766625, 0.56984029100), 3: (0.81917251340, 0.67104360670, 0.54970047790)}


def check_material_regions(scene: SceneTables) -> None:
    """Raise ValueError if a region cannot be read, is empty, or is alone in having a density."""
    for i, region in enumerate(scene.material.regions):
        place = f"material.regions[{i}]"
        try:
            parse_region(region.where, scene.dimension)
        except ValueError as error:
            raise ValueError(f"{place}.where: {error}") from None
        if region.density is not None and scene.material.density is None:
            raise ValueError(f"{place}.density: material.density is missing")
    if scene.material.regions:
        _check_not_empty(scene, points_of_body(scene))


def check_regions_of_mesh(scene: SceneTables, points: Array, cells: NDArray[np.int64]) -> None:
    """Raise ValueError if a region holds no centroid of the cells (m, k) of a given mesh."""
    if scene.material.regions:
        _check_not_empty(scene, points[cells].mean(axis=1))


def _check_not_empty(scene: SceneTables, points: Array) -> None:
    if not len(points):
        return
    found = np.bincount(scene.material.number_at(points), minlength=len(scene.material.each))
    for i, region in enumerate(scene.material.regions):
        if not found[i + 1]:
            raise ValueError(
                f"material.regions[{i}].where: no part of the body lies in '{region.where}' "
                "alone; of regions that overlap, the last one counts"
            )
    if not found[0]:
        raise ValueError("material.regions: they cover the body; [material] is that of no part")


def points_of_body(scene: SceneTables) -> Array:
    """Points (n, d) all over the body; none of a body that only its mesh file knows."""
    body, d = scene.geometry, scene.dimension
    if isinstance(body, Rectangle | Polygon):
        outline = body.outline()
        lower, upper = outline.min(axis=0), outline.max(axis=0)
    elif isinstance(body, Box):
        lower, upper = np.array(body.lower), np.array(body.upper)
    else:
        return np.zeros((0, d))
    share = np.mod(0.5 + np.outer(np.arange(1, _SAMPLES + 1), _STEPS[d]), 1.0)
    points: Array = lower + share * (upper - lower)
    return points[inside_polygon(points, outline)] if isinstance(body, Polygon) else points
