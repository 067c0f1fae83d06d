"""Face and back of a hand cropped from the base mesh, each as a height over its own plane."""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter1d

from verify.errors import InputError
from verify.simulator.anatomy.base_mesh import BaseMesh
from verify.simulator.anatomy.surface_file import border_loops
from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.mesh import connected, neighbours_across

_POINTS = 400  # on a border
_SMOOTH = 6.0  # standard deviation along a border, in points of it
_HIDDEN = 1e-3  # m: a point that far under another layer of skin is not seen
_SLOPE = {"face": 0.2, "hand": 0.35}  # least cosine to the plane's normal


class Crop(NamedTuple):
    """Borders (k, 2) and seen points (n, 3) of a patch, m."""

    outline: Floats
    holes: list[Floats]
    samples: Floats


def crop_face(mesh: BaseMesh) -> Crop:
    """Skin of the face, openings at eyes and mouth: x to its left, y up, z forwards.

    Raises
    ------
    InputError
        If the crop is not one patch.
    """
    eyes = [mesh.places[f"joint-{side}-eye"] for side in "lr"]
    brow, chin = eyes[0][1], mesh.places["joint-jaw"][1]
    origin = np.array([0.0, 0.5 * (brow + chin) + 0.012, eyes[0][2] - 0.035])
    local = mesh.points - origin
    low, high = chin - origin[1] - 0.022, brow - origin[1] + 0.068
    x, y, _ = _middles(local, mesh.triangles).T
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    wanted = (np.abs(x) / 0.070) ** 3 + (np.abs(y - middle) / half) ** 3 < 1.0
    triangles = _patch(local, mesh.triangles, wanted, np.array([0.0, 0.0]), _SLOPE["face"])
    outline = _smooth(local[_longest(local, triangles), :2])
    holes = [_eye_opening(mesh.eye - origin, side) for side in (1.0, -1.0)]
    # the lips meet where the teeth do; `joint-mouth` is the hinge
    upper, lower = (mesh.places[f"helper-{row}-teeth"][1] for row in ("upper", "lower"))
    bite = 0.3 * upper + 0.7 * lower - origin[1]
    holes.append(_lens(np.array([0.0, bite]), 0.021, 0.0018))
    return Crop(outline, holes, _seen(local, mesh.triangles, triangles))


def crop_hand(mesh: BaseMesh) -> Crop:
    """Skin of the back of the left hand: x to the thumb, y along the fingers, z outwards.

    Raises
    ------
    InputError
        If the crop is not one patch.
    """
    wrist = mesh.places["joint-l-hand"]
    knuckles = np.array([mesh.places[f"joint-l-finger-{k}-1"] for k in (2, 3, 4, 5)])
    along = knuckles[1:3].mean(axis=0) - wrist
    length = float(np.linalg.norm(along))
    y_axis = along / length
    across = knuckles[0] - knuckles[3]
    x_axis = across - (across @ y_axis) * y_axis
    x_axis /= np.linalg.norm(x_axis)
    frame = np.stack([x_axis, y_axis, np.cross(x_axis, y_axis)], axis=1)
    local = (mesh.points - (wrist + 0.55 * along)) @ frame
    x, y, _ = _middles(local, mesh.triangles).T
    roots = (knuckles - (wrist + 0.55 * along)) @ frame
    reach = np.interp(x, roots[::-1, 0], roots[::-1, 1]) + 0.012
    wanted = (y > -0.55 * length - 0.004) & (y < reach) & (np.abs(x) < 0.06)
    triangles = _patch(local, mesh.triangles, wanted, np.zeros(2), _SLOPE["hand"])
    outline = _smooth(local[_longest(local, triangles), :2])
    samples = _seen(local, mesh.triangles, triangles)
    samples[:, 2] -= samples[:, 2].min()
    return Crop(outline, [], samples)


def _middles(points: Floats, triangles: Ints) -> Floats:
    return points[triangles].mean(axis=1)


def _normals(points: Floats, triangles: Ints) -> Floats:
    corners = points[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return area / np.maximum(np.linalg.norm(area, axis=1, keepdims=True), 1e-300)


def _patch(points: Floats, triangles: Ints, wanted: Bools, seed: Floats, slope: float) -> Ints:
    """Find the connected triangles that face upwards, around the highest one over the seed."""
    wanted = wanted & (_normals(points, triangles)[:, 2] > slope)
    chosen = triangles[wanted]
    if len(chosen) == 0:
        raise InputError("nothing of the base mesh lies where the patch should be")
    across = neighbours_across(chosen)
    one, edge = np.nonzero(across >= 0)
    label = connected(len(chosen), one, across[one, edge])
    middles = _middles(points, chosen)
    near = np.linalg.norm(middles[:, :2] - seed, axis=1)
    close = np.flatnonzero(near <= near.min() + 0.005)
    start = close[np.argmax(middles[close, 2])]
    return chosen[label == label[start]]


def _longest(points: Floats, triangles: Ints) -> Ints:
    loops = border_loops(triangles)
    lengths = [np.linalg.norm(np.diff(points[loop, :2], axis=0), axis=1).sum() for loop in loops]
    return loops[int(np.argmax(lengths))]


def _smooth(ring: Floats) -> Floats:
    """Resample a border evenly and smooth it: triangles of the base mesh make it ragged."""
    closed = np.concatenate([ring, ring[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    places = np.arange(_POINTS) * along[-1] / _POINTS
    even = np.column_stack([np.interp(places, along, closed[:, axis]) for axis in range(2)])
    return gaussian_filter1d(even, _SMOOTH, axis=0, mode="wrap")


def _eye_opening(eye: Floats, side: float) -> Floats:
    low, high = eye[:, :2].min(axis=0), eye[:, :2].max(axis=0)
    centre, half = 0.5 * (low + high), 0.5 * (high - low)
    # lids cover the upper and the lower third of the ball
    return _lens(centre * [side, 1.0], 1.0 * half[0], 0.36 * half[1])


def _lens(centre: Floats, half_length: float, half_height: float) -> Floats:
    turn = np.linspace(0.0, 2.0 * np.pi, _POINTS // 4, endpoint=False)
    rise = np.sin(turn) * np.abs(np.sin(turn)) ** 0.5
    return centre + np.column_stack([half_length * np.cos(turn), half_height * rise])


def _seen(points: Floats, body: Ints, patch: Ints) -> Floats:
    """Points of the patch that no other layer of skin covers."""
    own = points[np.unique(patch)]
    low, high = own.min(axis=0), own.max(axis=0)
    corners = points[body]
    near = (corners.max(axis=1)[:, :2] >= low[:2]).all(axis=1)
    near &= (corners.min(axis=1)[:, :2] <= high[:2]).all(axis=1)
    near &= corners[:, :, 2].max(axis=1) >= low[2]
    covered = np.zeros(len(own), dtype=bool)
    for triangle in corners[near]:
        covered |= _is_under(own, triangle)
    return own[~covered]


def _is_under(points: Floats, triangle: Floats) -> Bools:
    a, b, c = triangle[:, :2]
    whole = _cross(b - a, c - a)
    if whole == 0.0:
        return np.zeros(len(points), dtype=bool)
    place = points[:, :2]
    first, second = _cross(b - place, c - place) / whole, _cross(c - place, a - place) / whole
    third = 1.0 - first - second
    height = first * triangle[0, 2] + second * triangle[1, 2] + third * triangle[2, 2]
    over = (first >= 0.0) & (second >= 0.0) & (third >= 0.0)
    under: Bools = over & (height > points[:, 2] + _HIDDEN)
    return under


def _cross(a: Floats, b: Floats) -> Floats:
    result: Floats = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return result
