"""Common parts of the random scenes of the study."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Content = dict[str, Any]
Random = np.random.Generator


def plane_scene(
    random: Random, geometry: Content, exact: tuple[str, Content], cut: Content, at: float
) -> Content:
    """Return the content of a plane scene, its boundary held as the exact solution says.

    Parameters
    ----------
    random : numpy.random.Generator
    geometry : dict
        A rectangle.
    exact : (str, dict)
        Name of the exact solution and its parameters.
    cut : dict
        One cut.
    at : float
        Where the opening is asked for, as a fraction of the cut's length.
    """
    place = {"kind": "displacement", "point": random_point(random, geometry, cut)}
    return {
        "title": exact[0],
        "requirement": "The stated uncertainty of the reference shall cover its true error.",
        "geometry": geometry,
        "mesh": {"cells": [[8, 8]]},
        "material": {
            "young": 1.0,
            "poisson": float(random.uniform(0.0, 0.45)),
            "plane": str(random.choice(["strain", "stress"])),
        },
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "cuts": [cut],
        "quantities": [
            {"kind": "strain_energy"},
            {"kind": "opening", "name": "opening", "at": at},
            {**place, "name": "u_x", "component": "x"},
            {**place, "name": "u_y", "component": "y"},
        ],
        "exact": {"solution": exact[0], "parameters": exact[1]},
    }


def intensities(ends: tuple[str, ...]) -> list[Content]:
    """Return both stress-intensity factors at each end of the cut, as quantities."""
    return [
        {"kind": "stress_intensity", "name": f"K_{mode} at the {end}", "end": end, "mode": mode}
        for end in ends
        for mode in ("I", "II")
    ]


def random_point(random: Random, geometry: Content, cut: Content) -> list[float]:
    """Return a point of the body, off its boundary and its cut by a twentieth of its size."""
    lower, upper = np.array(geometry["lower"]), np.array(geometry["upper"])
    size = float((upper - lower).max())
    while True:
        point = random.uniform(lower + 0.1 * size, upper - 0.1 * size)
        if _distance(point, cut) > 0.05 * size:
            return [float(x) for x in point]


def around(centre: Array, half: float) -> Content:
    """Return a square around a point."""
    return {
        "kind": "rectangle",
        "lower": [float(x) for x in centre - half],
        "upper": [float(x) for x in centre + half],
    }


def _distance(point: Array, cut: Content) -> float:
    if cut["kind"] == "arc":
        return abs(float(np.linalg.norm(point - cut["centre"])) - float(cut["radius"]))
    start, end = np.array(cut["points"])
    along = (end - start) / np.linalg.norm(end - start)
    return abs(float(along[0] * (point - start)[1] - along[1] * (point - start)[0]))
