"""``verify conform``: the server that solves are forked from loads while this one does."""

import argparse
from importlib import import_module

from verify.processes import start_server


def execute(arguments: argparse.Namespace) -> int:
    """Run the suite on one solver and print a line per check."""
    if ":" not in arguments.solver:
        start_server()
    code: int = import_module("verify.cli.conformance_table").execute(arguments)
    return code
