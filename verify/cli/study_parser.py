"""Arguments of ``verify study``."""

import argparse
from collections.abc import Callable
from pathlib import Path

__all__ = ["add_study_command"]


def add_study_command(add: Callable[[str, str, str], argparse.ArgumentParser]) -> None:
    """Add ``study`` to the command line."""
    command = add(
        "study",
        "measure what slivers do, or whether energy and momenta are kept",
        "examples:\n  verify study slivers --quick --out studies\n"
        "  verify study slivers --dimension 2 --out studies\n"
        "  verify study energy --out studies\n\n"
        "Writes NAME.json, NAME.csv and NAME.html into the directory. Exit code 0 whatever the\n"
        "findings say: they compare methods, most of which are known to fail somewhere.",
    )
    kinds = command.add_subparsers(metavar="STUDY", dest="study", required=True)
    for name, text in {
        "slivers": "conditioning, explicit steps, errors and compliance against sliver size",
        "energy": "falls and spins of cut bodies, by lumping and scheme",
    }.items():
        kind = kinds.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        if name == "slivers":
            kind.add_argument(
                "--dimension", type=int, choices=(2, 3), help="only 2D or 3D (default: both)"
            )
        kind.add_argument("--quick", action="store_true", help="less of it, in under a minute")
        kind.add_argument(
            "--out", metavar="DIR", type=Path, required=True, help="directory to write into"
        )
        kind.add_argument("--json", action="store_true", help="print the findings as JSON")
