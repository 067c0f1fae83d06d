"""A command line made of functions: signatures are its arguments, docstrings its help.

A function is a command. Its parameters are arguments, those after ``*`` are options, and the first
paragraph of its docstring says what it does. The section "Parameters" of the docstring says what
each argument is, and what follows is printed below the options. The fields of a dataclass stand for
as many arguments. A module with `ACTIONS` is a command with commands below it, and is described by
its own docstring.
"""

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from difflib import get_close_matches
from inspect import Parameter, cleandoc, signature
from pathlib import Path
from types import ModuleType, NoneType
from typing import Annotated, Any, Literal, NoReturn, get_args, get_origin

from verify.errors import instead

Command = Callable[..., int]
Member = Command | ModuleType
_SECTION = re.compile(r"(?:Parameters|Attributes)\n-+\n(.*?)(?:\n\n|\Z)", re.DOTALL)
_ENTRY = re.compile(r"^(\w+)\n((?: {4}.*\n?)+)", re.MULTILINE)


@dataclass(frozen=True)
class Arg:
    """What the type of a parameter does not say of an argument.

    Attributes
    ----------
    metavar : str, optional
    flags : tuple of str
        Of an option; none: ``--name``.
    read : callable, optional
        Reads the word instead of the type.
    nargs : int or str, optional
        Of an option with several words; without it an option for a sequence is repeated.
    exclusive : bool
        Whether it stands beside no other such option of its command.
    help : str
        A default is added to it, unless it speaks of one. Without it the docstring counts.
    """

    metavar: str | None = None
    flags: tuple[str, ...] = ()
    read: Callable[[str], Any] | None = None
    nargs: int | str | None = None
    exclusive: bool = False
    help: str = ""


@dataclass(frozen=True)
class Actions:
    """The commands below a command, what help calls them, and the one that is meant without."""

    functions: tuple[Command, ...]
    metavar: str = "ACTION"
    default: Command | None = None


def count(text: str) -> int:
    """Read a whole number from 1 on."""
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number from 1 on, got '{text}'")
    return int(text)


def seed(text: str) -> int:
    """Read a whole number from 0 on."""
    return 0 if text == "0" else count(text)


def positive(text: str) -> float:
    """Read a positive number."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"expected a positive number, got '{text}'")
    return value


# what several commands have, in the same words
Case = Annotated[str, Arg("CASE", help="name of a case, or a case file")]
Cases = Annotated[str, Arg("CASE", help="name of a case, of a folder of cases, or a case file")]
Run = Annotated[Path, Arg("RUN", help="directory of a finished run")]
Out = Annotated[Path, Arg("DIR", help="directory to write into")]
AsJson = Annotated[bool, Arg(flags=("--json",), help="print JSON")]
Matching = Annotated[str | None, Arg("EXPR", ("-k",), help="only matching cases")]
Jobs = Annotated[int, Arg("N", ("-j", "--jobs"), count, help="processes at the same time")]
Strict = Annotated[bool, Arg(help="undecided verdicts, refusals, warnings: exit code 5")]
Timeout = Annotated[
    float, Arg("S", read=positive, help="wall seconds after which a solve is killed")
]
Repetitions = Annotated[int, Arg("N", read=count, help="timed repetitions of each solve")]


class _Help(argparse.RawDescriptionHelpFormatter):
    """Commands below the heading of their group."""

    def _format_action(self, action: argparse.Action) -> str:
        heading = getattr(action, "heading", None)
        above = f"\n{'':{self._current_indent - 2}}{heading}:\n" if heading else ""
        return above + super()._format_action(action)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, with the nearest valid word."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(formatter_class=_Help, **settings)

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
        """Leave with exit code 2."""
        print(f"{self.prog}: error: {message} (see {self.prog} --help)", file=sys.stderr)
        sys.exit(2)


def _nearest(word: str, known: Sequence[str]) -> str:
    close = get_close_matches(word, known, n=1)
    return f"; did you mean '{close[0]}'?" if close else ""


def add_commands(parser: argparse.ArgumentParser, groups: Mapping[str, Sequence[Member]]) -> None:
    """Add commands, in groups with headings, to a parser."""
    below = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    for group, members in groups.items():
        for member in members:
            command = _add_command(below, member)
            if isinstance(member, ModuleType):
                _add_actions(command, member.ACTIONS)
            if member is members[0]:
                vars(below._choices_actions[-1])["heading"] = group


def _add_actions(command: argparse.ArgumentParser, actions: Actions) -> None:
    below = command.add_subparsers(
        metavar=actions.metavar,
        required=actions.default is None,
        help=f"default: {_name(actions.default)}" if actions.default else None,
    )
    for function in actions.functions:
        _add_command(below, function)
    if actions.default:
        defaults = {p.name: p.default for p, _ in _parameters(actions.default)}
        command.set_defaults(command=actions.default, **defaults)


def _add_command(below: Any, member: Member) -> argparse.ArgumentParser:
    text, _, epilog = cleandoc(member.__doc__ or "").partition("\n\n")
    line = " ".join(text.split())
    command: argparse.ArgumentParser = below.add_parser(
        _name(member),
        help=(line[0].lower() + line[1:]).removesuffix("."),
        description=line,
        epilog=_SECTION.sub("", epilog).replace("Examples\n--------", "examples:"),
    )
    if not isinstance(member, ModuleType):
        command.set_defaults(command=member)
        place: Any = command
        for parameter, said in _parameters(member):
            if said.exclusive and place is command:
                place = command.add_mutually_exclusive_group()
            _add_argument(place if said.exclusive else command, parameter, said)
    return command


def _name(member: Member) -> str:
    return member.__name__.rpartition(".")[2].rstrip("_")


def _parameters(target: Callable[..., Any]) -> Iterator[tuple[Parameter, Arg]]:
    """Yield the arguments of a command, and what its type does not say of each."""
    listed = _SECTION.search(cleandoc(target.__doc__ or ""))
    words = dict(_ENTRY.findall(listed[1])) if listed else {}
    for name, parameter in signature(target).parameters.items():
        if _has_fields(parameter):
            yield from _parameters(parameter.annotation)
        else:
            (said,) = getattr(parameter.annotation, "__metadata__", (Arg(),))
            yield parameter, replace(said, help=said.help or " ".join(words[name].split()))


def _has_fields(parameter: Parameter) -> bool:
    return is_dataclass(parameter.annotation)


def _add_argument(command: Any, parameter: Parameter, said: Arg) -> None:
    """Add an argument as its type, its default and `said` describe it."""
    required = parameter.default is Parameter.empty
    default: Any = None if required else parameter.default
    annotated = get_origin(parameter.annotation) is Annotated
    kind = get_args(parameter.annotation)[0] if annotated else parameter.annotation
    plain = get_origin(kind) in (None, Literal)
    inner = kind if plain else next(one for one in get_args(kind) if one is not NoneType)
    several = get_origin(kind) is Sequence
    settings: dict[str, Any] = {"help": said.help}
    if default not in (None, False, ()) and "default" not in said.help:
        shown = default if isinstance(default, tuple) else (default,)
        words = (f"{one:g}" if isinstance(one, float) else str(one) for one in shown)
        settings["help"] += f" (default: {' '.join(words)})"
    if inner is bool:
        settings["action"] = argparse.BooleanOptionalAction if default is None else "store_true"
    elif get_origin(inner) is Literal:
        settings["choices"] = get_args(inner)
    else:
        settings |= {"metavar": said.metavar, "type": said.read or inner, "nargs": said.nargs}
    if parameter.kind is not Parameter.KEYWORD_ONLY:
        if several:
            settings["nargs"] = "+" if required else "*"
        command.add_argument(parameter.name, **settings)
        return
    if several and not said.nargs:
        settings["action"] = "append"
    flags = said.flags or (f"--{parameter.name.strip('_').replace('_', '-')}",)
    command.add_argument(
        *flags,
        dest=parameter.name,
        default=list(default) if several else default,
        required=required,
        **settings,
    )


def call(arguments: argparse.Namespace) -> int:
    """Call the command that was asked for, and return its exit code."""
    return _called(arguments.command, arguments)


def _called(target: Callable[..., Any], arguments: argparse.Namespace) -> Any:
    given = {
        name: _called(parameter.annotation, arguments)
        if _has_fields(parameter)
        else getattr(arguments, name)
        for name, parameter in signature(target).parameters.items()
    }
    return target(**given)


def arguments_of(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield the arguments of a command and of those below it."""
    for action in parser._actions:  # argparse has no public list of them
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for below in dict.fromkeys(action.choices.values()):
                yield from arguments_of(below)
