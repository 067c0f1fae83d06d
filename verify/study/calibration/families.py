"""Scenes with an exact solution, on which the reference is made to judge itself."""

from dataclasses import dataclass
from math import cos, radians, sin
from typing import Any

from verify.scene import Scene

__all__ = ["Family", "families"]

_UNIT = {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0]}
_INCLINED = [[-0.1, 0.3], [1.1, 0.7]]
_FORCE = [{"kind": "body_force", "force": "exact"}]
_LINE = {"point": [0.5, 0.5], "slope": 1 / 3}
_FALLING = {"point": [0.5, 0.45], "slope": -0.25}
_DOWN = [[-0.2, 0.625], [1.2, 0.275]]


@dataclass(frozen=True)
class Family:
    """An exact solution, the element size of the coarsest reference level (m), and how many.

    Every three successive levels make a reference. `held_out` are those that no estimator was
    tuned on: other angles, stresses, places.
    """

    name: str
    degree: int
    size: float
    levels: int
    content: dict[str, Any]
    held_out: bool = False

    def scene(self) -> Scene:
        """Return the scene, judged by conforming levels as if there were no exact solution."""
        reference = {
            "kind": "conforming",
            "size": self.size,
            "levels": self.levels,
            "degree": self.degree,
        }
        return Scene.model_validate({**self.content, "reference": reference})


def families(quick: bool) -> list[Family]:
    """Return the scenes of the study; quick: fewer, and in the plane only."""
    found = [
        Family("airy", 1, 1 / 6, 4, _airy()),
        Family("airy", 2, 1 / 4, 4, _airy()),
        Family("smooth", 1, 1 / 6, 4, _smooth()),
        Family("smooth", 2, 1 / 4, 4, _smooth()),
        Family("tip", 2, 1 / 2, 4, _tip(0.0, (1.0, 0.0))),
    ]
    if quick:
        return found
    return [
        *found,
        Family("airy", 1, 1 / 5, 6, _airy()),
        Family("airy", 2, 1 / 3, 5, _airy()),
        Family("smooth", 1, 1 / 5, 6, _smooth()),
        Family("smooth", 2, 1 / 3, 5, _smooth()),
        Family("tip", 1, 1 / 3, 5, _tip(20.0, (1.0, 0.5))),
        Family("tip", 2, 1 / 3, 4, _tip(20.0, (1.0, 0.5))),
        Family("griffith", 1, 1 / 2, 4, _griffith()),
        Family("griffith", 2, 1 / 2, 4, _griffith()),
        Family("solid_smooth", 1, 1 / 3, 3, _solid_smooth()),
        Family("airy, falling", 1, 1 / 5, 5, _airy_falling(), held_out=True),
        Family("airy, falling", 2, 1 / 3, 4, _airy_falling(), held_out=True),
        Family("smooth, falling", 1, 1 / 4, 5, _smooth_falling(), held_out=True),
        Family("smooth, falling", 2, 1 / 4, 4, _smooth_falling(), held_out=True),
        Family("tip, both modes", 1, 1 / 4, 4, _tip(-35.0, (0.5, 1.0)), held_out=True),
        Family("tip, both modes", 2, 1 / 3, 4, _tip(-35.0, (0.5, 1.0)), held_out=True),
        Family("griffith, askew", 1, 1 / 2, 4, _griffith_askew(), held_out=True),
        Family("griffith, askew", 2, 1 / 2, 4, _griffith_askew(), held_out=True),
    ]


def _plane(
    title: str,
    exact: dict[str, Any],
    points: list[list[float]],
    at: float = 0.5,
    point: tuple[float, float] = (0.31, 0.83),
    **more: Any,
) -> dict[str, Any]:
    place = {"kind": "displacement", "point": list(point)}
    return {
        "title": title,
        "requirement": "The stated uncertainty of the reference shall cover its true error.",
        "geometry": _UNIT,
        "mesh": {"cells": [[8, 8]]},
        "material": {"young": 1.0, "poisson": 0.3, "plane": "strain"},
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "cuts": [{"kind": "polyline", "points": points}],
        "quantities": [
            {"kind": "strain_energy"},
            {"kind": "opening", "name": "opening", "at": at},
            {**place, "name": "u_x", "component": "x"},
            {**place, "name": "u_y", "component": "y"},
        ],
        "exact": exact,
        **more,
    }


def _airy() -> dict[str, Any]:
    parameters = {**_LINE, "above": [0.1, 0.2, 2.0], "below": [-0.2, 0.1, 3.0]}
    return _plane("airy", {"solution": "airy", "parameters": parameters}, _INCLINED)


def _smooth() -> dict[str, Any]:
    above = [[0.1, 3.14159, 0.0], [0.05, 3.14159, 90.0]]
    below = [[-0.05, 6.28319, 0.0], [-0.05, 6.28319, 90.0]]
    parameters = {**_LINE, "above": above, "below": below}
    exact = {"solution": "smooth", "parameters": parameters}
    return _plane("smooth", exact, _INCLINED, loads=_FORCE)


def _airy_falling() -> dict[str, Any]:
    parameters = {**_FALLING, "above": [0.1, -0.2, 2.5], "below": [0.15, 0.1, 1.5]}
    exact = {"solution": "airy", "parameters": parameters}
    return _plane("airy, falling", exact, _DOWN, at=0.37, point=(0.72, 0.21))


def _smooth_falling() -> dict[str, Any]:
    above = [[0.1, 4.0, 20.0], [0.05, 2.0, -50.0]]
    below = [[-0.05, 3.0, 10.0], [0.08, 5.0, 40.0]]
    exact = {"solution": "smooth", "parameters": {**_FALLING, "above": above, "below": below}}
    return _plane("smooth, falling", exact, _DOWN, at=0.64, point=(0.18, 0.27), loads=_FORCE)


def _tip(angle: float, intensity: tuple[float, float]) -> dict[str, Any]:
    away = [-2.0 * cos(radians(angle)), -2.0 * sin(radians(angle))]
    parameters = {"tip": [0.0, 0.0], "angle": angle, "intensity": list(intensity)}
    box = {"kind": "rectangle", "lower": [-1.0, -1.0], "upper": [1.0, 1.0]}
    exact = {"solution": "tip", "parameters": parameters}
    # the point at which the opening is taken must not lie on the boundary, where it is given
    return _plane(f"tip at {angle:g} degrees", exact, [away, [0.0, 0.0]], geometry=box, at=0.8)


def _griffith() -> dict[str, Any]:
    parameters = {"centre": [0.0, 0.0], "a": 1.0, "angle": 0.0, "stress": [0.0, 1.0, 0.0]}
    box = {"kind": "rectangle", "lower": [-2.0, -2.0], "upper": [2.0, 2.0]}
    exact = {"solution": "griffith", "parameters": parameters}
    return _plane("griffith", exact, [[-1.0, 0.0], [1.0, 0.0]], geometry=box)


def _griffith_askew() -> dict[str, Any]:
    centre, angle = (0.1, -0.2), 35.0
    half = (cos(radians(angle)), sin(radians(angle)))
    ends = [[m + sign * h for m, h in zip(centre, half, strict=True)] for sign in (-1, 1)]
    stress = [0.3, 1.0, 0.4]
    parameters = {"centre": list(centre), "a": 1.0, "angle": angle, "stress": stress}
    box = {"kind": "rectangle", "lower": [-2.0, -2.0], "upper": [2.0, 2.0]}
    exact = {"solution": "griffith", "parameters": parameters}
    return _plane("griffith, askew", exact, ends, at=0.37, point=(-0.9, 0.4), geometry=box)


def _solid_smooth() -> dict[str, Any]:
    parameters = {
        "point": [0.5, 0.5, 0.5],
        "normal": [-1.0, -2.0, 3.0],
        "axis": [2.0, -1.0, 0.0],
        "above": [[0.1, 2.0, 1.0, 10.0], [0.05, 1.0, -2.0, 40.0], [0.03, 1.5, 1.0, 70.0]],
        "below": [[-0.05, 1.0, 2.0, 20.0], [0.04, -2.0, 1.0, 0.0], [-0.02, 1.0, -1.0, 50.0]],
    }
    polygon = [[-0.1, -0.1, -0.1], [1.1, -0.1, 0.3], [1.1, 1.1, 1.1], [-0.1, 1.1, 0.7]]
    point = {"kind": "displacement", "point": [0.31, 0.17, 0.83]}
    return {
        **_plane("solid_smooth", {"solution": "solid_smooth", "parameters": parameters}, []),
        "geometry": {"kind": "box", "lower": [0.0] * 3, "upper": [1.0] * 3},
        "mesh": {"cells": [[3, 3, 3]]},
        "material": {"young": 1.0, "poisson": 0.3},
        "cuts": [{"kind": "polygon", "points": polygon}],
        "loads": _FORCE,
        "quantities": [
            {"kind": "strain_energy"},
            {**point, "name": "u_x", "component": "x"},
            {**point, "name": "u_z", "component": "z"},
        ],
    }
