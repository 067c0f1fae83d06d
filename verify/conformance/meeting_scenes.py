"""Small scenes of cuts that cross, branch, end, or cross an interface, with answers in closed form.

As those of `verify.conformance.scenes`: unit bodies of a few cells whose lines no cut follows.
"""

from collections.abc import Callable, Sequence

import numpy as np

from verify.conformance.scenes import (
    POISSON,
    ROLLERS,
    UPRIGHT,
    UPRIGHT_AT,
    YOUNG,
    Array,
    Field,
    in_space,
    unit_scene,
)
from verify.scene import Scene

END = (0.6, 0.5)  #: where the cut of `ending_cut` ends: a node of its mesh of 5 × 4 cells
SLOPE = 0.24  #: of that cut
# two translations (m) and an infinitesimal rotation of each part
_MOTIONS = np.array([
    [0.02, -0.03, 0.1], [-0.04, 0.05, -0.06], [0.05, 0.08, 0.03], [-0.03, 0.06, 0.08],
])  # fmt: skip


def two_cuts() -> tuple[Scene, Field]:
    """Move each of three parts between two cuts, held off the cuts."""
    lower, upper = [[-0.1, 0.14], [1.1, 0.23]], [[-0.1, 0.85], [1.1, 0.77]]
    held = ["bottom", "x < 1e-9 and y > 0.3 and y < 0.7", "top"]

    def part(near: Array) -> Array:
        return np.sum([_left_of(near, *ends) for ends in (lower, upper)], axis=0)

    return _parted("two-cuts", [lower, upper], held, part, cells=[5, 8])


def crossing_cuts() -> tuple[Scene, Field]:
    """Move each quarter between two cuts that cross, held off the cuts."""
    one, two = [[-0.1, 0.326], [1.1, 0.614]], [[0.43, -0.1], [0.58, 1.1]]
    held = [
        f"y {end} and x {side}" for end in ("< 1e-9", "> 0.999999") for side in ("> 0.8", "< 0.2")
    ]

    def part(near: Array) -> Array:
        return 2 * _left_of(near, *one) + _left_of(near, *two)

    return _parted("crossing-cuts", [one, two], held, part)


def branched_cut() -> tuple[Scene, Field]:
    """Move each of three parts between a cut and a branch of it, held off the cuts."""
    stem, branch = [[-0.1, 0.326], [1.1, 0.614]], [[0.45, 0.458], [0.62, 1.1]]
    held = ["bottom", "y > 0.999999 and x > 0.8", "y > 0.999999 and x < 0.2"]

    def part(near: Array) -> Array:
        return _left_of(near, *stem) * (1 + _left_of(near, *branch))

    return _parted("branched-cut", [stem, branch], held, part)


def _left_of(points: Array, start: Sequence[float], end: Sequence[float]) -> Array:
    """1 for points (n, 2) on the left of a line, else 0."""
    (u, v), (x, y) = np.subtract(end, start), (points - np.asarray(start)).T
    return (u * y - v * x > 0.0).astype(np.int64)


def _parted(
    name: str,
    cuts: Sequence[Sequence[Sequence[float]]],
    held: Sequence[str],
    part: Callable[[Array], Array],
    cells: Sequence[int] = (5, 4),
) -> tuple[Scene, Field]:
    """Hold the parts of a cut square, each somewhere, so that each moves as a rigid body."""
    scene = unit_scene(
        name,
        mesh={"cells": [list(cells), [2 * n for n in cells]]},
        supports=[
            {"where": where, "displacement": [f"{a} - {turn} * y", f"{b} + {turn} * x"]}
            for where, (a, b, turn) in zip(held, _MOTIONS.tolist(), strict=False)
        ],
        cuts=[
            {"kind": "polyline", "name": f"cut {k}", "points": [list(end) for end in ends]}
            for k, ends in enumerate(cuts)
        ],
    )

    def field(points: Array, near: Array) -> Array:
        a, b, turn = _MOTIONS[part(near)].T
        return np.column_stack([a - turn * points[:, 1], b + turn * points[:, 0]])

    return scene, field


def crossed_interface() -> tuple[Scene, Field]:
    """Pull two halves, cut apart lengthwise, across an interface that the cut crosses.

    Mesh lines follow the interface. ν/E is the same on both sides, so that both contract alike.
    """
    traction, interface, times = 0.05, 0.5, 4.0
    above = {"where": f"y > {interface}", "young": times * YOUNG, "poisson": times * 0.1}
    material = {"young": YOUNG, "poisson": 0.1, "plane": "stress", "regions": [above]}
    scene = unit_scene(
        "crossed-interface",
        material=material,
        cuts=[UPRIGHT],
        supports=ROLLERS,
        loads=[{"kind": "traction", "where": "top", "traction": [0.0, traction]}],
    )

    def field(points: Array, near: Array) -> Array:
        strain = traction / YOUNG
        fixed = np.where(near[:, 0] < UPRIGHT_AT, 0.0, 1.0)
        soft = np.minimum(points[:, 1], interface)
        along = strain * (soft + (points[:, 1] - soft) / times)
        return np.column_stack([-0.1 * strain * (points[:, 0] - fixed), along])

    return scene, field


def pulled_halves_in_space() -> tuple[Scene, Field]:
    """Pull two halves of a cube along an inclined cut by a traction: each contracts for itself."""
    traction = 0.2
    corners = [[0.31, -0.1], [0.31, -0.1], [0.55, 1.1], [0.55, 1.1]]
    heights = [-0.1, 1.1, 1.1, -0.1]
    points = [[*corner, height] for corner, height in zip(corners, heights, strict=True)]
    scene = unit_scene(
        "pulled-halves-3d",
        supports=[
            {"where": f"{axis} < 1e-9", "displacement": [0.0], "components": [axis]}
            for axis in "xyz"
        ]
        + [{"where": "x > 0.999999", "displacement": [0.0], "components": ["x"]}],
        loads=[{"kind": "traction", "where": "z > 0.999999", "traction": [0.0, 0.0, traction]}],
        **in_space([{"kind": "polygon", "points": points}]),
    )

    def field(points: Array, near: Array) -> Array:
        strain = traction / YOUNG
        fixed = np.where(_left_of(near[:, :2], corners[0], corners[2]) == 1, 0.0, 1.0)
        contraction = -POISSON * strain
        return np.column_stack([
            contraction * (points[:, 0] - fixed), contraction * points[:, 1], strain * points[:, 2],
        ])  # fmt: skip

    return scene, field


def ending_cut() -> Scene:
    """Pull a square apart across a cut that ends at a node of its mesh."""
    mouth = [-0.1, END[1] - SLOPE * (END[0] + 0.1)]
    return unit_scene(
        "ending-cut",
        cuts=[{"kind": "polyline", "points": [mouth, list(END)]}],
        supports=[
            {"where": "bottom", "displacement": [0.0, 0.0]},
            {"where": "top", "displacement": [0.0, 0.1]},
        ],
    )
