"""``verify conform``: the process that solves are forked from loads while this one does."""

import argparse
from contextlib import nullcontext
from importlib import import_module

from verify.warm import warm_parent


def execute(arguments: argparse.Namespace) -> int:
    """Run the suite on one solver and print a line per check."""
    with nullcontext() if ":" in arguments.solver else warm_parent():
        code: int = import_module("verify.cli.conformance_table").execute(arguments)
        return code
