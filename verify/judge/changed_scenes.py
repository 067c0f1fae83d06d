"""Scenes that differ from a given one in one thing: its kinematics, cut, mesh, step, or motion."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from verify.compare.cut_deviation import polylines_of, triangles_of
from verify.errors import UnsupportedSceneError
from verify.scene import Scene

Array = NDArray[np.float64]


def with_kinematics(scene: Scene, kinematics: str) -> Scene:
    """Return `scene` in ``"linear"`` or ``"corotational"`` kinematics, without acceptance.

    Raises
    ------
    UnsupportedSceneError
        If it is a membrane, which has no linear kinematics to begin a budget with.
    """
    if scene.cell_dimension < scene.dimension:
        raise UnsupportedSceneError(
            "the error of a membrane is not taken apart: it has no linear kinematics to begin with"
        )
    return changed(scene, kinematics, {"analysis": {"kinematics": kinematics}})


def coarsest(scene: Scene, count: int) -> Scene:
    """Return `scene` with its first `count` mesh levels only, under its own name."""
    return changed(scene, "", {"mesh": _levels(scene, slice(0, count))})


def on_one_level(scene: Scene, level: int) -> Scene:
    """Return `scene` with one of its mesh levels only."""
    return changed(scene, f"level-{level}", {"mesh": _levels(scene, slice(level, level + 1))})


def with_time_step(scene: Scene, step: float) -> Scene:
    """Return a dynamic `scene` with another largest time step, s."""
    return changed(scene, f"step-{step:.3g}", {"analysis": {"time_step": step}})


def at_rest(scene: Scene) -> Scene:
    """Return the static scene of what a dynamic one ends with.

    Supports and loads have the last factors of their histories, and all cuts are open.
    """
    content = scene.model_dump(mode="json", by_alias=True)
    update: dict[str, Any] = {
        "analysis": {"kind": "static", "duration": None, "time_step": None, "outputs": None,
                     "damping": [0.0, 0.0]},
        "initial": {"kind": "rest"},
        "cuts": [{**cut.model_dump(mode="json"), "opens_at": 0.0} for cut in scene.final_cuts],
        "quantities": [
            {key: value for key, value in q.items() if key != "time"} for q in content["quantities"]
        ],
    }  # fmt: skip
    for key, value in (("supports", "displacement"), ("loads", "traction")):
        update[key] = [_at_last(part, value) for part in content[key]]
    return changed(scene, "static", update)


def on_realised_cut(scene: Scene, facets: Array, level: int, kinematics: str) -> Scene:
    """Return `scene` with the cuts that a solver realised on mesh `level`, and that level only.

    Parameters
    ----------
    scene : Scene
    facets : (f, d, d) array
        ``Solution.cut_facets``, m: segments, joined to polylines; in space triangles, of which
        each becomes a cut.
    level : int
        The mesh level that becomes the only one.
    kinematics : str

    Raises
    ------
    UnsupportedSceneError
        If its cuts open at different times, or a part of the realised cut can be none of a scene.
    """
    if any(cut.on_the_way for cut in scene.cuts):
        raise UnsupportedSceneError("a realised cut does not say when the blade passes")
    opens = {float(getattr(cut, "opens_at", 0.0)) for cut in scene.cuts}
    if len(opens) > 1:
        raise UnsupportedSceneError(
            "its cuts open at different times, and the realised cut does not say which is which"
        )
    plane = scene.dimension == 2
    kind, parts = ("polyline", polylines_of(facets)) if plane else ("polygon", triangles_of(facets))
    cuts = [
        {"kind": kind, "name": f"realised{i}", "points": part.tolist(), "opens_at": when}
        for when in opens
        for i, part in enumerate(parts)
    ]
    energy = [{"kind": "strain_energy"}]  # the others may speak of a cut by its old name
    changes = {"cuts": cuts, "quantities": energy, "mesh": _levels(scene, slice(level, level + 1))}
    changes["analysis"] = {"kinematics": kinematics}
    try:
        return changed(scene, f"realised-{kinematics}", changes)
    except ValidationError as fault:
        what = fault.errors()[0]["msg"].removeprefix("Value error, ")
        raise UnsupportedSceneError(f"the realised cut is no geometry: {what}") from None


def _levels(scene: Scene, chosen: slice) -> dict[str, Any]:
    if scene.mesh.cells is not None:
        return {"cells": [list(cells) for cells in scene.mesh.cells[chosen]]}
    return {"sizes": scene.mesh.sizes[chosen]} if scene.mesh.sizes is not None else {}


def _at_last(part: dict[str, Any], value: str) -> dict[str, Any]:
    """Return a support or a load with its last factor, for good."""
    kept = {key: entry for key, entry in part.items() if key != "history"}
    history = part.get("history")
    if not history:
        return kept
    factor = float(history[-1][1])
    value = "force" if part.get("kind") == "body_force" else value
    if isinstance(kept[value], str) and factor != 1.0:
        raise UnsupportedSceneError("what is taken from the exact solution has no factor at rest")
    if not isinstance(kept[value], str):
        kept[value] = [factor * entry for entry in kept[value]]
    if kept.get("rotation"):
        kept["rotation"] = {**kept["rotation"], "angle": factor * kept["rotation"]["angle"]}
    return kept


def changed(scene: Scene, name: str, update: dict[str, Any]) -> Scene:
    """Return `scene` with parts of its content replaced, as ``CASE@name``; without acceptance."""
    content = scene.model_dump(mode="json", by_alias=True)
    content |= {"acceptance": [], "known_findings": [], "tags": [], "adequacy": {}}
    for key, value in update.items():
        merged = isinstance(value, dict) and key != "initial"  # of which each kind has its own keys
        content[key] = {**content[key], **value} if merged else value
    changed = Scene.model_validate(content)
    file = scene.file or Path(f"{scene.name}.toml")
    changed.came_from(file, f"{scene.name}@{name}" if name else scene.name)
    return changed
