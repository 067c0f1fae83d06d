"""Arguments of ``verify study``."""

import argparse
import os
from collections.abc import Callable

from verify.cli.argument_types import count, positive, seed
from verify.cli.shared_arguments import (
    Add,
    add_action,
    add_case,
    add_json,
    add_out,
    add_repetitions,
)


def add_study_command(add: Add) -> None:
    """Add ``study`` to the command line."""
    command = add(
        "study",
        "measure what slivers do, what accuracy costs, where an error comes from, and more",
        "examples:\n  verify study slivers --quick --out studies\n"
        "  verify study slivers --solver xfem --solver 'xfem slivers=merge' --out studies\n"
        "  verify study energy --solver my_module:MySolver --out studies\n"
        "  verify study thesis --quick --out studies\n"
        "  verify study calibration --quick --out studies\n"
        "  verify study cost statics/tissue_strip --steps 4 --solver xfem --solver conforming "
        "--out studies\n"
        "  verify study budget statics/tissue_strip --tolerance 0.05 --out studies\n\n"
        "Writes NAME.json, NAME.csv and NAME.html into the directory. Exit code 0 whatever the\n"
        "findings say: they compare methods, most of which are known to fail somewhere.",
    )
    kinds = command.add_subparsers(metavar="STUDY", dest="study", required=True)
    for name, text in {
        "slivers": "errors, conditioning and explicit steps of any solver, over families of scenes",
        "energy": "what any solver keeps of energy and momenta, over cases that move",
        "thesis": "the tables and figures of the thesis measured again, its claims judged",
        "calibration": "stated uncertainty of the reference against its true error",
    }.items():
        kind = add_action(kinds.add_parser, name, text)
        if name in ("slivers", "energy"):
            tagged = "cases/slivers" if name == "slivers" else "those tagged energy"
            kind.add_argument(
                "cases", metavar="CASE", nargs="*", help=f"names, patterns or files; none: {tagged}"
            )
            kind.add_argument(
                "--solver", metavar="'NAME [PARAMETER=VALUE …]'", action="append", dest="solvers",
                default=[], help="solver, with parameters of its solves; repeat for several "
                "(default: xfem and conforming)",
            )  # fmt: skip
            cores = len(os.sched_getaffinity(0))
            kind.add_argument(
                "-j", "--jobs", metavar="N", type=count, default=cores, dest="processes",
                help="processes side by side (default: all cores; nothing measured is a time)",
            )  # fmt: skip
        if name == "calibration":
            kind.add_argument(
                "--seed", metavar="N", type=seed, default=30, help="of the scenes (default: 30)"
            )
        kind.add_argument("--quick", action="store_true", help="less of it, in under a minute")
        add_out(kind)
        add_json(kind, "print the findings as JSON")
    _add_cost(kinds.add_parser)
    _add_budget(kinds.add_parser)
    _add_iterations(kinds.add_parser)


def _add_cost(add: Callable[..., argparse.ArgumentParser]) -> None:
    kind = add_action(
        add, "cost", "work against precision while the first cut of a case grows, at equal accuracy"
    )
    add_case(kind)
    kind.add_argument(
        "--steps", metavar="N", type=count, default=4, help="steps of the cut (default: 4)"
    )
    kind.add_argument(
        "--solver", metavar="NAME", action="append", dest="solvers", default=[],
        help="solver to compare; repeat for several (default: xfem and conforming, which "
        "remeshes at every step)",
    )  # fmt: skip
    kind.add_argument(
        "--metric", default="energy_norm", choices=("displacement_l2", "energy_norm", "jump_l2"),
        help="the error that is held equal (default: energy_norm)",
    )  # fmt: skip
    add_repetitions(kind, 5)
    add_out(kind)
    add_json(kind, "print the findings as JSON")


def _add_budget(add: Callable[..., argparse.ArgumentParser]) -> None:
    kind = add_action(
        add, "budget",
        "where the error of the XFEM answer comes from, and the cheapest adequate model",
    )  # fmt: skip
    add_case(kind)
    kind.add_argument(
        "--level", metavar="K", type=int, help="mesh level that is taken apart (default: finest)"
    )
    kind.add_argument(
        "--tolerance", metavar="T", type=positive, default=0.05,
        help="relative error that is good enough (default: 0.05)",
    )  # fmt: skip
    kind.add_argument(
        "--metric",
        help="displacement_l2, energy_norm (in motion their means, displacement_l2_mean, "
        "energy_norm_mean) or a quantity of the case (default: the first of these)",
    )  # fmt: skip
    add_repetitions(kind, None, "5; with --quick 2")
    kind.add_argument(
        "--quick", action="store_true", help="the two coarsest mesh levels, fewer models"
    )
    add_out(kind)
    add_json(kind, "print the findings as JSON")


def _add_iterations(add: Callable[..., argparse.ArgumentParser]) -> None:
    kind = add_action(
        add, "iterations", "a solver of motion that stops by a count: its error, energy and cost"
    )
    add_case(kind)
    kind.add_argument(
        "--solver", metavar="'NAME [PARAMETER=VALUE …]'", default="vbd",
        help="solver, with parameters of its solves (default: vbd)",
    )  # fmt: skip
    kind.add_argument(
        "--truth", metavar="'NAME [PARAMETER=VALUE …]'",
        help="who solves the same steps (default: the solver with step=solved)",
    )  # fmt: skip
    for name, counts in (("iterations", [10, 40, 160]), ("substeps", [1, 4])):
        kind.add_argument(
            f"--{name}", metavar="N", type=count, nargs="+", default=counts,
            help=f"values of the parameter '{name}' (default: {' '.join(map(str, counts))})",
        )  # fmt: skip
    kind.add_argument(
        "--most", metavar="N", type=count,
        help="leave out settings with more iterations than this in a step of the case",
    )  # fmt: skip
    kind.add_argument(
        "--names", nargs=2, metavar="PARAMETER", default=["iterations", "substeps"],
        help="what the solver calls them (default: iterations substeps)",
    )  # fmt: skip
    kind.add_argument(
        "--tolerance", metavar="T", type=positive, default=0.01,
        help="relative error that is good enough (default: 0.01)",
    )  # fmt: skip
    add_out(kind)
    add_json(kind, "print the findings as JSON")
