"""Completion of commands, options and cases in a shell, by shtab."""

import argparse
from collections.abc import Iterator

import shtab

from verify.cli.parser import build_parser
from verify.scene import list_cases

_CASES = "_verify_cases"


def execute(arguments: argparse.Namespace) -> int:
    """Print the script; the names of the cases are those of today."""
    parser = build_parser()
    for action in _actions(parser):
        if action.dest in ("case", "cases"):
            action.complete = {"bash": _CASES, "zsh": _CASES}  # type: ignore[attr-defined]
    names = " ".join(list_cases())
    functions = {
        "bash": f'{_CASES}() {{ compgen -W \'{names}\' -- "$1"; compgen -f -- "$1"; }}',
        "zsh": f"{_CASES}() {{ _alternative 'cases:case:({names})' 'files:file:_files' }}",
    }
    script = shtab.complete(parser, arguments.shell, preamble=functions)  # type: ignore[arg-type]
    print(script)
    return 0


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the arguments of a command and of those below it."""
    for action in parser._actions:  # argparse has no public list of them
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for below in dict.fromkeys(action.choices.values()):
                yield from _actions(below)
