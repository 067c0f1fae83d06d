"""The command line: sub-commands, options, and help that teaches by example."""

import argparse
import sys
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from verify import __version__
from verify.cli.argument_types import count, positive
from verify.cli.cache_parser import add_cache_command
from verify.cli.extension_parser import add_extension_commands
from verify.cli.play_parser import add_play_command
from verify.cli.shared_arguments import (
    Add,
    add_case,
    add_json,
    add_repetitions,
    add_strict,
    add_timeout,
    sentence,
)
from verify.cli.study_parser import add_study_command
from verify.errors import instead

_EXIT_CODES = """\
exit codes:
  0  every verdict is PASS (or UNDECIDED, without --strict; or a known finding of its case)
  1  a verdict is FAIL, of whichever solver; goes before 3: it stands whatever others would say
  2  bad input or usage; nothing was run, nothing was written
  3  a solve failed, timed out, ran out of memory, or could not be stored
  4  nothing ran: no case matches, or every solver refused
  5  with --strict: something is UNDECIDED, refused, warned of, or without any verdict
  128+n  stopped by signal n (130: Ctrl-C); what is finished stays"""

_MAIN = f"""\
examples:
  verify list                                 the cases that come with the project
  verify describe statics/f3_inclined         what a case asks, in words
  verify run statics/f1_patch --out out       solve, compare, judge, report
  verify run -k demo --out out -j 2           all cases that mention 'demo', 2 at a time
  verify check my_case.toml                   validate an own case file without running
  verify run my_case.toml --out mine          run it
  verify report out                           render the report again

{_EXIT_CODES}"""

_RUN = f"""\
examples:
  verify run statics/f1_patch --out out
  verify run my_case.toml --out mine --solver xfem --timeout 60
  verify run -k "demo and not tissue" --out out -j 2
  verify run "statics/*" --quick --out out --strict --json > verdicts.json

Which suite first: -k demo (a minute) shows that all works here; then --quick (minutes); without a
selection all cases run that are not tagged heavy.

A run that was stopped is resumed by the same command: finished solves are reused if their
scene, their solver's parameters and the code are the same. Each solve runs in a process of its
own, on one thread. With -j above 1 the timings are marked as contended.

{_EXIT_CODES}"""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, with the nearest word that is right."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; an option that is none of this command is told where the others are known."""
        found, left = super().parse_known_args(args, namespace)
        if unknown := next((word for word in left if word.startswith("-")), None):
            options = [name for name in self._option_string_actions if name.startswith("--")]
            near = _nearest(unknown.partition("=")[0], options)
            self.error(f"unrecognized arguments: {' '.join(left)}{near}")
        return found, left

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if said := instead(f"verify {value}"):
            raise argparse.ArgumentError(action, said)
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            said = _nearest(str(value), known) or f"; expected one of {', '.join(known)}"
            raise argparse.ArgumentError(action, f"invalid choice: '{value}'{said}")
        super()._check_value(action, value)

    def error(self, message: str) -> NoReturn:
        print(f"{self.prog}: error: {message} (see {self.prog} --help)", file=sys.stderr)
        sys.exit(2)


def _nearest(word: str, known: Sequence[str]) -> str:
    close = get_close_matches(word, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


def build_parser() -> argparse.ArgumentParser:
    """Build the parser; its result has the function ``command`` that takes the result."""
    parser = _Parser(
        prog="verify",
        description="Verify cutting simulations: solve scenes, compare, judge, report.",
        epilog=_MAIN,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"verify {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=_Parser)

    def add(name: str, text: str, epilog: str) -> argparse.ArgumentParser:
        command = commands.add_parser(
            name,
            help=text,
            description=sentence(text),
            epilog=epilog,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.set_defaults(command=_late(name))
        return command

    _add_reading_commands(add)
    _add_run(add("run", "solve, compare and judge cases, and render the report", _RUN))
    add_extension_commands(add)
    add_study_command(add)
    add_play_command(add)
    add_cache_command(add)
    _add_doctor(add)
    _add_completion(add)
    return parser


def _add_completion(add: Add) -> None:
    command = add(
        "completion",
        "print a script that completes commands, options and cases in a shell",
        "examples:\n  verify completion bash > ~/.local/share/bash-completion/completions/verify\n"
        "  verify completion zsh > ~/.zfunc/_verify",
    )
    command.add_argument("shell", choices=("bash", "zsh"), help="the shell that shall read it")


def _add_doctor(add: Add) -> None:
    command = add(
        "doctor",
        "say what of the software that the solvers stand on is here, works, or is missing",
        "examples:\n  verify doctor\n  verify doctor --compile\n\n"
        "Exit code 0 if everything that a full run needs works, 3 if something is missing; each\n"
        "missing thing comes with the line that installs it.",
    )
    command.add_argument(
        "--compile",
        action="store_true",
        help="compile all kernels now, in two processes, and say what each module took",
    )
    add_json(command)


def _add_reading_commands(add: Add) -> None:
    command = add(
        "list",
        "list the cases, or the exact solutions",
        "examples:\n  verify list\n  verify list -k quick\n  verify list --exact\n"
        "  verify list --json",
    )
    command.add_argument("--exact", action="store_true", help="list exact solutions instead")
    command.add_argument("-k", metavar="EXPR", dest="expression", help="only matching cases")
    add_json(command)

    command = add(
        "describe",
        "say in words what a case asks",
        "examples:\n  verify describe statics/f1_patch\n  verify describe my_case.toml",
    )
    add_case(command)
    add_json(command, "print the case with all defaults")

    command = add(
        "check",
        "validate case files without running them",
        "examples:\n  verify check my_case.toml\n  verify check cases/*/*.toml",
    )
    command.add_argument("files", metavar="FILE", nargs="+", help="case file")
    add_json(command)

    add(
        "schema",
        "print the JSON Schema of a case file, for editors",
        "examples:\n  verify schema > case.schema.json",
    )

    command = add(
        "report",
        "render the report of a run or of studies again, without computing anything",
        "examples:\n  verify report out\n  verify report out --format markdown",
    )
    command.add_argument(
        "directory", metavar="DIR", type=Path, help="directory of a run or of studies"
    )
    command.add_argument(
        "--format", choices=("html", "markdown", "summary", "pdf"), default="html",
        help="a page (default); Markdown with pictures beside it; or PDF, which needs Chromium",
    )  # fmt: skip


def _add_run(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "cases", metavar="CASE", nargs="*", help="name, pattern or file of a case (default: all)"
    )
    command.add_argument(
        "-k", metavar="EXPR", dest="expression", help="words with and, or, not, parentheses, "
        "looked for in name, title and tags"
    )  # fmt: skip
    command.add_argument(
        "--out", metavar="DIR", type=Path, default=Path("verify-results"),
        help="run directory (default: verify-results)",
    )  # fmt: skip
    weight = command.add_mutually_exclusive_group()
    weight.add_argument("--quick", action="store_true", help="only cases tagged quick")
    weight.add_argument("--heavy", action="store_true", help="also cases tagged heavy")
    command.add_argument(
        "-j", "--jobs", metavar="N", dest="jobs", type=count, default=1,
        help="processes at the same time (default: 1)",
    )  # fmt: skip
    add_timeout(command, 600.0)
    command.add_argument(
        "--memory", metavar="GB", type=positive,
        help="resident memory above which a solve is killed "
        "(default: 80 %% of the machine's, shared by the processes)",
    )  # fmt: skip
    command.add_argument(
        "--solver", metavar="'NAME [PARAMETER=VALUE …]'", action="append", dest="solvers",
        default=[], help="solver to compare, or module:Class; with parameters it is a row of its "
        "own; repeat for several (default: those that the case names)",
    )  # fmt: skip
    command.add_argument(
        "--judge", metavar="NAME", action="append", dest="judge_only", default=[],
        help="solver that is judged; repeat for several (default: each that is asked and does "
        "not refuse the case); the others are compared and ranked only",
    )  # fmt: skip
    command.add_argument(
        "--set", metavar="SOLVER.NAME=VALUE", dest="parameters", action="append", default=[],
        help="parameter of a solver, e.g. xfem.scheme=implicit_euler; repeat for several",
    )  # fmt: skip
    add_repetitions(command, 3)
    add_strict(command)
    command.add_argument(
        "--cluster", metavar="ADDRESS",
        help="solve on the workers of the Dask scheduler at tcp://HOST:PORT or in this file",
    )  # fmt: skip
    command.add_argument(
        "--ranks", metavar="N", type=count, default=1,
        help="MPI ranks of each reference, here or on its worker (default: 1)",
    )  # fmt: skip
    command.add_argument(
        "--references", metavar="BUNDLE", type=Path,
        help="judge by the references in this file (`verify cache export`); solve none",
    )  # fmt: skip
    command.add_argument(
        "--no-cache", action="store_true", help="solve references again, and keep none"
    )
    command.add_argument(
        "--conform", action=argparse.BooleanOptionalAction,
        help="check every solver with the suite of `verify conform` before ranking "
        "(default: if more than two are ranked)",
    )  # fmt: skip
    command.add_argument(
        "--no-report", action="store_true", help="leave the report to `verify report DIR`"
    )
    add_json(command, "print the verdicts as JSON")


def _late(name: str) -> Callable[[argparse.Namespace], int]:
    """Import the module of a command only when it runs."""

    def command(arguments: argparse.Namespace) -> int:
        code: int = import_module(f"verify.cli.{name}_command").execute(arguments)
        return code

    return command
