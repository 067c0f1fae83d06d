"""``verify paraview``: the solutions of a run as files for ParaView."""

import argparse
import json

from verify.exchange import export_fields


def execute(arguments: argparse.Namespace) -> int:
    """Write a ``.pvd`` per case and solver, with its fields at each output time."""
    out = arguments.out or arguments.run / "paraview"
    files = export_fields(
        arguments.run, out, arguments.solvers, arguments.level, arguments.with_reference
    )
    names = [str(file) for file in files]
    print(json.dumps({"files": names}, indent=2) if arguments.json else "\n".join(names))
    return 0
