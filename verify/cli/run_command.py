"""``verify run``: the process that solves are forked from loads while this one does."""

import argparse
from contextlib import nullcontext
from importlib import import_module

from verify.warm import warm_parent


def execute(arguments: argparse.Namespace) -> int:
    """Run the cases."""
    guests = bool(arguments.solvers) and all(":" in name for name in arguments.solvers)
    with nullcontext() if guests else warm_parent():
        code: int = import_module("verify.cli.running").execute(arguments)
        return code
