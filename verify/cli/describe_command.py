"""``verify describe``: a case in words."""

import argparse
import json
import textwrap
from typing import Any

from verify.errors import InputError
from verify.runner.cost import body_text
from verify.scene import Scene, load_scene, scene_hash


def execute(arguments: argparse.Namespace) -> int:
    """Print what a case asks."""
    scene = load_scene(arguments.case)
    if arguments.json:
        print(json.dumps(scene.model_dump(mode="json", by_alias=True), indent=2))
    else:
        print(description(scene))
    return 0


def description(scene: Scene) -> str:
    """Return the case in words: requirement, body, cuts, supports, loads, what is judged."""
    parts: list[tuple[str, list[str]]] = [
        ("tags", [", ".join(scene.tags)] if scene.tags else []),
        ("body", [_keys(scene.geometry), *filter(None, [_size(scene)])]),
        ("material", [_keys(scene.material)]),
        ("mesh", [_mesh(scene)]),
        ("cuts", [f"{cut.name}: {_keys(cut, 'name', 'opens_at')}" for cut in scene.cuts]),
        ("supports", [_keys(support) for support in scene.supports]),
        ("loads", [_keys(load) for load in scene.loads]),
        ("analysis", [_keys(scene.analysis, "damping")]),
        ("initially", [_keys(scene.initial)] if scene.analysis.kind == "dynamic" else []),
        ("measured", [_keys(quantity) for quantity in scene.quantities]),
        ("judged by", [_judge(scene)]),
        ("accepted if", [_demand(check) for check in scene.acceptance] or ["nothing is judged"]),
        (
            "known",
            [
                f"{f.check} of {f.metric} fails with {f.solver}: {f.reason}"
                for f in scene.known_findings
            ],
        ),
        ("hash", [scene_hash(scene)]),
    ]
    lines = [scene.name, scene.title, "", textwrap.fill(scene.requirement, 92), ""]
    for name, entries in parts:
        for i, entry in enumerate(entries):
            lines.append(
                textwrap.fill(
                    entry,
                    92,
                    initial_indent=f"{name if i == 0 else '':<12}",
                    subsequent_indent=" " * 14,
                )
            )
    return "\n".join(lines)


def _size(scene: Scene) -> str:
    try:
        return body_text(scene)
    except (InputError, OSError) as error:  # a case is described without its mesh file, too
        return str(error)


def _demand(check: Any) -> str:
    """Say an acceptance check as the end of "accepted if …"."""
    what = f"{check.metric} of {check.solver or 'each solver'}"
    match check.check:
        case "value":
            within = f"within {check.relative_tolerance:g} relative"
            return f"{what} is {check.equals:.10g} {within} ({check.source})"
        case "error":
            return f"error in {what} is at most {check.at_most:g} on the finest mesh"
        case "rate" if check.equals is not None:
            return f"order of {what} is {check.equals:g} within {check.within:g}"
        case "rate":
            return f"order of {what} is at least {check.at_least:g}"
        case "ratio" if check.within is not None:
            return f"{what} over {_other(check)} is 1 within {check.within:g} on every mesh"
        case "ratio":
            return f"{what} over {_other(check)} is at most {check.at_most:g} on every mesh"
    return _keys(check)


def _other(check: Any) -> str:
    return f"that of {check.to if check.row is None else f'the row {check.row:g}'}"


def _keys(part: Any, *without: str) -> str:
    said = part.model_dump(mode="json", by_alias=True, exclude_none=True, exclude=set(without))
    head = said.pop("kind", said.pop("check", ""))
    body = ", ".join(f"{key} {_value(value)}" for key, value in said.items() if value != {})
    return f"{head}{': ' if head and body else ''}{body}"


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list):
        shown = value if len(value) <= 8 else [*value[:3], "…", value[-1]]
        return f"({', '.join(_value(entry) for entry in shown)})"
    return str(value)


def _mesh(scene: Scene) -> str:
    if scene.mesh.pattern == "given":
        return "as given, 1 level"
    levels = [_value(list(level)) for level in scene.mesh.cells or []]
    levels += [f"h = {size:g} m" for size in scene.mesh.sizes or []]
    return f"{scene.mesh.pattern}, {scene.mesh.count} levels: {', '.join(levels)}"


def _judge(scene: Scene) -> str:
    if scene.judged_by_exact and scene.exact is not None:
        return f"exact solution '{scene.exact.solution}'"
    levels = scene.reference
    return f"conforming reference, P{levels.degree}, {levels.levels} levels, with its uncertainty"
