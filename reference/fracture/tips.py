"""The tips of the cuts of a plane scene, and how far a domain around each may reach."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reference.meshing.features import plane_features
from reference.meshing.grading import singular_points
from reference.meshing.interfaces import plane_interfaces
from verify.geometry.nearest import distance_to_outline
from verify.geometry.planar import inside_polygon
from verify.scene import ArcCut, Polygon, PolylineCut, Rectangle, Scene

Array = NDArray[np.float64]
End = Literal["start", "end"]
_ENDS: tuple[End, End] = ("start", "end")
_TOUCHING = 1e-9  # of the body: two points so close are one


@dataclass(frozen=True)
class Tip:
    """An end of a straight or circular part of a cut inside the body.

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
    nearest : str
        That feature, in words.
    arc : ArcCut, optional
        The cut, if it is an arc.
    """

    cut: str
    end: End
    point: Array
    direction: Array
    reach: float
    nearest: str
    arc: ArcCut | None = None

    def radii(self, count: int = 3) -> Array:
        """Radii (count,) of domains that stay clear of tip and next feature, m."""
        return np.asarray(self.reach * np.linspace(0.4, 0.8, count))


def tips(scene: Scene) -> list[Tip]:
    """Tips of the cuts of a plane scene: ends inside the body at which nothing else is met."""
    return [
        _tip(scene, cut, end)
        for cut in scene.final_cuts
        for end in _ENDS
        if isinstance(cut, ArcCut | PolylineCut) and no_tip(scene, cut.name, end) is None
    ]


def no_tip(scene: Scene, name: str, end: End) -> str | None:
    """Why an end of a cut of a plane scene is no tip, or None if it is one."""
    assert isinstance(scene.geometry, Rectangle | Polygon)
    cut = next(cut for cut in scene.final_cuts if cut.name == name)
    assert isinstance(cut, ArcCut | PolylineCut)
    vertices, outline = cut.vertices(), scene.geometry.outline()
    said = f"the {end} of cut '{name}' is no tip:"
    if np.array_equal(vertices[0], vertices[-1]):
        return f"{said} the cut is closed"
    point = _ends(cut)[_ENDS.index(end)]
    touching = _TOUCHING * float(np.ptp(outline, axis=0).max())
    if distance_to_outline(point[None], outline)[0] <= touching:
        return f"{said} it is on the boundary of the body"
    if not inside_polygon(point[None], outline)[0]:
        return f"{said} it is outside the body"
    ending, away = _features_around(scene, point)
    # where more than its own end ends, branches meet
    if ending > 1 or min(away)[0] <= touching:
        return f"{said} it meets another cut"
    if any(f.distance(point[None])[0] <= touching for f in plane_interfaces(scene)):
        return f"{said} it is on an interface between materials"
    return None


def _ends(cut: ArcCut | PolylineCut) -> Array:
    """Both ends (2, 2) of an open cut, m."""
    if isinstance(cut, PolylineCut):
        return cut.vertices()[[0, -1]]
    turned = np.deg2rad(cut.start + cut.sweep * np.array([0.0, 1.0]))
    return np.asarray(cut.centre) + cut.radius * np.column_stack([np.cos(turned), np.sin(turned)])


def _features_around(scene: Scene, point: Array) -> tuple[int, list[tuple[float, str]]]:
    """Count the features that end at a point, and give distances (m) and names of the others."""
    ending, away = 0, []
    for feature in plane_features(scene):
        if np.array_equal(point, feature.start) or np.array_equal(point, feature.end):
            ending += 1
        else:
            away.append((float(feature.distance(point[None])[0]), feature.name))
    return ending, away


def _tip(scene: Scene, cut: ArcCut | PolylineCut, end: End) -> Tip:
    """Make a tip of an end that is one."""
    assert isinstance(scene.geometry, Rectangle | Polygon)
    at = _ENDS.index(end)
    point = _ends(cut)[at]
    _, away = _features_around(scene, point)
    touching = _TOUCHING * float(np.ptp(scene.geometry.outline(), axis=0).max())
    singular = np.linalg.norm(singular_points(scene) - point, axis=1)
    own = f"the next kink or end of cut '{cut.name}'"  # whatever else is singular is on a feature
    away += [(float(one), own) for one in singular[singular > touching]]
    # the fields of the integral know no interface between materials
    interface = "an interface between materials"
    away += [(float(f.distance(point[None])[0]), interface) for f in plane_interfaces(scene)]
    before = cut.vertices()[[1, -2][at]]
    length = float(np.linalg.norm(point - before))
    if isinstance(cut, PolylineCut):
        away.append((length, own))
    # round-off does not tell whether a singular point is that of a feature
    reach, nearest = min(away, key=lambda one: one[0] * (1 + _TOUCHING * (one[1] == own)))
    if isinstance(cut, ArcCut):
        spoke = (point - np.asarray(cut.centre)) / cut.radius
        sign = 1.0 if end == "end" else -1.0
        ahead = sign * np.array([-spoke[1], spoke[0]])
        return Tip(cut.name, end, point, ahead, reach, nearest, cut)
    return Tip(cut.name, end, point, (point - before) / length, reach, nearest)
