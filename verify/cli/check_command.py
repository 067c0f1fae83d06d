"""``verify check``: every file gets a line, whether good or bad."""

import argparse
import json
import sys
from dataclasses import asdict
from typing import Any

from verify.cli.cost_text import case_lines, costs_of, memory_line
from verify.errors import InputError
from verify.printable import one_line
from verify.runner.checking import check_scene
from verify.runner.cost import LevelCost, body_text
from verify.runner.fingerprint import cache_folder
from verify.runner.mesh_faults import mesh_warning
from verify.runner.selection import Options
from verify.scene import load_scenes


def execute(arguments: argparse.Namespace) -> int:
    """Validate the files; 2 if one is bad."""
    options = Options()
    rows = [_row(file, options) for file in arguments.files]
    if arguments.json:
        print(json.dumps(rows, indent=2))
    else:
        for row in rows:
            if row["error"]:
                print(f"verify: error: {row['error']}", file=sys.stderr)
            else:
                print(f"{row['file']}: ok ({row['title']})")
                if row["body"]:
                    print(f"  body: {row['body']}")
                costs = [LevelCost(**one) for one in row["cost"]]
                for line in case_lines(costs):
                    print(f"  {line}")
                for warning in filter(None, [memory_line(costs), row["warning"]]):
                    print(f"verify: {row['file']}: warning: {warning}", file=sys.stderr)
    if not arguments.json and not cache_folder().exists():  # nothing was ever run here
        print("which suite first: `verify run -k demo` (a minute) shows that all works here")
    return 2 if any(row["error"] for row in rows) else 0


def _row(file: str, options: Options) -> dict[str, Any]:
    try:
        scenes = load_scenes(file)
        for scene in scenes:
            check_scene(scene)
    except InputError as error:
        error_row = {"title": None, "error": one_line(error), "body": "", "warning": ""}
        return {"file": file, **error_row, "cost": []}
    rows = f" and {len(scenes) - 1} more rows" if len(scenes) > 1 else ""
    cost = [asdict(one) for scene in scenes for one in costs_of(scene, options)]
    return {
        "file": file,
        "title": f"{scenes[0].title}{rows}",
        "error": None,
        "body": body_text(scenes[0]),
        "warning": mesh_warning(scenes[0]),
        "cost": cost,
    }
