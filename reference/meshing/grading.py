"""Element sizes: uniform, or graded to the singular points of the scene."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.scene import ArcCut, Polygon, PolylineCut, Rectangle, Scene
from verify.scene.planar import distance_to_outline, inside_polygon
from verify.scene.regions import parse_region

__all__ = ["Grading", "singular_points"]

Array = NDArray[np.float64]
_SMALLEST = 1e-6  # of the grading radius: below it the tip's energy is beyond double precision


@dataclass(frozen=True)
class Grading:
    """Element size h(r) = size · min(1, (r/radius)^exponent) around singular points.

    With exponent 0.8 quadratic elements reach their full order at a crack tip (h ∝ r^β with
    β > 1 − λ/p, λ = ½, p = 2). The smallest size is where h(r) = r.

    Parameters
    ----------
    size : float
        Element size away from the points, m.
    points : (k, 2) array
        Singular points; none gives a uniform mesh.
    radius : float
        Distance at which the grading starts, m.
    exponent : float
        β.
    """

    size: float
    points: Array
    radius: float = 1.0
    exponent: float = 0.8

    @property
    def smallest(self) -> float:
        """Element size at a singular point, m."""
        ratio = min(self.size / self.radius, 1.0)
        return float(self.radius * max(ratio ** (1 / (1 - self.exponent)), _SMALLEST))

    def halved(self, level: int) -> "Grading":
        """The same grading with all sizes divided by 2^level."""
        return Grading(self.size / 2**level, self.points, self.radius, self.exponent)


def singular_points(scene: Scene) -> Array:
    """Points (k, 2) where the gradient of the solution may be unbounded.

    Tips, kinks, junctions and crossings of cuts; corners of the body at which a clamped part
    of the boundary ends, and re-entrant corners. None of the body's corners where the supports
    prescribe an exact field, which is smooth there.
    """
    geometry = scene.geometry
    assert isinstance(geometry, Rectangle | Polygon)
    outline = geometry.outline()
    found = [_tips_and_kinks(cut, outline) for cut in scene.cuts]
    found.append(_crossings([c for c in scene.cuts if isinstance(c, PolylineCut)]))
    if not any(support.displacement == "exact" for support in scene.supports):
        found.append(_corners(scene, outline))
    points = np.concatenate([f.reshape(-1, 2) for f in found])
    scale = float(np.ptp(outline, axis=0).max())
    return np.unique(np.round(points / scale, 12), axis=0) * scale if len(points) else points


def _tips_and_kinks(cut: object, outline: Array) -> Array:
    if isinstance(cut, ArcCut):
        if cut.sweep == 360.0:
            return np.zeros((0, 2))
        candidates = cut.vertices()[[0, -1]]
    else:
        assert isinstance(cut, PolylineCut)
        candidates = cut.vertices()
        if np.array_equal(candidates[0], candidates[-1]):
            candidates = candidates[:-1]
    scale = float(np.ptp(outline, axis=0).max())
    inner = inside_polygon(candidates, outline) & (
        distance_to_outline(candidates, outline) > 1e-9 * scale
    )
    return candidates[inner]


def _crossings(cuts: list[PolylineCut]) -> Array:
    found = []
    for i, first in enumerate(cuts):
        for second in cuts[i + 1 :]:
            p, q = first.vertices(), second.vertices()
            for a, b in zip(p, p[1:], strict=False):
                for c, d in zip(q, q[1:], strict=False):
                    u, v = b - a, d - c
                    det = u[0] * v[1] - u[1] * v[0]
                    if abs(det) < 1e-14 * np.hypot(*u) * np.hypot(*v):
                        continue
                    s = ((c - a)[0] * v[1] - (c - a)[1] * v[0]) / det
                    t = ((c - a)[0] * u[1] - (c - a)[1] * u[0]) / det
                    if -1e-9 <= s <= 1 + 1e-9 and -1e-9 <= t <= 1 + 1e-9:
                        found.append(a + s * u)
    return np.array(found).reshape(-1, 2)


def _corners(scene: Scene, outline: Array) -> Array:
    """Corners between a held and a free edge, and re-entrant ones."""
    geometry = scene.geometry
    names = geometry.parts()
    middle = 0.5 * (outline + np.roll(outline, -1, axis=0))
    held = np.zeros(len(outline), dtype=bool)
    for support in scene.supports:
        if support.where == "boundary":
            held[:] = True
        elif support.where in names:
            held |= np.array(names) == support.where
        else:
            held |= parse_region(support.where, 2)(middle)
    following = np.roll(outline, -1, axis=0) - outline
    before = np.roll(following, 1, axis=0)
    turn = before[:, 0] * following[:, 1] - before[:, 1] * following[:, 0]
    orientation = _orientation(outline)
    return outline[(held != np.roll(held, 1)) | (turn * orientation < 0)]


def _orientation(outline: Array) -> float:
    x, y = outline.T
    return float(np.sign(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))
