"""A face and the back of a hand made by formulas, for scenes that need no real anatomy.

Plausible proportions of an adult, not of anybody: sums of smooth bumps on a rounded base. All
coordinates in millimetres inside this file, metres outside.
"""

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from verify.simulator.anatomy.plane_mesh import Patch
from verify.xfem.arrays import Floats

_MM = 1e-3
_POINTS = 400  # on a border, far more than any mesh resolves

# height, x, y, width in x, width in y of each bump; mirrored ones stand for both sides
_FACE_MIRRORED = [
    (4.0, 30.0, 45.0, 17.0, 7.0),  # brow
    (-9.0, 31.0, 27.0, 15.0, 11.0),  # socket
    (4.0, 31.0, 26.0, 13.0, 7.0),  # eyeball under the lids
    (5.0, 44.0, 4.0, 16.0, 16.0),  # cheekbone
    (8.0, 11.0, -12.0, 6.0, 6.0),  # wing of the nose
    (-3.5, 38.0, -38.0, 12.0, 18.0),  # hollow of the cheek
]
_FACE_MIDDLE = [
    (5.5, 0.0, -39.5, 20.0, 4.0),  # upper lip
    (6.0, 0.0, -51.0, 18.0, 4.5),  # lower lip
    (-2.5, 0.0, -61.0, 20.0, 5.0),  # fold above the chin
    (9.0, 0.0, -78.0, 17.0, 11.0),  # chin
    (-1.8, 0.0, -30.0, 3.5, 6.0),  # philtrum
]
# left hand from behind: wrist, little finger to index finger, thumb
_HAND_BORDER = [
    (-27, -52), (-36, -35), (-41, -10), (-43, 15), (-45, 32), (-46, 44), (-40, 51), (-31, 50),
    (-25.5, 42), (-22, 50), (-19, 60), (-10.5, 63), (-4, 58), (-1, 46), (2, 57), (7, 65),
    (15, 65), (20, 58), (22, 45), (26, 55), (32, 60), (40, 57), (45, 48), (46, 35), (46, 18),
    (51, 5), (59, -6), (60, -18), (51, -25), (41, -33), (33, -43), (28, -52), (15, -55), (0, -56),
    (-14, -55),
]  # fmt: skip
_KNUCKLES = [(-33, 33), (-12, 41), (11, 43), (34, 38)]


def procedural_face() -> Patch:
    """Skin of a face, 150 mm wide, 205 mm high, with openings for the eyes and the mouth."""
    holes = [_almond(side * 31.0, 26.5, 14.0, 5.0) for side in (1.0, -1.0)]
    holes.append(_almond(0.0, -45.0, 23.0, 2.2))
    return Patch(_egg() * _MM, _in_metres(_face_height), [hole * _MM for hole in holes])


def procedural_hand() -> Patch:
    """Skin of the back of a left hand up to the roots of the fingers, about 110 mm × 120 mm."""
    border = np.array(_HAND_BORDER, dtype=float)
    closed = np.concatenate([border, border[:1]])
    # clockwise as written down, for the eye to follow; the spline keeps the round of the fingers
    turns = np.arange(len(closed))
    spline = CubicSpline(turns, closed, bc_type="periodic")
    outline = spline(np.linspace(0.0, turns[-1], _POINTS, endpoint=False))[::-1]
    return Patch(outline * _MM, _in_metres(_hand_height))


def _in_metres(height: Callable[[Floats, Floats], Floats]) -> Callable[[Floats], Floats]:
    return lambda points: height(points[:, 0] / _MM, points[:, 1] / _MM) * _MM


def _egg() -> Floats:
    turn = np.linspace(0.0, 2.0 * np.pi, _POINTS, endpoint=False)
    y = -5.0 + 102.0 * np.sin(turn)
    # narrower at the chin than at the forehead
    x = (72.0 + 5.0 * np.sin(turn) - 4.0 * np.sin(turn) ** 2) * np.cos(turn)
    return np.column_stack([x, y])


def _almond(x: float, y: float, half_length: float, half_height: float) -> Floats:
    turn = np.linspace(0.0, 2.0 * np.pi, _POINTS // 4, endpoint=False)
    lens = np.sin(turn) * np.abs(np.sin(turn)) ** 0.5
    return np.column_stack([x + half_length * np.cos(turn), y + half_height * lens])


def _bump(x: Floats, y: Floats, bump: tuple[float, ...], side: float = 1.0) -> Floats:
    height, x0, y0, wx, wy = bump
    return height * np.exp(-(((x - side * x0) / wx) ** 2) - ((y - y0) / wy) ** 2)


def _face_height(x: Floats, y: Floats) -> Floats:
    base = 55.0 * (1.0 - (np.abs(x) / 92.0) ** 2.4) - 18.0 * (np.abs(y + 5.0) / 102.0) ** 2.5
    for bump in _FACE_MIRRORED:
        base = base + _bump(x, y, bump, 1.0) + _bump(x, y, bump, -1.0)
    for bump in _FACE_MIDDLE:
        base = base + _bump(x, y, bump)
    return base + _nose(x, y)


def _nose(x: Floats, y: Floats) -> Floats:
    """Ridge that rises from the root to the tip and falls off to the lip within a few mm."""
    root, tip, foot = 32.0, -9.0, -21.0
    rise = np.clip((root - y) / (root - tip), 0.0, 1.0) ** 1.3
    fall = np.clip((y - foot) / (tip - foot), 0.0, 1.0)
    along = np.where(y >= tip, rise, fall * fall * (3.0 - 2.0 * fall))
    width = 7.0 + 4.0 * rise
    return 21.0 * along * np.exp(-((x / width) ** 2))


def _hand_height(x: Floats, y: Floats) -> Floats:
    arch = 16.0 * (1.0 - (np.abs(x) / 62.0) ** 2.2) - 4.0 * ((y - 5.0) / 60.0) ** 2
    for x0, y0 in _KNUCKLES:
        arch = arch + _bump(x, y, (5.0, x0, y0, 8.5, 10.0))
        # the tendon that runs from the wrist to the knuckle
        share = np.clip((y + 50.0) / (y0 + 50.0), 0.0, 1.0)
        arch = arch + 1.3 * np.exp(-(((x - share * x0) / 3.5) ** 2)) * share * (y < y0)
        # fingers are round: between them the skin falls off to the web
        beyond = np.clip((y - y0 - 4.0) / 12.0, 0.0, 1.0)
        arch = arch - 2.5 * beyond * np.clip(np.abs(x - x0) / 11.0, 0.0, 1.0) ** 2 * (
            np.abs(x - x0) < 11.0
        )
    return arch
