"""Arguments that several commands have, in the same words."""

import argparse
from collections.abc import Callable
from pathlib import Path

from verify.cli.argument_types import count, positive

# of a command: its name, what it does, and its examples
Add = Callable[[str, str, str], argparse.ArgumentParser]


def sentence(text: str) -> str:
    """Make a line of help the description of a command; names in it keep their capitals."""
    end = "" if text.endswith("?") else "."
    return f"{text[0].upper()}{text[1:]}{end}"


def add_action(
    add: Callable[..., argparse.ArgumentParser], name: str, text: str
) -> argparse.ArgumentParser:
    """Add a command below a command, described by what it does."""
    return add(name, help=text, description=sentence(text))


def add_case(command: argparse.ArgumentParser) -> None:
    """Add the case that a command is about."""
    command.add_argument("case", metavar="CASE", help="name of a case, or a case file")


def add_run(command: argparse.ArgumentParser, name: str = "run", metavar: str = "RUN") -> None:
    """Add the directory of a run that is there."""
    command.add_argument(name, metavar=metavar, type=Path, help="directory of a finished run")


def add_out(command: argparse.ArgumentParser) -> None:
    """Add the directory that a command needs to write into."""
    command.add_argument(
        "--out", metavar="DIR", type=Path, required=True, help="directory to write into"
    )


def add_json(command: argparse.ArgumentParser, text: str = "print JSON") -> None:
    """Add the answer as JSON."""
    command.add_argument("--json", action="store_true", help=text)


def add_strict(
    command: argparse.ArgumentParser,
    text: str = "undecided verdicts, refusals, warnings: exit code 5",
) -> None:
    """Add the exit code for what is undecided."""
    command.add_argument("--strict", action="store_true", help=text)


def add_timeout(
    command: argparse.ArgumentParser, default: float, killed: str = "a solve is killed"
) -> None:
    """Add the time limit of each solve."""
    command.add_argument(
        "--timeout", metavar="S", type=positive, default=default,
        help=f"wall seconds after which {killed} (default: {default:g})",
    )  # fmt: skip


def add_repetitions(
    command: argparse.ArgumentParser,
    default: int | None,
    said: str | None = None,
    what: str = "timed repetitions of each solve",
) -> None:
    """Add how often solves are timed; `said` instead of the default, where that is not one."""
    command.add_argument(
        "--repetitions", metavar="N", type=count, default=default,
        help=f"{what} (default: {said or default})",
    )  # fmt: skip
