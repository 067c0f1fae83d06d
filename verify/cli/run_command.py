"""``verify run``: the server that solves are forked from loads while this one does."""

import argparse
from importlib import import_module

from verify.processes import start_server


def execute(arguments: argparse.Namespace) -> int:
    """Run the cases."""
    guests = bool(arguments.solvers) and all(":" in name for name in arguments.solvers)
    if not guests:
        start_server()
    code: int = import_module("verify.cli.running").execute(arguments)
    return code
