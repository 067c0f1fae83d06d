"""Random scenes in motion whose numbers are known: bars, sudden cracks, strips with a blade."""

from math import cos, radians, sin, sqrt
from typing import Literal

import numpy as np

from reference.exact.moving_cracks import sudden_intensity, wave
from reference.exact.solution import hooke
from verify.scene import Material
from verify.study.calibration.still_scenes import Content, Random

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
    shares = random.choice([0.4, 0.6, 0.8, 1.0], 4, replace=False).tolist()  # output times
    sides = ["bottom", "top", *(["front", "back"] if dimension == 3 else [])]
    across = {"bottom": "yz"[dimension - 2], "top": "yz"[dimension - 2], "front": "y", "back": "y"}
    area = float(np.prod(upper[1:]))
    content: Content = {
        "title": "bar",
        "requirement": "The stated uncertainty of the reference shall cover its true error.",
        "geometry": {"kind": "rectangle" if dimension == 2 else "box",
                     "lower": [0.0] * dimension, "upper": upper},
        "mesh": {"cells": [[8, *[1] * (dimension - 1)]]},
        "material": {"young": _YOUNG, "poisson": poisson, "density": _DENSITY,
                     **({"plane": "strain"} if dimension == 2 else {})},
        "analysis": {"kind": "dynamic", "duration": run / speed, "outputs": 6},
        "supports": [
            {"where": "left", "components": ["x"], "displacement": [0.0]},
            *({"where": s, "components": [across[s]], "displacement": [0.0]} for s in sides),
        ],
        "quantities": [{"kind": "strain_energy"}],
    }  # fmt: skip
    middle = [0.47 * w for w in upper[1:]]
    values: dict[str, float] = {}
    for k, (x, share) in enumerate(zip(points if cut else points * 2, shares, strict=False)):
        name, time = f"u {k}", share * run
        content["quantities"].append(
            {"kind": "displacement", "name": name, "point": [x, *middle], "component": "x",
             "time": time / speed}
        )  # fmt: skip
        if not cut:
            values[name] = strain * _moved(_LENGTH - x, _LENGTH, time)
        elif x < at:
            values[name] = strain * (x - _moved(at - x, at, time))
        else:
            values[name] = strain * (x + _moved(x - at, _LENGTH - at, time))
    if cut:
        content["initial"] = {"kind": "equilibrium"}
        pulled = {"where": "right", "components": ["x"], "displacement": [strain * _LENGTH]}
        content["supports"].append(pulled)
        content["cuts"] = [_across(at, upper)]
        place = {"at": 0.45} if dimension == 2 else {"point": [at, *middle]}
        for k, share in enumerate(shares[2:]):
            name, time = f"opening {k}", share * run
            asked = {"kind": "opening", "name": name, "time": time / speed}
            content["quantities"].append(asked | place)
            values[name] = strain * (_moved(0.0, at, time) + _moved(0.0, _LENGTH - at, time))
        energy = released(at, run) + released(_LENGTH - at, run)
    else:
        pull = [modulus * strain, *[0.0] * (dimension - 1)]
        content["loads"] = [{"kind": "traction", "where": "right", "traction": pull}]
        energy = stretched(_LENGTH, run)
    values["strain_energy"] = 0.5 * modulus * strain**2 * area * energy
    return {**content, "values": values}


def _across(at: float, upper: list[float]) -> Content:
    """Return a cut across a bar."""
    if len(upper) == 2:
        return {"kind": "polyline", "points": [[at, -0.1], [at, upper[1] + 0.1]]}
    y, z = (w + 0.1 for w in upper[1:])
    corners = [[at, -0.1, -0.1], [at, y, -0.1], [at, y, z], [at, -0.1, z]]
    return {"kind": "polygon", "points": corners}


def sudden_crack(random: Random) -> Content:
    """Return a crack of length 1 that opens suddenly in a plate under tension, at any angle.

    Each end is that of a half-infinite crack until a pressure wave has come from the other one;
    the boundary is half a length away or farther, and waves go there and back.
    """
    poisson = float(random.uniform(0.0, 0.4))
    angle = float(random.uniform(15.0, 45.0) * random.choice([-1.0, 1.0]))
    speed = sqrt((1 - poisson) / ((1 + poisson) * (1 - 2 * poisson)))
    middle = np.array([1.1, 0.95]) + random.uniform(-0.05, 0.05, 2)
    ahead = 0.5 * np.array([cos(radians(angle)), sin(radians(angle))])
    duration = float(random.uniform(0.6, 0.95)) / speed
    material = {"young": _YOUNG, "poisson": poisson, "density": _DENSITY, "plane": "strain"}
    law = hooke(Material.model_validate(material))
    normal, along = cos(radians(angle)), sin(radians(angle))
    stress: dict[Literal["I", "II"], float] = {"I": normal**2, "II": normal * along}
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
        "requirement": "The stated uncertainty of the reference shall cover its true error.",
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
    ahead = np.array([cos(radians(angle)), sin(radians(angle))])
    tip = random.uniform([-0.08, -0.01], [0.0, 0.01])
    duration = float(random.uniform(0.05, 0.09)) / speed
    sides = ["left", "right", "front", "back"]
    content: Content = {
        "title": "blade strip",
        "requirement": "The stated uncertainty of the reference shall cover its true error.",
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
