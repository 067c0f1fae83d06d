"""Arguments of the commands around solvers of others and around regression."""

from pathlib import Path

from verify.cli.shared_arguments import (
    Add,
    add_action,
    add_case,
    add_json,
    add_out,
    add_repetitions,
    add_run,
    add_strict,
    add_timeout,
)


def add_extension_commands(add: Add) -> None:
    """Add ``export``, ``paraview``, ``import``, ``solvers``, ``conform`` and ``baseline``."""
    _add_export(add)
    _add_paraview(add)
    _add_import(add)
    _add_solvers(add)
    _add_conform(add)
    _add_baseline(add)


def _add_export(add: Add) -> None:
    command = add(
        "export",
        "write a case as files for another program: meshes, cuts, supports, loads",
        "examples:\n  verify export statics/f3_inclined --out f3\n"
        "  verify export my_case.toml --out mine --level 0 --conforming\n"
        "  verify export statics/f3_inclined --out f3 --template python\n\n"
        "The program answers in f3/level-<k>/solution.json and .vtu;\n"
        "see docs/guide/your-solver.md.",
    )
    add_case(command)
    add_out(command)
    command.add_argument(
        "--level", metavar="K", dest="levels", type=int, action="append", default=[],
        help="only this mesh level, 0 is the coarsest; repeat for several (default: all)",
    )  # fmt: skip
    command.add_argument(
        "--conforming", action="store_true",
        help="also write meshes that conform to the cuts, with their nodes doubled",
    )  # fmt: skip
    command.add_argument(
        "--template", choices=("python",),
        help="also write a program that answers the case, on a reader and writer that need "
        "numpy alone (with --conforming)",
    )  # fmt: skip
    add_json(command, "print the files as JSON")


def _add_paraview(add: Add) -> None:
    command = add(
        "paraview",
        "write the solutions of a run for ParaView: displacement, strain, stress over time",
        "examples:\n  verify paraview out\n"
        "  verify paraview out --solver xfem --level 0 --reference --out fields\n\n"
        "Open the .pvd files; Warp By Vector with `displacement` shows the deformed body.",
    )
    add_run(command)
    command.add_argument(
        "--out", metavar="DIR", type=Path,
        help="directory to write into (default: the folder paraview in the run)",
    )  # fmt: skip
    command.add_argument(
        "--solver", metavar="NAME", dest="solvers", action="append", default=[],
        help="only of this solver; repeat for several (default: all, and the reference)",
    )  # fmt: skip
    command.add_argument(
        "--level", metavar="K", type=int,
        help="mesh level, 0 is the coarsest (default: the finest of each solver)",
    )  # fmt: skip
    command.add_argument(
        "--reference", dest="with_reference", action="store_true",
        help="add the displacement of the reference and the error against it",
    )  # fmt: skip
    add_json(command, "print the files as JSON")


def _add_import(add: Add) -> None:
    command = add(
        "import",
        "compare and judge the answers of another program",
        "examples:\n  verify import statics/f3_inclined f3 --solver freefem --out run\n"
        "  verify import statics/f3_inclined f3 --solver freefem --beside xfem --out run\n\n"
        "Exit codes are those of `verify run`.",
    )
    add_case(command)
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
        "--judged-as", metavar="NAME",
        help="checks that the case makes of this solver by its name are made of the program too",
    )  # fmt: skip
    add_timeout(command, 600.0, "a solve beside it is killed")
    add_repetitions(command, 1, what="timed repetitions of the solves beside it")
    add_strict(command)
    add_json(command, "print the verdicts as JSON")


def _add_solvers(add: Add) -> None:
    command = add(
        "solvers",
        "list, install or remove solvers of others",
        "examples:\n  verify solvers list\n  verify solvers install ngsxfem\n"
        "  verify run statics/f3_inclined --solver xfem --solver ngsxfem --out out\n"
        "  verify solvers remove ngsxfem\n\n"
        "Each has a virtual environment of its own, in $VERIFY_SOLVERS or else below the user's\n"
        "data folder; its packages are locked by their hashes. Exit code 2 if an installation\n"
        "fails; nothing of it is left then.",
    )
    command.set_defaults(action="list", json=False)
    actions = command.add_subparsers(metavar="ACTION", dest="action", help="default: list")
    add_json(add_action(actions.add_parser, "list", "say which there are, and which are here"))
    action = add_action(actions.add_parser, "install", "install one from its locked packages")
    action.add_argument("name", metavar="NAME", help="name of the solver")
    action.add_argument(
        "--python", metavar="PYTHON",
        help="interpreter to use; of a package of the system, the one that has it",
    )  # fmt: skip
    action = add_action(actions.add_parser, "remove", "remove an installed one")
    action.add_argument("name", metavar="NAME", help="name of the solver")


def _add_conform(add: Add) -> None:
    command = add(
        "conform",
        "check a solver on what holds for every right solver, before it is ranked",
        "examples:\n  verify conform xfem\n  verify conform xfem --set tip=partial\n"
        "  verify conform my_module:MySolver --json\n\n"
        "exit codes:\n"
        "  0  every check that the solver did not refuse passes, or is off as it states\n"
        "  1  a check fails\n"
        "  2  no such solver, or it cannot be loaded\n"
        "  3  the solver crashed, hung or failed on a scene that it did not refuse\n"
        "  4  it refused everything",
    )
    command.add_argument(
        "solver", metavar="'SOLVER [PARAMETER=VALUE …]'", help="name of a solver, or module:Class"
    )
    command.add_argument(
        "--set", metavar="NAME=VALUE", dest="parameters", action="append", default=[],
        help="parameter of the solver; repeat for several",
    )  # fmt: skip
    command.add_argument(
        "--check", metavar="NAME", dest="checks", action="append", default=[],
        help="only this check; repeat for several (default: all)",
    )  # fmt: skip
    add_timeout(command, 120.0)
    add_json(command, "print the checks as JSON")


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
        action = add_action(actions.add_parser, name, text)
        add_run(action)
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
            add_strict(action, "what is undecided: exit code 5")
            action.add_argument(
                "--partial", action="store_true",
                help="leave out cases of the file that the run was not asked for",
            )  # fmt: skip
        add_json(action)
    text = "show which verdicts differ between two runs"
    action = add_action(actions.add_parser, "diff", text)
    add_run(action, "run", "OLD")
    add_run(action, "other", "NEW")
    add_json(action)
