"""Scenes in space that the tests of the FEniCSx side share."""

import numpy as np
import scenes


def polygon(name, *points):
    return {"kind": "polygon", "name": name, "points": [[float(x) for x in p] for p in points]}


def disc(radius=0.25, centre=(0.5, 0.5, 0.5), normal=(0.0, 0.0, 1.0), name="disc"):
    return {"kind": "disc", "name": name, "centre": list(centre), "normal": list(normal),
            "radius": radius}  # fmt: skip


def cube(cuts=(), **changes):
    """Give a unit cube, clamped below, under its weight."""
    content = {
        "material": scenes.soft(3, density=1.0),
        "supports": [{"where": "bottom", "displacement": [0, 0, 0]}],
        "loads": [{"kind": "gravity", "acceleration": [0, 0, -1]}],
    }
    return scenes.scene(cuts, 3, **content | changes)


EXACT = [{"where": "boundary", "displacement": "exact"}]


def patch(*corners):
    return polygon("a", *corners)


def cylinder(base, height, radius=0.3, axis=(0.0, 0.0, 1.0), **sector):
    return {"kind": "cylinder", "name": "a", "base": list(base), "axis": list(axis),
            "radius": radius, "height": height, **sector}  # fmt: skip


def swept(along, *points):
    return {"kind": "swept", "name": "a", "points": [list(p) for p in points], "along": list(along)}


# cut, its area inside the unit cube, pieces it leaves, whether the facets give the area exactly
LEVEL = patch((0.2, 0.2, 0.5), (0.8, 0.2, 0.5), (0.8, 0.8, 0.5), (0.2, 0.8, 0.5))
SHAPES = {
    "through": ([patch((-1, -1, 0.4), (2, -1, 0.4), (2, 2, 0.6), (-1, 2, 0.6))],
                np.hypot(1, 0.2 / 3), 2),
    "edge": ([patch((-1, -1, 0.5), (0.6, -1, 0.5), (0.6, 2, 0.5), (-1, 2, 0.5))], 0.6, 1),
    "inner": ([patch((0.2, 0.2, 0.5), (0.8, 0.2, 0.5), (0.7, 0.7, 0.5), (0.2, 0.8, 0.5))], 0.3, 1),
    "crossing": ([LEVEL, polygon("b", (0.5, 0.1, 0.2), (0.5, 0.9, 0.2), (0.5, 0.9, 0.9),
                                 (0.5, 0.1, 0.9))], 0.92, 1),
    "branching": ([LEVEL, polygon("b", (0.5, 0.1, 0.5), (0.5, 0.9, 0.5), (0.5, 0.9, 0.9),
                                  (0.5, 0.1, 0.9))], 0.68, 1),
    "quartered": ([patch((-1, -1, 0.5), (2, -1, 0.5), (2, 2, 0.5), (-1, 2, 0.5)),
                   polygon("b", (0.5, -1, -1), (0.5, 2, -1), (0.5, 2, 2), (0.5, -1, 2))], 2.0, 4),
    "swept": ([swept((0.0, 0.0, 2.0), (0.2, 0.2, 0.2), (0.5, 0.6, 0.2), (0.8, 0.3, 0.2))],
              0.8 * (0.5 + np.hypot(0.3, 0.3)), 1),
}  # fmt: skip
ELLIPSE = {"kind": "disc", "name": "a", "centre": [0.5, 0.5, 0.5], "normal": [0.0, 1.0, 1.0],
           "radii": [0.15, 0.3], "axis": [1.0, 0.0, 0.0]}  # fmt: skip
SECTOR = {"towards": [1.0, 0.0, 0.0], "start": 20.0, "sweep": 200.0}
CURVED = {
    "disc": ([disc()], np.pi / 16, 1),
    "half a disc": ([disc(0.4, (0.0, 0.5, 0.5))], 0.08 * np.pi, 1),
    "ellipse": ([ELLIPSE], 0.045 * np.pi, 1),
    "cylinder": ([cylinder((0.5, 0.5, -0.2), 1.5)], 0.6 * np.pi, 2),
    "sector of a cylinder": (
        [cylinder((0.5, 0.5, 0.2), 0.5, axis=(0.0, 0.2, 1.0), **SECTOR)],
        0.15 * np.deg2rad(200.0),
        1,
    ),
}


def area(corner):
    """Area of triangles (m, 3, 3)."""
    spread = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return 0.5 * float(np.linalg.norm(spread, axis=1).sum())


def volumes(mesh):
    return np.linalg.det(mesh.points[mesh.cells[:, 1:]] - mesh.points[mesh.cells[:, :1]]) / 6
