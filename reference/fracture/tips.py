"""The tips of the cuts of a plane scene, and how far a domain around each may reach."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reference.meshing.features import plane_features
from reference.meshing.grading import singular_points
from verify.scene import Polygon, PolylineCut, Rectangle, Scene
from verify.scene.planar import inside_polygon

__all__ = ["Tip", "tips"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tip:
    """An end of a straight part of a cut inside the body.

    Attributes
    ----------
    cut : str
    end : {"start", "end"}
        Which end of the cut.
    point : (2,) array
        m.
    direction : (2,) array
        Unit vector in which the cut would go on.
    reach : float
        Distance to the next feature that a domain must not meet, m.
    """

    cut: str
    end: Literal["start", "end"]
    point: Array
    direction: Array
    reach: float

    def radii(self, count: int = 3) -> Array:
        """Radii (count,) of domains that stay clear of tip and next feature, m."""
        return np.asarray(self.reach * np.linspace(0.4, 0.8, count))


def tips(scene: Scene) -> list[Tip]:
    """Tips of the polyline cuts of a plane scene; tips of arcs are not straight and left out."""
    assert isinstance(scene.geometry, Rectangle | Polygon)
    found = []
    for cut in scene.cuts:
        if not isinstance(cut, PolylineCut):
            continue
        vertices = cut.vertices()
        if not np.array_equal(vertices[0], vertices[-1]):
            found.append(_tip(scene, cut.name, "start", vertices[0], vertices[1]))
            found.append(_tip(scene, cut.name, "end", vertices[-1], vertices[-2]))
    return [tip for tip in found if tip is not None]


def _tip(
    scene: Scene, cut: str, end: Literal["start", "end"], point: Array, before: Array
) -> Tip | None:
    """Make a tip of an end of a cut, unless it is a mouth, lies outside or is a junction."""
    assert isinstance(scene.geometry, Rectangle | Polygon)
    outline = scene.geometry.outline()
    touching = 1e-9 * float(np.ptp(outline, axis=0).max())
    ending, away = 0, []
    for feature in plane_features(scene):
        if np.array_equal(point, feature.start) or np.array_equal(point, feature.end):
            ending += 1
        else:
            away.append(float(feature.distance(point[None])[0]))
    # where more than its own end ends, branches meet
    junction = ending > 1 or min(away) <= touching
    if junction or not inside_polygon(point[None], outline)[0]:
        return None
    singular = np.linalg.norm(singular_points(scene) - point, axis=1)
    length = float(np.linalg.norm(point - before))
    reach = min([*away, *singular[singular > touching].tolist(), length])
    return Tip(cut, end, point, (point - before) / length, reach)
