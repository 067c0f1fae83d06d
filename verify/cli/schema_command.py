"""``verify schema``."""

import argparse
import json

from verify.scene import scene_schema


def execute(arguments: argparse.Namespace) -> int:
    """Print the JSON Schema of a case file."""
    print(json.dumps(scene_schema(), indent=2, ensure_ascii=False))
    return 0
