"""``verify list``: the cases, or the exact solutions."""

import argparse
import json
from typing import Any

from verify.errors import InputError
from verify.runner.selection import parse_expression
from verify.scene import list_cases, load_scenes


def execute(arguments: argparse.Namespace) -> int:
    """Print one line per case; a case file that is broken is listed with its fault."""
    rows = _exact_solutions() if arguments.exact else _cases(arguments.expression)
    if arguments.json:
        print(json.dumps(rows, indent=2, ensure_ascii=False))
        return 0
    if not rows:
        print("no case matches" if arguments.expression else "no cases")
        return 0
    width = max(len(row["name"]) for row in rows)
    for row in rows:
        tags = f"  [{', '.join(row['tags'])}]" if row.get("tags") else ""
        print(f"{row['name']:<{width}}  {row['title']}{tags}")
    return 0


def _cases(expression: str | None) -> list[dict[str, Any]]:
    wanted = parse_expression(expression) if expression is not None else None
    rows: list[dict[str, Any]] = []
    for name, path in list_cases().items():
        try:
            scenes = load_scenes(path)
        except InputError as error:
            rows.append({"name": name, "title": f"BROKEN: {error}", "tags": []})
            continue
        rows += [
            {
                "name": scene.name,
                "title": scene.title,
                "requirement": scene.requirement,
                "tags": scene.tags,
                "levels": scene.mesh.count,
                "dimension": scene.dimension,
                "file": str(path),
            }
            for scene in scenes
            if wanted is None or wanted(scene)
        ]
    return rows


def _exact_solutions() -> list[dict[str, Any]]:
    from reference.exact import exact_solution_names

    return [{"name": name, "title": text} for name, text in exact_solution_names().items()]
