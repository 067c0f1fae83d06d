"""Random scenes whose numbers are known, at rest and in motion.

Cracks, sinusoids and cut balls at rest; bars, sudden cracks and strips with a blade in motion.
"""

from math import sqrt
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from reference.exact.moving_cracks import sudden_intensity, wave
from reference.exact.solution import hooke
from verify.geometry.simplices import frame
from verify.scene import Material

Array = NDArray[np.float64]
Content = dict[str, Any]
Random = np.random.Generator


def plane_scene(
    random: Random, geometry: Content, exact: tuple[str, Content], cut: Content, at: float,
    ends: tuple[str, ...] = (),
) -> Content:  # fmt: skip
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
        Place of the opening that is measured, as a fraction of the cut's length.
    ends : tuple of str
        Of the cut, at which both stress-intensity factors are measured.
    """
    place = random_point(random, geometry, cut)
    opening = {"kind": "opening", "name": "opening", "at": at}
    poisson = float(random.uniform(0.0, 0.45))
    material = {"poisson": poisson, "plane": str(random.choice(["strain", "stress"]))}
    scene = scene_of(geometry, [8, 8], exact, cut, material, opening, place)
    scene["quantities"] += [
        {"kind": "stress_intensity", "name": f"K_{mode} at the {end}", "end": end, "mode": mode}
        for end in ends
        for mode in ("I", "II")
    ]
    return scene


def scene_of(
    geometry: Content, cells: list[int], exact: tuple[str, Content], cut: Content,
    material: Content, opening: Content, place: list[float],
) -> Content:  # fmt: skip
    """Return the content of a scene that asks for an opening and the displacement of a place."""
    return {
        "title": exact[0],
        "geometry": geometry,
        "mesh": {"cells": [cells]},
        "material": {"young": 1.0, **material},
        "supports": [{"where": "boundary", "displacement": "exact"}],
        "cuts": [cut],
        "quantities": [
            {"kind": "strain_energy"},
            opening,
            *(
                {"kind": "displacement", "point": place, "name": f"u_{axis}", "component": axis}
                for axis in ("x", "xyz"[len(place) - 1])
            ),
        ],
        "exact": {"solution": exact[0], "parameters": exact[1]},
    }


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


def _direction(angle: float) -> Array:
    """Return the unit vector (2,) at an angle, degrees, to the first axis."""
    return np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])


def _distance(point: Array, cut: Content) -> float:
    if cut["kind"] == "arc":
        return abs(float(np.linalg.norm(point - cut["centre"])) - float(cut["radius"]))
    start, end = np.array(cut["points"])
    along = (end - start) / np.linalg.norm(end - start)
    return abs(float(along[0] * (point - start)[1] - along[1] * (point - start)[0]))


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
    scene = _through(random, "smooth", _sinusoids(random, 2, (2.0, 6.0), 2))
    return {**scene, "loads": [{"kind": "body_force", "force": "exact"}]}


def _sinusoids(random: Random, d: int, waves: tuple[float, float], shape: Any) -> Content:
    """Return amplitude, wave numbers and phase of each component on both sides of a cut."""
    return {
        side: np.column_stack([
            random.uniform(0.03, 0.1, d) * random.choice([-1.0, 1.0], d),
            random.uniform(*waves, shape),
            random.uniform(-180.0, 180.0, d),
        ]).tolist()
        for side in ("above", "below")
    }  # fmt: skip


def tip(random: Random) -> Content:
    """Return a cut from the boundary of a square to a tip in it, in any mixed mode."""
    at, angle = random.uniform(-0.3, 0.3, 2), float(random.uniform(-180.0, 180.0))
    intensity = [float(random.uniform(0.3, 1.0)), float(random.uniform(-1.0, 1.0))]
    along = _direction(angle)
    cut = {"kind": "polyline", "points": [(at - _LONG * along).tolist(), at.tolist()]}
    parameters = {"tip": at.tolist(), "angle": angle, "intensity": intensity}
    opened = 1.0 - float(random.uniform(0.15, 0.5)) / _LONG
    return plane_scene(random, around(np.zeros(2), 1.0), ("tip", parameters), cut, opened, ("end",))


def griffith(random: Random) -> Content:
    """Return a crack inside a square, under a remote stress that opens it."""
    centre, angle = random.uniform(-0.3, 0.3, 2), float(random.uniform(-90.0, 90.0))
    a, along = float(random.uniform(0.6, 1.1)), _direction(angle)
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
    exact = "griffith", parameters
    return plane_scene(random, around(np.zeros(2), 2.0), exact, cut, at, ("start", "end"))


def _through(random: Random, name: str, sides: Content) -> Content:
    """Return a cut through the unit square at any angle."""
    point, angle = random.uniform(0.35, 0.65, 2), float(random.uniform(-90.0, 90.0))
    along = _direction(angle)
    reach = 0.5 * _LONG * along
    cut = {"kind": "polyline", "points": [(point - reach).tolist(), (point + reach).tolist()]}
    parameters = {"point": point.tolist(), "angle": angle, **sides}
    at = 0.5 + float(random.uniform(-0.25, 0.25)) / _LONG
    return plane_scene(random, _UNIT, (name, parameters), cut, at)


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
    at = 0.5 + float(random.uniform(-10.0, 10.0)) / sweep
    scene = plane_scene(random, _UNIT, ("circular_cut", parameters), cut, at)
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
    return plane_scene(random, geometry, *scene, at)


def curved_crack(random: Random) -> Content:
    """Return a crack along an arc inside a square, under a remote stress that opens it."""
    scene, middle, radius = _arc(random, (30.0, 65.0), (0.8, 1.3))
    geometry = around(middle + random.uniform(-0.2, 0.2, 2), 2.0 * radius)
    at = float(random.uniform(0.2, 0.8))
    return plane_scene(random, geometry, *scene, at, ("start", "end"))


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
    away = _direction(turn)
    return (("arc_crack", parameters), cut), centre + radius * away, radius


def solid_smooth(random: Random) -> Content:
    """Return sinusoids with a body force on both sides of a plane through the unit cube."""
    point, normal = random.uniform(0.4, 0.6, 3), random.normal(size=3)
    across, first, normal = frame(normal)
    corners = [
        point + 2.0 * (s * first - t * across) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    sides = _sinusoids(random, 3, (-2.0, 2.0), (3, 2))
    while True:
        at = random.uniform(0.15, 0.85, 3)
        if abs(float((at - point) @ normal)) > 0.05:
            break
    parameters = {
        "point": point.tolist(),
        "normal": normal.tolist(),
        "axis": first.tolist(),
    } | sides
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


_YOUNG, _DENSITY, _LENGTH = 1.0, 1.0, 1.0


def _moved(distance: float, length: float, run: float) -> float:
    return float(wave(distance, length, run)[0])


def stretched(length: float, run: float) -> float:
    """Integral of the squared strain, per squared strain of the load, of a bar as in `wave`, m."""
    turn = (run / length) % 4.0
    behind = min(turn, 4.0 - turn)  # one front runs; behind it the strain is 1, reflected 2
    return length * (behind if behind <= 1.0 else 3.0 * behind - 2.0)


def released(length: float, run: float) -> float:
    """As `stretched`, of a bar of strain 1 whose end is let go suddenly: 1, 0, −1, 0 … m."""
    return length * abs((run / length) % 2.0 - 1.0)


def bar(random: Random) -> Content:
    """Return a bar in uniaxial strain: prestrained and cut, or loaded suddenly at its end."""
    dimension, cut = int(random.choice([2, 2, 3])), bool(random.integers(2))
    poisson = float(random.uniform(0.0, 0.4))
    modulus = _YOUNG * (1 - poisson) / ((1 + poisson) * (1 - 2 * poisson))
    speed = sqrt(modulus / _DENSITY)
    upper = [_LENGTH, *random.uniform(0.06, 0.1, dimension - 1).tolist()]
    at, strain = float(random.uniform(0.3, 0.7)), float(random.uniform(0.005, 0.02))
    run = float(random.uniform(0.7, 2.4)) * (min(at, 1 - at) if cut else _LENGTH)
    points = [float(random.uniform(*span)) for span in ((0.05, at - 0.05), (at + 0.05, 0.95))]
    # output times
    runs = [run * share for share in random.choice([0.4, 0.6, 0.8, 1.0], 4, replace=False).tolist()]
    content = _held_bar(upper, poisson, run / speed)
    middle, values = [0.47 * w for w in upper[1:]], {}
    for k, (x, time) in enumerate(zip(points if cut else points * 2, runs, strict=False)):
        asked = {"kind": "displacement", "name": f"u {k}", "point": [x, *middle], "component": "x"}
        content["quantities"].append({**asked, "time": time / speed})
        if not cut:
            moved = _moved(_LENGTH - x, _LENGTH, time)
        else:
            moved = x + (-_moved(at - x, at, time) if x < at
                         else _moved(x - at, _LENGTH - at, time))  # fmt: skip
        values[f"u {k}"] = strain * moved
    if cut:
        content["initial"] = {"kind": "equilibrium"}
        pulled = {"where": "right", "components": ["x"], "displacement": [strain * _LENGTH]}
        content["supports"].append(pulled)
        content["cuts"] = [_across(at, upper)]
        place = {"at": 0.45} if dimension == 2 else {"point": [at, *middle]}
        for k, time in enumerate(runs[2:]):
            name = f"opening {k}"
            asked = {"kind": "opening", "name": name, "time": time / speed}
            content["quantities"].append(asked | place)
            values[name] = strain * (_moved(0.0, at, time) + _moved(0.0, _LENGTH - at, time))
        energy = released(at, run) + released(_LENGTH - at, run)
    else:
        pull = [modulus * strain, *[0.0] * (dimension - 1)]
        content["loads"] = [{"kind": "traction", "where": "right", "traction": pull}]
        energy = stretched(_LENGTH, run)
    values["strain_energy"] = 0.5 * modulus * strain**2 * float(np.prod(upper[1:])) * energy
    return {**content, "values": values}


def _held_bar(upper: list[float], poisson: float, duration: float) -> Content:
    """Return a bar from the origin to a corner, held on its left and against contraction."""
    dimension = len(upper)
    last = "yz"[dimension - 2]
    across = {"bottom": last, "top": last} | ({"front": "y", "back": "y"} if dimension == 3 else {})
    return {
        "title": "bar",
        "geometry": {"kind": "rectangle" if dimension == 2 else "box",
                     "lower": [0.0] * dimension, "upper": upper},
        "mesh": {"cells": [[8, *[1] * (dimension - 1)]]},
        "material": {"young": _YOUNG, "poisson": poisson, "density": _DENSITY,
                     **({"plane": "strain"} if dimension == 2 else {})},
        "analysis": {"kind": "dynamic", "duration": duration, "outputs": 6},
        "supports": [
            {"where": side, "components": [axis], "displacement": [0.0]}
            for side, axis in ({"left": "x"} | across).items()
        ],
        "quantities": [{"kind": "strain_energy"}],
    }  # fmt: skip


def _across(at: float, upper: list[float]) -> Content:
    """Return a cut across a bar."""
    if len(upper) == 2:
        return {"kind": "polyline", "points": [[at, -0.1], [at, upper[1] + 0.1]]}
    y, z = (w + 0.1 for w in upper[1:])
    corners = [[at, -0.1, -0.1], [at, y, -0.1], [at, y, z], [at, -0.1, z]]
    return {"kind": "polygon", "points": corners}


def sudden_crack(random: Random) -> Content:
    """Return a crack of length 1 that opens suddenly in a plate under tension, at any angle.

    Each end behaves as the tip of a half-infinite crack until a pressure wave arrives from the
    other one. The boundary is at least half a length away, and waves go there and back.
    """
    poisson = float(random.uniform(0.0, 0.4))
    angle = float(random.uniform(15.0, 45.0) * random.choice([-1.0, 1.0]))
    speed = sqrt((1 - poisson) / ((1 + poisson) * (1 - 2 * poisson)))
    middle = np.array([1.1, 0.95]) + random.uniform(-0.05, 0.05, 2)
    ahead = 0.5 * _direction(angle)
    duration = float(random.uniform(0.6, 0.95)) / speed
    material = {"young": _YOUNG, "poisson": poisson, "density": _DENSITY, "plane": "strain"}
    law = hooke(Material.model_validate(material))
    normal, along = _direction(angle)
    stress: dict[Literal["I", "II"], float] = {"I": float(normal**2), "II": float(normal * along)}
    quantities, values = [], {}
    for end in ("start", "end"):
        for k, share in enumerate((float(random.choice([0.5, 0.75])), 1.0)):  # output times
            mode: Literal["I", "II"] = "II" if random.integers(2) else "I"
            time = share * duration
            name = f"K_{mode} {k} at the {end}"
            quantities.append({"kind": "stress_intensity", "name": name, "end": end, "mode": mode,
                               "time": time})  # fmt: skip
            values[name] = sudden_intensity(mode, stress[mode], law, time)
    return {
        "title": "sudden crack",
        "geometry": {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [2.2, 1.9]},
        "mesh": {"cells": [[10, 8]]},
        "material": material,
        "analysis": {"kind": "dynamic", "duration": duration, "outputs": 5},
        "initial": {"kind": "equilibrium"},
        "supports": [
            {"where": "bottom", "components": ["y"], "displacement": [0.0]},
            {"where": "left", "components": ["x"], "displacement": [0.0]},
        ],
        "loads": [{"kind": "traction", "where": "top", "traction": [0.0, 1.0]}],
        "cuts": [{"kind": "polyline", "points": [(middle - ahead).tolist(),
                                                 (middle + ahead).tolist()]}],
        "quantities": quantities,
        "values": values,
    }  # fmt: skip


def blade_strip(random: Random) -> Content:
    """Return a part of a prestretched strip with a blade through it, at any angle and speed.

    Antiplane, with the exact field on its sides; the wave speed is 1 m/s, the blade reaches a tenth
    to seven tenths of it.
    """
    speed, angle = float(random.uniform(0.1, 0.7)), float(random.uniform(-15.0, 15.0))
    ahead = _direction(angle)
    tip = random.uniform([-0.08, -0.01], [0.0, 0.01])
    duration = float(random.uniform(0.05, 0.09)) / speed
    sides = ["left", "right", "front", "back"]
    content: Content = {
        "title": "blade strip",
        "geometry": {"kind": "box", "lower": [-0.15, -0.05, 0.0], "upper": [0.15, 0.05, 0.006]},
        "mesh": {"cells": [[24, 8, 1]]},
        "material": {"young": 2500.0, "poisson": 0.25, "density": 1000.0},
        "analysis": {"kind": "dynamic", "duration": duration, "outputs": 3},
        "exact": {
            "solution": "blade_strip",
            "parameters": {"half_width": 0.1, "grip": 0.006, "speed": speed, "angle": angle,
                           "tip": tip.tolist()},
        },
        "initial": {"kind": "field", "displacement": "exact", "velocity": "exact"},
        "supports": [
            *({"where": side, "components": ["x", "y"], "displacement": [0.0, 0.0]}
              for side in ("bottom", "top")),
            *({"where": side, "displacement": "exact"} for side in sides),
        ],
        "cuts": [{"kind": "tool_path", "depth": 0.008, "direction": [0.0, 0.0, 1.0],
                  "points": [[*(tip + way * ahead), -0.001] for way in (-0.35, speed * duration)],
                  "times": [-0.35 / speed, duration], "expected": "edge"}],
        "quantities": [],
    }  # fmt: skip
    for k, behind in enumerate(random.uniform([0.01, 0.04], [0.03, 0.06])):
        place = [*(tip - behind * ahead), 0.003]
        content["quantities"].append(
            {"kind": "opening", "name": f"opening {k}", "point": place, "component": "tangential"}
        )
    for k, at in enumerate(random.uniform([-0.13, 0.02], [0.13, 0.04], (2, 2)) * [[1, 1], [1, -1]]):
        content["quantities"].append(
            {"kind": "displacement", "name": f"u {k}", "point": [*at, 0.003], "component": "z"}
        )
    return content
