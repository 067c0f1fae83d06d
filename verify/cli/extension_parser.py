"""Arguments of the commands around solvers of others and around regression."""

import argparse
from collections.abc import Callable
from pathlib import Path

from verify.cli.argument_types import count, positive

__all__ = ["add_extension_commands"]

Add = Callable[[str, str, str], argparse.ArgumentParser]


def add_extension_commands(add: Add) -> None:
    """Add ``export``, ``import``, ``conform`` and ``baseline`` to the command line."""
    _add_export(add)
    _add_import(add)
    _add_conform(add)
    _add_baseline(add)


def _add_export(add: Add) -> None:
    command = add(
        "export",
        "write a case as files for another program: meshes, cuts, supports, loads",
        "examples:\n  verify export statics/f3_inclined --out f3\n"
        "  verify export my_case.toml --out mine --level 0 --conforming\n\n"
        "The program answers in f3/level-<k>/solution.json and .vtu; see docs/extending.md.",
    )
    command.add_argument("case", metavar="CASE", help="name of a case, or a case file")
    command.add_argument(
        "--out", metavar="DIR", type=Path, required=True, help="directory to write into"
    )
    command.add_argument(
        "--level", metavar="K", dest="levels", type=int, action="append", default=[],
        help="only this mesh level, 0 is the coarsest; repeat for several (default: all)",
    )  # fmt: skip
    command.add_argument(
        "--conforming", action="store_true",
        help="also write meshes that conform to the cuts, with their nodes doubled",
    )  # fmt: skip
    command.add_argument("--json", action="store_true", help="print the files as JSON")


def _add_import(add: Add) -> None:
    command = add(
        "import",
        "compare and judge the answers of another program",
        "examples:\n  verify import statics/f3_inclined f3 --solver freefem --out run\n"
        "  verify import statics/f3_inclined f3 --solver freefem --beside xfem --out run\n\n"
        "Exit codes are those of `verify run`.",
    )
    command.add_argument("case", metavar="CASE", help="name of a case, or a case file")
    command.add_argument(
        "answers", metavar="DIR", type=Path, help="directory with level-<k>/solution.json"
    )
    command.add_argument(
        "--solver", metavar="NAME", required=True, help="what the program is called in the report"
    )
    command.add_argument(
        "--out", metavar="RUN", type=Path, required=True,
        help="run directory; one of an earlier import of the same case keeps the other programs",
    )  # fmt: skip
    command.add_argument(
        "--beside", metavar="NAME", action="append", default=[],
        help="solver to run beside it; repeat for several (default: those that checks compare "
        "with, and the reference)",
    )  # fmt: skip
    command.add_argument(
        "--judged-as", metavar="NAME", default="xfem",
        help="the checks that the case makes of this solver are made of the program "
        "(default: xfem)",
    )  # fmt: skip
    command.add_argument(
        "--timeout", metavar="S", type=positive, default=600.0,
        help="wall seconds after which a solve beside it is killed (default: 600)",
    )  # fmt: skip
    command.add_argument(
        "--repetitions", metavar="N", type=count, default=1,
        help="timed repetitions of the solves beside it (default: 1)",
    )  # fmt: skip
    command.add_argument(
        "--strict", action="store_true", help="undecided verdicts and refusals: exit code 5"
    )
    command.add_argument("--json", action="store_true", help="print the verdicts as JSON")


def _add_conform(add: Add) -> None:
    command = add(
        "conform",
        "check that a solver keeps what every right solver keeps, before it is ranked",
        "examples:\n  verify conform xfem\n  verify conform xfem --set basis=shifted\n"
        "  verify conform my_module:MySolver --json\n\n"
        "exit codes:\n"
        "  0  every check that the solver did not refuse is kept\n"
        "  1  a check is broken\n"
        "  2  no such solver, or it cannot be loaded\n"
        "  3  the solver crashed, hung or failed on a scene that it did not refuse\n"
        "  4  it refused everything",
    )
    command.add_argument("solver", metavar="SOLVER", help="name of a solver, or module:Class")
    command.add_argument(
        "--set", metavar="NAME=VALUE", dest="parameters", action="append", default=[],
        help="parameter of the solver; repeat for several",
    )  # fmt: skip
    command.add_argument(
        "--check", metavar="NAME", dest="checks", action="append", default=[],
        help="only this check; repeat for several (default: all)",
    )  # fmt: skip
    command.add_argument(
        "--timeout", metavar="S", type=positive, default=120.0,
        help="wall seconds after which a solve is killed (default: 120)",
    )  # fmt: skip
    command.add_argument("--json", action="store_true", help="print the checks as JSON")


def _add_baseline(add: Add) -> None:
    command = add(
        "baseline",
        "hold a finished run against stored values: did anything get worse?",
        "examples:\n  verify run -k quick --out out\n"
        "  verify baseline save out --file baseline.json\n"
        "  verify baseline check out --file baseline.json\n"
        "  verify baseline update out --file baseline.json --only statics/f1_patch:strain_energy\n"
        "  verify baseline diff old-run new-run\n\n"
        "exit codes of check and update:\n"
        "  0  everything within its tolerances\n"
        "  1  something is worse, or an update contradicts the independent value\n"
        "  2  bad input\n"
        "  3  something could not be checked: its solve failed, its case was not run or changed\n"
        "  5  with --strict: something is undecided\n"
        "exit codes of diff: 0, or 1 if a verdict became worse",
    )
    actions = command.add_subparsers(metavar="ACTION", dest="action", required=True)
    for name, text in {
        "save": "add what the file does not know yet; nothing in it changes",
        "check": "compare a finished run with the file",
        "update": "move own values that are named, never the independent ones",
    }.items():
        action = actions.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
        action.add_argument("run", metavar="RUN", type=Path, help="directory of a finished run")
        action.add_argument(
            "--file", metavar="FILE", type=Path, default=Path("baseline.json"),
            help="the baseline, to be committed (default: baseline.json)",
        )  # fmt: skip
        if name == "update":
            action.add_argument(
                "--only", metavar="CASE:METRIC", action="append", default=[],
                help="what to move: CASE:METRIC or CASE:SOLVER/LEVEL/METRIC; repeat for several; "
                "without it the difference is shown and nothing is moved",
            )  # fmt: skip
        if name == "check":
            action.add_argument(
                "--strict", action="store_true", help="what is undecided: exit code 5"
            )
            action.add_argument(
                "--partial", action="store_true",
                help="leave out cases of the file that the run was not asked for",
            )  # fmt: skip
        action.add_argument("--json", action="store_true", help="print JSON")
    text = "show which verdicts differ between two runs"
    action = actions.add_parser("diff", help=text, description=f"{text[0].upper()}{text[1:]}.")
    action.add_argument("run", metavar="OLD", type=Path, help="directory of a finished run")
    action.add_argument("other", metavar="NEW", type=Path, help="directory of a finished run")
    action.add_argument("--json", action="store_true", help="print JSON")
