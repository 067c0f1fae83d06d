"""``verify export``: a case as files for programs that are not written in Python."""

import argparse
import json

from verify.exchange import export_case
from verify.foreign.template import write_template
from verify.scene import load_scene


def execute(arguments: argparse.Namespace) -> int:
    """Write mesh, cuts, supports and loads of a case."""
    scene = load_scene(arguments.case)
    conforming = arguments.conforming or arguments.template is not None
    files = export_case(scene, arguments.out, arguments.levels or None, conforming)
    if arguments.template:
        files += write_template(arguments.out)
    if arguments.json:
        print(json.dumps({"case": scene.name, "files": [str(file) for file in files]}, indent=2))
        return 0
    for file in files:
        print(file)
    print(
        f"answer in {arguments.out}/level-<k>/solution.json and .vtu, then: "
        f"verify import {arguments.case} {arguments.out} --solver NAME --out RUN"
    )
    return 0
