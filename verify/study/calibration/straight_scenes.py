"""Random scenes with one straight cut: through the body, with a tip, or with two."""

import numpy as np

from verify.study.calibration.scene_parts import Content, Random, around, intensities, plane_scene

_UNIT = {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0]}
_LONG = 3.0  # of a cut that goes on beyond a unit square


def airy(random: Random) -> Content:
    """Return fields without body force on both sides of a cut through a square."""
    above, below = (
        [*random.uniform(-0.3, 0.3, 2).tolist(), float(random.uniform(1.0, 3.5))] for _ in "ab"
    )
    return _through(random, "airy", {"above": above, "below": below})


def smooth(random: Random) -> Content:
    """Return sinusoids with a body force on both sides of a cut through a square."""
    above, below = (
        np.column_stack([
            random.uniform(0.03, 0.1, 2) * random.choice([-1.0, 1.0], 2),
            random.uniform(2.0, 6.0, 2),
            random.uniform(-180.0, 180.0, 2),
        ]).tolist()
        for _ in "ab"
    )  # fmt: skip
    scene = _through(random, "smooth", {"above": above, "below": below})
    return {**scene, "loads": [{"kind": "body_force", "force": "exact"}]}


def tip(random: Random) -> Content:
    """Return a cut from the boundary of a square to a tip in it, in any mixed mode."""
    at, angle = random.uniform(-0.3, 0.3, 2), float(random.uniform(-180.0, 180.0))
    intensity = [float(random.uniform(0.3, 1.0)), float(random.uniform(-1.0, 1.0))]
    along = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    cut = {"kind": "polyline", "points": [(at - _LONG * along).tolist(), at.tolist()]}
    parameters = {"tip": at.tolist(), "angle": angle, "intensity": intensity}
    opened = 1.0 - float(random.uniform(0.15, 0.5)) / _LONG
    scene = plane_scene(random, around(np.zeros(2), 1.0), ("tip", parameters), cut, opened)
    return {**scene, "quantities": scene["quantities"] + intensities(("end",))}


def griffith(random: Random) -> Content:
    """Return a crack inside a square, under a remote stress that opens it."""
    centre, angle = random.uniform(-0.3, 0.3, 2), float(random.uniform(-90.0, 90.0))
    a, along = (
        float(random.uniform(0.6, 1.1)),
        np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))]),
    )
    axes = np.array([along, [-along[1], along[0]]])
    shear = float(random.uniform(-0.7, 0.7))
    local = np.array([[float(random.uniform(-0.5, 1.0)), shear], [shear, 1.0]])
    stress = axes.T @ local @ axes
    parameters = {
        "centre": centre.tolist(), "a": a, "angle": angle,
        "stress": [float(stress[0, 0]), float(stress[1, 1]), float(stress[0, 1])],
    }  # fmt: skip
    ends = [(centre - a * along).tolist(), (centre + a * along).tolist()]
    cut, at = {"kind": "polyline", "points": ends}, float(random.uniform(0.2, 0.8))
    scene = plane_scene(random, around(np.zeros(2), 2.0), ("griffith", parameters), cut, at)
    return {**scene, "quantities": scene["quantities"] + intensities(("start", "end"))}


def _through(random: Random, name: str, sides: Content) -> Content:
    """Return a cut through the unit square at any angle."""
    point, angle = random.uniform(0.35, 0.65, 2), float(random.uniform(-90.0, 90.0))
    along = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    reach = 0.5 * _LONG * along
    cut = {"kind": "polyline", "points": [(point - reach).tolist(), (point + reach).tolist()]}
    parameters = {"point": point.tolist(), "angle": angle, **sides}
    at = 0.5 + float(random.uniform(-0.25, 0.25)) / _LONG
    return plane_scene(random, _UNIT, (name, parameters), cut, at)
