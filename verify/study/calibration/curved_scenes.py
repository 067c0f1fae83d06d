"""Random scenes with a cut along an arc: a disc in a ring, a body cut through, a crack."""

import numpy as np

from verify.study.calibration.scene_parts import Content, Random, around, intensities, plane_scene


def ring_and_disc(random: Random) -> Content:
    """Return a disc at rest in a ring that is drawn off it, at a corner or at an edge.

    Both reach the boundary of the square, which holds them; or the outermost edge is loaded.
    """
    radius = float(random.uniform(0.4, 0.7))
    beside = bool(random.integers(2))
    centre = random.uniform([0.4, -0.1], [0.6, 0.1]) if beside else random.uniform(-0.2, 0.1, 2)
    if beside:
        radius *= 0.6
    place = {"centre": centre.tolist(), "radius": radius}
    parameters = {**place, "outward": float(random.uniform(0.05, 0.15)), "at": 1.0}
    middle, sweep = (90.0, 300.0) if beside else (45.0, 200.0)
    cut = {"kind": "arc", **place, "start": middle - 0.5 * sweep, "sweep": sweep}
    geometry = {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0]}
    at = 0.5 + float(random.uniform(-10.0, 10.0)) / sweep
    scene = plane_scene(random, geometry, ("circular_cut", parameters), cut, at)
    if random.integers(2):
        held = [{"where": side, "displacement": "exact"} for side in ("left", "right", "bottom")]
        scene["supports"] = held
        scene["loads"] = [{"kind": "traction", "where": "top", "traction": "exact"}]
    return scene


def arc_through(random: Random) -> Content:
    """Return a square that an arc cuts through, whose ends lie outside."""
    scene, middle, radius = _arc(random, (70.0, 85.0), (0.8, 2.5))
    # the tips are at least 0.9 radii from the middle of the arc, the corners 0.71 at most
    geometry = around(middle, 0.5 * min(radius, 1.0))
    at = 0.5 + float(random.uniform(-0.1, 0.1))
    return plane_scene(random, geometry, scene[0], scene[1], at)


def curved_crack(random: Random) -> Content:
    """Return a crack along an arc inside a square, under a remote stress that opens it."""
    scene, middle, radius = _arc(random, (30.0, 65.0), (0.8, 1.3))
    geometry = around(middle + random.uniform(-0.2, 0.2, 2), 2.0 * radius)
    made = plane_scene(random, geometry, scene[0], scene[1], float(random.uniform(0.2, 0.8)))
    return {**made, "quantities": made["quantities"] + intensities(("start", "end"))}


def _arc(
    random: Random, half_angles: tuple[float, float], radii: tuple[float, float]
) -> tuple[tuple[tuple[str, Content], Content], np.ndarray, float]:
    """Return an arc crack and its cut, the middle of the arc and its radius."""
    radius, half = float(random.uniform(*radii)), float(random.uniform(*half_angles))
    turn = float(random.uniform(-180.0, 180.0))
    centre = random.uniform(-0.2, 0.2, 2)
    stress = [*random.uniform(0.7, 1.0, 2).tolist(), float(random.uniform(-0.2, 0.2))]
    place = {"centre": centre.tolist(), "radius": radius}
    parameters = {**place, "angle": turn, "half_angle": half, "stress": stress}
    cut = {"kind": "arc", **place, "start": turn - half, "sweep": 2 * half}
    away = np.array([np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))])
    return (("arc_crack", parameters), cut), centre + radius * away, radius
