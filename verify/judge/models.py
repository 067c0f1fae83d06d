"""Models of one problem: its scene with a part changed, and what a cheaper model costs in error.

The cost is the difference of two references: that of the scene, and that of the cheaper or richer
model.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from verify.compare.body import body_of
from verify.compare.cut_deviation import polylines_of, triangles_of
from verify.compare.errors import Rules
from verify.compare.hooke import law_of
from verify.errors import InputError, UnsupportedSceneError
from verify.geometry.planar import polygon_area
from verify.judge.intervals import quotient_half_width
from verify.judge.reference import compared_size, conforming_reference
from verify.result import CaseResult, Notice, NoticeKind
from verify.scene import Box, Polygon, Rectangle, Scene
from verify.solution import Solution

Array = NDArray[np.float64]


def with_kinematics(scene: Scene, kinematics: str) -> Scene:
    """Return `scene` in ``"linear"`` or ``"corotational"`` kinematics, without acceptance.

    Linear kinematics are those of Hooke's law.

    Raises
    ------
    UnsupportedSceneError
        If it is a membrane, which has no linear kinematics to begin a budget with.
    """
    if scene.cell_dimension < scene.dimension:
        raise UnsupportedSceneError(
            "the error of a membrane is not taken apart: it has no linear kinematics to begin with"
        )
    changes: dict[str, Any] = {"analysis": {"kinematics": kinematics}}
    if kinematics == "linear":
        changes["material"] = {"model": "hooke"}
    return changed(scene, kinematics, changes)


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


_DIVISIONS = {2: 12, 3: 4}  # of the body's extent: elements of a reference that names no size
_COARSER = {2: 3.0, 3: 1.5}
_OTHER = {"linear": "corotational", "corotational": "linear"}
_WORDS = {"linear": "linear kinematics", "corotational": "finite rotation"}


def other_scene(scene: Scene, model: str) -> Scene:
    """Return a scene with the other kinematics or material, or at rest under its last loads.

    Its reference is coarser.

    Raises
    ------
    UnsupportedSceneError
        If it has no such scene.
    """
    if model == "motion":
        return _coarser(at_rest(scene))
    if model == "material":
        other = "neo_hookean" if scene.material.model == "hooke" else "hooke"
        return _coarser(changed(scene, other, {"material": {"model": other}}))
    return _coarser(with_kinematics(scene, _OTHER[scene.analysis.kinematics]))


def _coarser(scene: Scene) -> Scene:
    """Return a scene whose reference is coarser and has three levels: per cents are wanted."""
    levels: dict[str, object] = {"levels": 3, "max_levels": None}
    size = scene.reference.size
    if size is None:
        body = scene.geometry
        if isinstance(body, Rectangle | Polygon):
            size = abs(polygon_area(body.outline())) ** 0.5 / _DIVISIONS[2]
        elif isinstance(body, Box):
            size = float(np.prod(np.subtract(body.upper, body.lower))) ** (1 / 3) / _DIVISIONS[3]
    if size is not None:
        levels["size"] = _COARSER[scene.dimension] * size
    other = scene.model_copy(update={"reference": scene.reference.model_copy(update=levels)})
    other._file, other._name = scene.file, scene.name
    return other


def adequacy_notice(
    scene: Scene, model: str, solutions: Mapping[int, Solution], result: CaseResult
) -> Notice:
    """State in one line how far the cheaper model is off in the quantities of both references.

    Parameters
    ----------
    scene : Scene
    model : str
        A name of `Adequacy.models`.
    solutions : mapping of int to Solution
        The reference's of the other model, by level.
    result : CaseResult
        Of the case: what its own reference says of the quantities.
    """
    cheap, rich, own_is_cheap = _models(scene, model)
    try:
        differences = _differences(scene, model, solutions, result, own_is_cheap)
    except (InputError, UnsupportedSceneError) as problem:
        text = f"{cheap} was not measured against {rich}: {problem}"
        return Notice(NoticeKind.ADEQUACY, model, None, text)
    said = ", ".join(_share(*pair) + f" in {name}" for name, pair in differences)
    against = f"against {rich}" if own_is_cheap else f"instead of {rich}"
    return Notice(NoticeKind.ADEQUACY, model, None, f"{cheap} {against}: {said}")


def _models(scene: Scene, model: str) -> tuple[str, str, bool]:
    """Words for the cheaper and the richer model, and whether the scene asks for the cheaper."""
    if model == "motion":
        return "the static answer", "the end of the motion", False
    if model == "material":
        return "Hooke's law", "neo-Hookean material", scene.material.model == "hooke"
    return _WORDS["linear"], _WORDS["corotational"], scene.analysis.kinematics == "linear"


def _differences(
    scene: Scene,
    model: str,
    solutions: Mapping[int, Solution],
    result: CaseResult,
    own_is_cheap: bool,
) -> list[tuple[str, tuple[float, float]]]:
    """Differences and their half-widths over the richer values, by quantity, the largest first."""
    other = other_scene(scene, model)
    body = body_of(other)
    size = min((compared_size(one, body) for one in solutions.values()), default=body.size / 50)
    rules = Rules(body, size)
    known = conforming_reference(other, solutions, body, law_of(other), rules).quantities
    found = []
    for asked in scene.quantities:
        metric = next(
            (m for solve in result.solves if (m := solve.metric(asked.name)) and m.source), None
        )
        late = model != "motion" or getattr(asked, "time", None) is None
        if metric is None or metric.reference is None or asked.name not in known or not late:
            continue
        own = metric.reference, metric.uncertainty
        (poor, poor_width), (rich, width) = (
            (own, known[asked.name]) if own_is_cheap else (known[asked.name], own)
        )
        if rich == 0.0:
            continue
        share = quotient_half_width(poor - rich, poor_width + width, rich, width)
        found.append((asked.name, (abs(poor - rich) / abs(rich), share)))
    if not found:
        raise UnsupportedSceneError("no quantity of the case is known of both")
    return sorted(found, key=lambda row: -row[1][0])


def _share(error: float, width: float) -> str:
    """Write an error in per cent, to two digits; or that it is below what is known."""
    if not np.isfinite(error + width):
        return "an unknown difference"
    if error <= width:
        return f"no more than {100 * (error + width):.2g} %"
    digits = max(0, 1 - int(np.floor(np.log10(100 * error))))
    return f"{100 * error:.{digits}f} % (± {100 * width:.1g} %)"
