"""``verify check``: every file gets a line, whether good or bad."""

import argparse
import json
import sys

from verify.errors import InputError
from verify.printable import one_line
from verify.runner.checking import check_scene
from verify.scene import load_scenes

__all__ = ["execute"]


def execute(arguments: argparse.Namespace) -> int:
    """Validate the files; 2 if one is bad."""
    rows = [_row(file) for file in arguments.files]
    if arguments.json:
        print(json.dumps(rows, indent=2))
    else:
        for row in rows:
            if row["error"]:
                print(f"verify: error: {row['error']}", file=sys.stderr)
            else:
                print(f"{row['file']}: ok ({row['title']})")
    return 2 if any(row["error"] for row in rows) else 0


def _row(file: str) -> dict[str, str | None]:
    try:
        scenes = load_scenes(file)
        for scene in scenes:
            check_scene(scene)
    except InputError as error:
        return {"file": file, "title": None, "error": one_line(error)}
    rows = f" and {len(scenes) - 1} more rows" if len(scenes) > 1 else ""
    return {"file": file, "title": f"{scenes[0].title}{rows}", "error": None}
