"""Parts of the fronts of cuts in space that domains of an integral fit around."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.fracture.front import CircularFront, Front, StraightFront
from verify.errors import InputError
from verify.scene import Box, DiscCut, PolygonCut, Scene
from verify.scene.acceptance import StressIntensityQuantity
from verify.scene.cuts import distance_to_cuts

Array = NDArray[np.float64]
# Radii of the domains, of the reach: a straight front has no axis that they must stay away from.
_ROUND, _STRAIGHT = (0.5, 0.65, 0.8), (0.6, 0.75, 0.9)
_AROUND = 64  # places on the front from which distances are taken
_STATIONS = (12, 3)  # hats of 30 degrees along a round front; along a straight one
# Of the way to the nearer end of a straight front: where it meets a wall at an angle, a domain
# that went all the way would leave the body on one side.
_WAY = 0.75


def front_at(scene: Scene, asked: StressIntensityQuantity) -> tuple[Front, Array]:
    """Give the front around a point at which a factor is asked for, and radii of domains, m.

    A straight front is the part of it that hats at the point lie on. The radii are 0 where the
    front meets something.
    """
    cut = _cut(scene, asked)
    assert isinstance(scene.geometry, Box)
    reach, point = front_reach(scene, asked), np.asarray(asked.point, dtype=float)
    if isinstance(cut, PolygonCut):
        box = np.array([scene.geometry.lower, scene.geometry.upper], dtype=float)
        return StraightFront(*_straight_part(cut, point, box)), reach * np.array(_STRAIGHT)
    spoke, radius = point - np.asarray(cut.centre), float(cut.radius or 0.0)
    front = CircularFront(cut.centre, cut.normal, radius, towards=spoke)
    return front, reach * np.array(_ROUND)


def station_count(front: Front) -> int:
    """Return the number of hats along a front that give the factor at a point of it."""
    return _STATIONS[0] if front.closed else _STATIONS[1]


def station_spacing(front: Front) -> float:
    """Distance of neighbouring hats, m; nodes farther apart leave one of them without a node."""
    return front.length / (station_count(front) + (0 if front.closed else 1))


def front_reach(scene: Scene, asked: StressIntensityQuantity) -> float:
    """Distance (m) from a front to what a domain must not meet; 0 if it meets it.

    Of a round front all of it counts; of a straight one what of it the hats at a point lie on.
    """
    cut = _cut(scene, asked)
    assert isinstance(scene.geometry, Box)
    lower, upper = np.asarray(scene.geometry.lower), np.asarray(scene.geometry.upper)
    others = [one for one in scene.final_cuts if one.name != asked.cut]
    if isinstance(cut, PolygonCut):
        return _straight_reach(cut, np.asarray(asked.point), np.array([lower, upper]), others)
    turn = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    first, second, _ = cut.axes()
    spokes = np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second)
    front = np.asarray(cut.centre) + (cut.radius or 0.0) * spokes
    walls = np.concatenate([front - lower, upper - front], axis=1)
    away = distance_to_cuts(others, front).min(initial=np.inf)
    # between two of these places the front may meet what is nearer than half their distance
    met = float(np.pi * (cut.radius or 0.0) / _AROUND)
    reach = min(float(cut.radius or 0.0), float(walls.min()), float(away))
    return reach if reach > met else 0.0


def _straight_part(cut: PolygonCut, point: Array, box: Array) -> tuple[Array, Array, Array]:
    """Give both ends (3,) of a part of an edge around a point, and the way ahead (3,).

    It ends short of where the edge does or leaves the box, whichever is nearer, and runs along
    ahead × normal: what is up, seen from it, is the positive side.
    """
    start, end = cut.edge_of(point)
    along = (end - start) / np.linalg.norm(end - start)
    place = start + ((point - start) @ along) * along
    half = min(np.linalg.norm(end - place), np.linalg.norm(place - start))
    for axis in np.flatnonzero(np.abs(along) > 0.0):
        ways = (box[:, axis] - place[axis]) / along[axis]
        half = min(half, *np.abs(ways))
    half *= _WAY
    ahead = np.cross(along, cut.normal)  # the inside is on the left of its edges
    return place + half * along, place - half * along, ahead


def _straight_reach(cut: PolygonCut, point: Array, box: Array, others: list[Any]) -> float:
    """Radius (m) of the cylinder around the part of a straight front that meets nothing else."""
    start, end, _ = _straight_part(cut, point, box)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length if length > 0.0 else np.zeros(3)
    walls = np.concatenate([np.minimum(start, end) - box[0], box[1] - np.maximum(start, end)])
    beside = np.tile(np.sqrt(np.maximum(1.0 - along**2, 0.0)), 2)
    slack = 1e-9 * float(np.linalg.norm(box[1] - box[0]))
    if length <= slack or walls.min() < -slack:
        return 0.0
    steep = beside > 1e-9
    reach = float((walls[steep] / beside[steep]).min(initial=np.inf))
    share = np.linspace(0.0, 1.0, _AROUND)[:, None]
    front = start + share * (end - start)
    reach = min(reach, float(distance_to_cuts(others, front).min(initial=np.inf)))
    corners = np.array(cut.points, dtype=float)
    edges = corners + share[:, None] * (np.roll(corners, -1, axis=0) - corners)
    off = edges.reshape(-1, 3) - start
    at = off @ along
    away = np.linalg.norm(off - at[:, None] * along, axis=1)
    beside_it = (at >= 0.0) & (at <= length) & (away > slack)  # the others than its own
    reach = min(reach, float(away[beside_it].min(initial=np.inf)))
    # between two of these places the front may meet what is nearer than half their distance
    return reach if reach > 0.5 * length / (_AROUND - 1) else 0.0


def _cut(scene: Scene, asked: StressIntensityQuantity) -> DiscCut | PolygonCut:
    cut = next(cut for cut in scene.final_cuts if cut.name == asked.cut)
    if not isinstance(cut, DiscCut | PolygonCut):
        raise InputError(f"cut '{asked.cut}' is neither a disc nor a polygon")
    return cut
