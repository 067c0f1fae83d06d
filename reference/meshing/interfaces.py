"""Interfaces between the materials of a scene, where they are straight, circular or plane.

An inequality begins or ends where both sides of one of its comparisons are equal. Where that is a
line, a circle or a plane, its part inside the body at which the material changes is imprinted on
the reference's mesh: cells lie on either side of it. Other interfaces run through cells.
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reference.meshing.features import Feature
from verify.geometry.nearest import distance_to_outline
from verify.geometry.planar import inside_polygon
from verify.scene import Box, Polygon, Rectangle, Scene
from verify.scene.regions import Side, comparisons

Array = NDArray[np.float64]

_SAMPLES = 4097  # along a line or a circle: a part shorter than 1/4096 of it may be missed
_EXACT = 1e-9  # of the largest term: so well a line or a circle fits
_ASIDE = 1e-9  # of the body's size: where the material on either side is looked at
_SHORTEST = 1e-6  # of it: what gmsh resolves
_PROBES = 64


def plane_interfaces(scene: Scene) -> list[Feature]:
    """Return the straight and circular interfaces inside a rectangle or polygon.

    Arcs come in parts of less than half a turn.
    """
    if scene.material.is_uniform:
        return []
    assert isinstance(scene.geometry, Rectangle | Polygon)
    outline = scene.geometry.outline()
    lower, size = outline.min(axis=0), np.ptp(outline, axis=0)
    centre, reach = lower + 0.5 * size, float(np.linalg.norm(size))
    found: list[Feature] = []
    for k, (normal, offset, middle) in enumerate(_level_sets(scene, centre, reach)):
        name = f"interface {k}"
        if middle is None:
            foot = centre + (offset - normal @ centre) * normal
            along = np.array([-normal[1], normal[0]])
            curve = _line(foot - reach * along, 2 * reach * along)
        else:
            curve = _circle(middle, offset)
        for low, high in _changes(scene, curve, outline, reach):
            if middle is None:
                found.append(Feature(name, *curve(np.array([low, high]))))
            else:
                points = curve(np.linspace(low, high, 5))
                if (low, high) == (0.0, 1.0):
                    points[-1] = points[0]
                part = 2 * np.pi * (high - low) / 4
                found += [Feature(name, a, b, middle, offset, part) for a, b in pairwise(points)]
    return [one for one in found if one.length > _SHORTEST * reach]


def solid_interfaces(scene: Scene) -> list[Array]:
    """Plane interfaces of a box, each as the corners (4, 3) of a square that reaches beyond it."""
    if scene.material.is_uniform:
        return []
    assert isinstance(scene.geometry, Box)
    lower, upper = np.array(scene.geometry.lower), np.array(scene.geometry.upper)
    centre, reach = 0.5 * (lower + upper), float(np.linalg.norm(upper - lower))
    squares = []
    for normal, offset, middle in _level_sets(scene, centre, reach):
        if middle is not None:  # a sphere
            continue
        foot = centre + (offset - normal @ centre) * normal
        first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
        first /= np.linalg.norm(first)
        second = np.cross(normal, first)
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * reach
        square = foot + signs @ np.stack([first, second])
        share = np.linspace(-1.0, 1.0, 65) * reach
        grid = np.stack(np.meshgrid(share, share), axis=-1).reshape(-1, 2)
        points = foot + grid @ np.stack([first, second])
        inside = ((points > lower) & (points < upper)).all(axis=1)
        if _differs(scene, points[inside], normal, reach).any():
            squares.append(square)
    return squares


def _level_sets(
    scene: Scene, centre: Array, reach: float
) -> list[tuple[Array, float, Array | None]]:
    """Lines or planes (unit normal, offset, None), and circles (zeros, radius, centre)."""
    found: list[tuple[Array, float, Array | None]] = []
    for region in scene.material.regions:
        for left, right in comparisons(region.where, scene.dimension):
            one = _fitted(left, right, centre, reach)
            if one is not None and not any(_same(one, other, reach) for other in found):
                found.append(one)
    return found


def _fitted(
    left: Side, right: Side, centre: Array, reach: float
) -> tuple[Array, float, Array | None] | None:
    """Fit a line, plane, circle or sphere to where two sides are equal; None if none does."""
    d = len(centre)
    local = np.random.default_rng(7).uniform(-1.0, 1.0, (_PROBES, d))
    points = centre + reach * local
    a, b = left(points), right(points)
    basis = np.column_stack([np.ones(len(local)), local, np.sum(local**2, axis=1)])
    for values in (a - b, a**2 - b**2):  # of hypot(x, y) < r the squares are polynomials
        if not np.isfinite(values).all() or not np.abs(values).max() > 0:
            continue
        weights = np.linalg.lstsq(basis, values, rcond=None)[0]
        if np.abs(basis @ weights - values).max() > _EXACT * np.abs(values).max():
            continue
        slope, bend = weights[1:-1], weights[-1]
        if abs(bend) > _EXACT * np.abs(weights).max():
            middle = -slope / (2 * bend)
            squared = middle @ middle - weights[0] / bend
            return (
                (np.zeros(d), reach * np.sqrt(squared), centre + reach * middle)
                if (squared > 0)
                else None
            )
        steep = float(np.linalg.norm(slope))
        if steep > _EXACT * np.abs(weights).max():
            normal = slope / steep
            return normal, float(normal @ centre - reach * weights[0] / steep), None
    return None


def _same(
    one: tuple[Array, float, Array | None], other: tuple[Array, float, Array | None], reach: float
) -> bool:
    (n, offset, middle), (m, other_offset, other_middle) = one, other
    if (middle is None) != (other_middle is None):
        return False
    if middle is not None and other_middle is not None:
        apart = np.abs(middle - other_middle).max() + abs(offset - other_offset)
        return bool(apart < _EXACT * reach)
    sense = np.sign(n @ m)
    return bool(np.abs(n - sense * m).max() + abs(offset - sense * other_offset) / reach < _EXACT)


def _line(start: Array, along: Array) -> Callable[[Array], Array]:
    return lambda t: start + np.asarray(t)[:, None] * along


def _circle(centre: Array, radius: float) -> Callable[[Array], Array]:
    def point(t: Array) -> Array:
        angle = 2 * np.pi * np.asarray(t)
        return centre + radius * np.column_stack([np.cos(angle), np.sin(angle)])

    return point


def _changes(
    scene: Scene, curve: Callable[[Array], Array], outline: Array, reach: float
) -> list[tuple[float, float]]:
    """Parameters between which a curve lies inside the body and separates two materials."""

    def separates(t: Array) -> NDArray[np.bool_]:
        points = curve(t)
        step = curve(t + 1e-6) - points
        normal = np.column_stack([-step[:, 1], step[:, 0]])
        normal /= np.linalg.norm(normal, axis=1)[:, None]
        inside = inside_polygon(points, outline)
        inside &= distance_to_outline(points, outline) > 1e-12 * reach
        return inside & _differs(scene, points, normal, reach)

    t = np.linspace(0.0, 1.0, _SAMPLES)
    on = separates(t)
    stops = []
    for i in np.flatnonzero(on[1:] != on[:-1]):
        low, high = t[i], t[i + 1]
        while (middle := 0.5 * (low + high)) not in (low, high):
            low, high = (
                (middle, high) if separates(np.array([middle]))[0] == on[i] else (low, middle)
            )
        stops.append(float(high))
    bounds = [0.0] * bool(on[0]) + stops + [1.0] * bool(on[-1])
    return list(pairwise(bounds))[::2]


def _differs(scene: Scene, points: Array, normal: Array, reach: float) -> NDArray[np.bool_]:
    """Whether the material differs on either side of points (n, d) of an interface."""
    aside = _ASIDE * reach * normal
    number = scene.material.number_at
    return np.asarray(number(points + aside) != number(points - aside))
