"""Random scenes in space: a cube cut by a plane, or a ball at a corner of it."""

import numpy as np

from verify.study.calibration.plane_scenes import Content, Random, scene_of


def solid_smooth(random: Random) -> Content:
    """Return sinusoids with a body force on both sides of a plane through the unit cube."""
    point, normal = random.uniform(0.4, 0.6, 3), random.normal(size=3)
    normal /= np.linalg.norm(normal)
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    corners = [
        point + 2.0 * (s * first + t * second) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    above, below = (
        np.column_stack([
            random.uniform(0.03, 0.1, 3) * random.choice([-1.0, 1.0], 3),
            random.uniform(-2.0, 2.0, (3, 2)),
            random.uniform(-180.0, 180.0, 3),
        ]).tolist()
        for _ in "ab"
    )  # fmt: skip
    while True:
        at = random.uniform(0.15, 0.85, 3)
        if abs(float((at - point) @ normal)) > 0.05:
            break
    parameters = {
        "point": point.tolist(), "normal": normal.tolist(), "axis": first.tolist(),
        "above": above, "below": below,
    }  # fmt: skip
    cut = {"kind": "polygon", "points": [corner.tolist() for corner in corners]}
    scene = _scene(random, ("solid_smooth", parameters), cut, at, point)
    return {**scene, "loads": [{"kind": "body_force", "force": "exact"}]}


def ball_and_shell(random: Random) -> Content:
    """Return a ball at rest, at a corner of the unit cube, in a shell that is drawn off it."""
    centre, radius = random.uniform(-0.1, 0.1, 3), float(random.uniform(0.5, 0.7))
    place = {"centre": centre.tolist(), "radius": radius}
    parameters = {**place, "outward": float(random.uniform(0.05, 0.15)), "at": 1.0}
    towards = random.uniform(0.4, 1.0, 3)
    opened = centre + radius * towards / np.linalg.norm(towards)
    # facets of the sphere that places are checked against have a corner at its pole
    cut = {"kind": "sphere", **place, "towards": towards.tolist()}
    at = random.uniform(0.65, 0.9, 3)
    return _scene(random, ("spherical_cut", parameters), cut, at, opened)


def _scene(
    random: Random, exact: tuple[str, Content], cut: Content, at: np.ndarray, opened: np.ndarray
) -> Content:
    cube = {"kind": "box", "lower": [0.0] * 3, "upper": [1.0] * 3}
    opening = {"kind": "opening", "name": "opening", "point": opened.tolist()}
    material = {"poisson": float(random.uniform(0.0, 0.45))}
    return scene_of(cube, [3, 3, 3], exact, cut, material, opening, at.tolist())
