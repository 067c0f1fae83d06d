"""Small scenes whose answers are known without any reference, in closed form.

All bodies are unit squares (or cubes) of a few cells, whose mesh lines no cut follows, so that a
case takes a few milliseconds. The linear answers lie in every finite element space that is cut
along straight lines; they are found to round-off or not at all.
"""

from collections.abc import Callable, Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Rotation, Scene, restore_scene

Array = NDArray[np.float64]
# displacement (n, d) at points (n, d), on the side of the points `near` (n, d)
Field = Callable[[Array, Array], Array]

YOUNG, POISSON, DENSITY = 2.5, 0.3, 3.0

_SQUARE = {"kind": "rectangle", "lower": [0.0, 0.0], "upper": [1.0, 1.0]}
_CUBE = {"kind": "box", "lower": [0.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]}


def line(*points: Sequence[float], **more: Any) -> dict[str, Any]:
    """Cut along a polyline."""
    return {"kind": "polyline", "points": [list(point) for point in points], **more}


def held(where: str, displacement: Any, axes: str = "") -> dict[str, Any]:
    """Prescribe the displacement, or those of its components that are named."""
    return {
        "where": where, "displacement": displacement, **({"components": list(axes)} if axes else {})
    }  # fmt: skip


def weight(*acceleration: float) -> dict[str, Any]:
    """Load by gravity, m/s²."""
    return {"kind": "gravity", "acceleration": list(acceleration)}


def pull(where: str, *traction: float) -> dict[str, Any]:
    """Load by a traction, Pa."""
    return {"kind": "traction", "where": where, "traction": list(traction)}


_MIDDLE, _SLOPE = (0.5, 0.47), 0.24
_INCLINED = line((-0.1, 0.326), (1.1, 0.614))
UPRIGHT_AT = 0.37
UPRIGHT = line((UPRIGHT_AT, -0.1), (UPRIGHT_AT, 1.1))
_TILTED_PLANE: dict[str, Any] = {
    "kind": "polygon",
    "points": [[-0.1, -0.1, 0.37], [1.1, -0.1, 0.37], [1.1, 1.1, 0.61], [-0.1, 1.1, 0.61]],
}
_BOUNDARY_EXACT = [held("boundary", "exact")]
ROLLERS = [held("bottom", [0.0], "y"), held("left", [0.0], "x"), held("right", [0.0], "x")]


def unit_scene(name: str, file: Path | None = None, **parts: Any) -> Scene:
    """Make a scene of a unit square, in which `parts` replace the defaults."""
    content: dict[str, Any] = {
        "title": name,
        "requirement": "A right solver shall answer as the closed form does.",
        "geometry": _SQUARE,
        "mesh": {"cells": [[5, 4], [10, 8]]},
        "material": {"young": YOUNG, "poisson": POISSON, "plane": "strain", "density": DENSITY},
        **parts,
    }
    return restore_scene({"name": name, "file": str(file) if file else None, "scene": content})


def in_space(cuts: list[Mapping[str, Any]]) -> dict[str, Any]:
    """Parts of a scene of a unit cube of 3 × 3 × 3 cells."""
    return {
        "geometry": _CUBE,
        "mesh": {"cells": [[3, 3, 3]]},
        "material": {"young": YOUNG, "poisson": POISSON, "density": DENSITY},
        "cuts": cuts,
    }


def uncut_linear(dimension: int = 2) -> tuple[Scene, Field]:
    """Prescribe a linear field on the boundary of an uncut body."""
    matrix = np.array([[0.03, 0.05, -0.02], [-0.01, 0.02, 0.04], [0.01, -0.03, 0.05]])
    matrix = matrix[:dimension, :dimension]
    parts = in_space([]) if dimension == 3 else {}
    scene = unit_scene(
        f"uncut-{dimension}d",
        supports=_BOUNDARY_EXACT,
        exact={"solution": "linear", "parameters": {"matrix": matrix.tolist()}},
        **parts,
    )
    return scene, lambda points, near: points @ matrix.T


def rigid(kind: str, dimension: int = 2) -> tuple[Scene, Field]:
    """Move the whole boundary of a cut body rigidly: ``translation`` or ``rotation``."""
    parts = in_space([_TILTED_PLANE]) if dimension == 3 else {"cuts": [_INCLINED]}
    name = f"{kind}-{dimension}d"
    if kind == "translation":
        shift = np.array([0.3, -0.2, 0.1])[:dimension]
        scene = unit_scene(name, supports=[held("boundary", shift.tolist())], **parts)
        return scene, lambda points, near: np.tile(shift, (len(points), 1))
    spin = np.array([[0.0, -0.1, 0.05], [0.1, 0.0, -0.07], [-0.05, 0.07, 0.0]])
    spin = spin[:dimension, :dimension]
    exact = {"solution": "linear", "parameters": {"matrix": spin.tolist()}}
    scene = unit_scene(name, supports=_BOUNDARY_EXACT, exact=exact, **parts)
    return scene, lambda points, near: points @ spin.T


def turned(dimension: int) -> tuple[Scene, Field]:
    """Turn the whole boundary of a cut body by a finite angle and shift it."""
    parts = in_space([_TILTED_PLANE]) if dimension == 3 else {"cuts": [_INCLINED]}
    centre, shift = [0.4, 0.3, 0.6][:dimension], [0.2, -0.1, 0.3][:dimension]
    rotation = Rotation(
        angle=50.0, centre=centre, axis=(1.0, 2.0, -1.0) if dimension == 3 else None
    )
    scene = unit_scene(
        f"turned-{dimension}d",
        supports=[{**held("boundary", shift), "rotation": rotation.model_dump()}],
        analysis={"kinematics": "corotational"},
        **parts,
    )
    turn = rotation.matrix() - np.eye(dimension)
    return scene, lambda points, near: (points - centre) @ turn.T + shift


def parted_halves() -> tuple[Scene, Field]:
    """Lift the upper half of a cube off the lower one, along a tilted plane."""
    lift = np.array([0.05, 0.0, 0.2])
    scene = unit_scene(
        "parted-halves",
        supports=[held("bottom", [0.0, 0.0, 0.0]), held("top", lift.tolist())],
        **in_space([_TILTED_PLANE]),
    )
    corner, end = _TILTED_PLANE["points"][0], _TILTED_PLANE["points"][2]
    slope = (end[2] - corner[2]) / (end[1] - corner[1])

    def field(points: Array, near: Array) -> Array:
        above = near[:, 2] > corner[2] + slope * (near[:, 1] - corner[1])
        return above[:, None] * lift

    return scene, field


def freed_half() -> tuple[Scene, Array]:
    """Let the lower half of a square fall (m/s², second value) while the upper one is held."""
    gravity = np.array([0.5, -2.0])
    scene = unit_scene(
        "freed-half",
        cuts=[_INCLINED],
        supports=[held("top", [0.0, 0.0])],
        loads=[weight(*gravity.tolist())],
        analysis={"kind": "dynamic", "duration": 0.4, "time_step": 0.01, "outputs": 5},
    )
    return scene, gravity


def swinging(shaken: bool = False) -> Scene:
    """Let a square that stands on its lower side swing under a sudden weight, cut from its side.

    Its lower side stands still, or swings too.
    """
    swing = "0.02 * (1 - cos(0.6 * t))"  # from rest, slower than its lowest mode
    return unit_scene(
        "shaken" if shaken else "swinging",
        cuts=[line((0.37, 0.41), (1.1, 0.63))],
        supports=[held("bottom", [swing if shaken else 0.0, 0.0])],
        loads=[weight(0.02, -0.01)],
        analysis={"kind": "dynamic", "duration": 9.0, "time_step": 0.05, "outputs": 31},
    )


def strained_sides() -> tuple[Scene, Field, float]:
    """Strain the two sides of an inclined cut differently and move them apart.

    Each side is in uniaxial stress along the cut, so that the cut is free of traction.

    Returns
    -------
    scene : Scene
    field : callable
    energy : float
        E'/2 · Σ area · strain², J/m.
    """
    strain, shift = (0.1, -0.05), (0.03, -0.02)  # above, below
    scene = unit_scene(
        "strained-sides", supports=_BOUNDARY_EXACT, cuts=[_INCLINED], exact=_patch(strain, shift)
    )
    direction = np.array([1.0, _SLOPE]) / np.hypot(1.0, _SLOPE)
    normal = np.array([-direction[1], direction[0]])
    contraction = POISSON / (1 - POISSON)

    def field(points: Array, near: Array) -> Array:
        above = (near - _MIDDLE) @ normal > 0
        s, t = (points - _MIDDLE) @ direction, (points - _MIDDLE) @ normal
        e = np.where(above, *strain)
        along, across = e * s, -contraction * e * t + np.where(above, *shift)
        return along[:, None] * direction + across[:, None] * normal

    # the line passes through (1/2, 0.47): 0.53 of the square lies above it
    area = 1 - _MIDDLE[1], _MIDDLE[1]
    stiffness = YOUNG / (1 - POISSON**2)
    energy = 0.5 * stiffness * sum(a * e * e for a, e in zip(area, strain, strict=True))
    return scene, field, energy


def _patch(strain: tuple[float, float], shift: tuple[float, float]) -> dict[str, Any]:
    parameters = {"point": list(_MIDDLE), "slope": _SLOPE}
    return {
        "solution": "patch",
        "parameters": {**parameters, "strain": list(strain), "shift": list(shift)},
    }


def closed_cut() -> tuple[Scene, Scene]:
    """Pull a body along its cut, and the same body without the cut: the cut bears nothing."""
    exact = _patch((0.1, 0.1), (0.0, 0.0))
    return (
        unit_scene("closed-cut", supports=_BOUNDARY_EXACT, cuts=[_INCLINED], exact=exact),
        unit_scene("no-cut", supports=_BOUNDARY_EXACT, exact=exact),
    )


def pulled_halves() -> tuple[Scene, Field]:
    """Pull two halves, cut apart lengthwise, by a traction: each contracts for itself.

    Plane stress. The outer sides are on rollers, so that the cut opens by ν t / E everywhere.
    """
    traction = 0.2
    scene = unit_scene(
        "pulled-halves",
        material={"young": YOUNG, "poisson": POISSON, "plane": "stress"},
        cuts=[UPRIGHT],
        supports=ROLLERS,
        loads=[pull("top", 0.0, traction)],
    )

    def field(points: Array, near: Array) -> Array:
        fixed = np.where(near[:, 0] < UPRIGHT_AT, 0.0, 1.0)
        strain = traction / YOUNG
        return np.column_stack([-POISSON * strain * (points[:, 0] - fixed), strain * points[:, 1]])

    return scene, field


def two_materials() -> tuple[Scene, Field]:
    """Pull two halves, cut apart lengthwise, one of which has a strip of another material.

    Strip and halves are pulled as much as makes them equally long; nothing hinders contraction.
    Mesh lines follow the interface. No cut element touches it: a method may join the gradients
    around a cut, which jump at an interface.
    """
    strain, interface = 0.02, 0.6
    young, poisson = np.array([1.0, 4.0]) * YOUNG, np.array([0.1, 0.4])
    strip = {"where": f"x > {interface}", "young": float(young[1]), "poisson": float(poisson[1])}
    base = {"young": float(young[0]), "poisson": float(poisson[0]), "plane": "stress"}
    scene = unit_scene(
        "two-materials",
        material={**base, "regions": [strip]},
        cuts=[UPRIGHT],
        supports=ROLLERS,
        loads=[
            pull(f"y > 0.999999 and x {side} {interface}", 0.0, float(modulus * strain))
            for side, modulus in zip("<>", young, strict=True)
        ],
    )

    def field(points: Array, near: Array) -> Array:
        x, y = points.T
        first = interface - np.minimum(x, interface)
        inwards = poisson[0] * first + poisson[1] * (1 - np.maximum(x, interface))
        across = np.where(near[:, 0] < UPRIGHT_AT, -poisson[0] * x, inwards)
        return strain * np.column_stack([across, y])

    return scene, field


def hanging_halves() -> tuple[Scene, Array]:
    """Hang two halves, cut apart lengthwise, under their weight (N/m³, second value)."""
    gravity = np.array([0.5, -2.0])
    scene = unit_scene(
        "hanging-halves",
        cuts=[UPRIGHT],
        supports=[held("top", [0.0, 0.0])],
        loads=[weight(*gravity.tolist())],
    )
    return scene, DENSITY * gravity


def sheared_halves(mirrored: bool) -> Scene:
    """Move and load two halves; or that scene mirrored at the diagonal y = x.

    Squares split along their rising diagonal are symmetric to that diagonal.
    """
    order = slice(None, None, -1) if mirrored else slice(None)
    lower, upper, side = ("left", "right", "top") if mirrored else ("bottom", "top", "right")
    ends = [[-0.1, 0.47], [1.1, 0.62]]
    return unit_scene(
        "mirrored" if mirrored else "sheared-halves",
        mesh={"cells": [[6, 6], [12, 12]]},
        cuts=[line(*(end[order] for end in ends))],
        supports=[held(lower, [0.0, 0.0]), held(upper, [0.02, 0.05][order])],
        loads=[pull(side, *[0.1, 0.3][order])],
    )


def free_piece() -> Scene:
    """Cut a piece off that nothing holds: there is no static answer."""
    return unit_scene(
        "free-piece",
        cuts=[_INCLINED],
        supports=[held("bottom", [0.0, 0.0])],
        loads=[weight(0.0, -1.0)],
    )


def given_mesh(folder: Path, shuffled: bool) -> Scene:
    """Solve on a mesh file, whose nodes and cells are numbered at random if `shuffled`."""
    import meshio

    n, rng = 7, np.random.default_rng(20)
    x, y = np.meshgrid(*[np.linspace(0, 1, n + 1)] * 2)
    points = np.column_stack([x.ravel(), y.ravel()])
    inner = (np.abs(points - 0.5) < 0.49).all(axis=1)
    points[inner] += rng.uniform(-0.2, 0.2, (inner.sum(), 2)) / n
    first = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    far = first + n + 2
    cells = np.vstack(
        [np.column_stack([first, first + 1, far]), np.column_stack([first, far, far - 1])]
    )
    if shuffled:
        order = rng.permutation(len(points))
        place = np.argsort(order)  # new number of each old node
        points, cells = points[order], place[cells][rng.permutation(len(cells))]
        cells = np.roll(cells, 1, axis=1)
    name = "shuffled" if shuffled else "given"
    file = folder / f"{name}.vtu"
    spatial = np.pad(points, ((0, 0), (0, 1)))
    meshio.Mesh(spatial, [("triangle", cells)]).write(file, file_format="vtu")
    return unit_scene(
        f"{name}-mesh",
        file=folder / f"{name}.toml",
        geometry={"kind": "file", "file": file.name, "dimension": 2},
        mesh={"pattern": "given"},
        cuts=[line((-0.1, 0.42), (0.6, 0.57))],
        supports=[held("y < 1e-9", [0.0, 0.0])],
        loads=[weight(0.3, -1.0)],
    )


def unusual() -> list[Scene]:
    """Return valid scenes that a solver may not be able to do."""
    arc = {"kind": "arc", "centre": [0.5, 0.5], "radius": 0.21, "start": 10.0, "sweep": 200.0}
    inner = line((0.23, 0.31), (0.68, 0.57))
    crossing = [
        line((0.13, 0.31), (0.88, 0.77), name="one"), line((0.13, 0.72), (0.88, 0.24), name="two"),
    ]  # fmt: skip
    cases: dict[str, dict[str, Any]] = {
        "dynamics": {
            "analysis": {"kind": "dynamic", "duration": 0.01, "time_step": 0.005}, "cuts": [inner],
        },
        "finite-rotations": {"analysis": {"kinematics": "corotational"}, "cuts": [inner]},
        "inner-cut": {"cuts": [inner]},
        "kinked-cut": {"cuts": [line((0.23, 0.31), (0.51, 0.33), (0.68, 0.77))]},
        "arc": {"cuts": [arc]},
        "crossing-cuts": {"cuts": crossing},
        "cut-along-mesh-lines": {"cuts": [line((-0.1, 0.5), (0.6, 0.5))]},
        "polygon": {
            "geometry": {"kind": "polygon", "corners": [[0.0, 0.0], [1.0, 0.0], [0.4, 0.9]]},
            "mesh": {"pattern": "unstructured", "sizes": [0.2]},
            "cuts": [line((0.3, 0.2), (0.6, 0.3))],
        },
        "space": {
            **in_space([_TILTED_PLANE]),
            "supports": [held("boundary", [0.0, 0.0, 0.0])],
            "loads": [weight(0.0, 0.3, -1.0)],
        },
    }  # fmt: skip
    if find_spec("gmsh") is None:  # a mesh generator that is not there is no fault of a solver
        del cases["polygon"]
    usual = {"supports": [held("boundary", [0.0, 0.0])], "loads": [weight(0.3, -1.0)]}
    return [unit_scene(name, **{**usual, **parts}) for name, parts in cases.items()]
