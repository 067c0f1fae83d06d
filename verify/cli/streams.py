"""Output to the terminal, free of escape sequences of others; JSON; the command line as text."""

import json
import os
import re
import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from verify.printable import visible

_COLOURS = {"PASS": 32, "FAIL": 31, "ERROR": 31, "WARNING": 33, "UNDECIDED": 33, "NOT JUDGED": 33}
_VERDICT = re.compile(rf"\b({'|'.join(_COLOURS)})\b")


class _Printable:
    """A stream of text that writes what does not print visibly; all else is the stream's own."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        self.stream.write(visible(text))
        return len(text)

    def writelines(self, lines: Any) -> None:
        for line in lines:
            self.write(line)


@contextmanager
def printable_streams() -> Iterator[None]:
    """Filter the output of the block: titles, reasons and names come from others' files."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (stream if stream is None else _Printable(stream) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def unfiltered(stream: Any) -> Any:
    """Return the stream below, for what draws with escapes of its own."""
    return stream.stream if isinstance(stream, _Printable) else stream


def print_line(text: str) -> None:
    """Print a line with its verdict in colour, on a terminal that shows colours.

    Not where ``NO_COLOR`` is set, or the output goes elsewhere.
    """
    below = unfiltered(sys.stdout)
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    if plain or below is None or not below.isatty():
        print(text)
    else:
        print(in_colour(visible(text)), file=below)


def in_colour(line: str) -> str:
    """Return a line with its first verdict in colour."""
    return _VERDICT.sub(lambda m: f"\x1b[{_COLOURS[m[1]]}m{m[1]}\x1b[0m", line, count=1)


def print_json(content: Any, ensure_ascii: bool = True) -> None:
    """Print an answer as JSON."""
    print(json.dumps(content, indent=2, ensure_ascii=ensure_ascii))


def print_answer(
    as_json: bool, answer: Any, lines: Iterable[str], code: int = 0, ensure_ascii: bool = True
) -> int:
    """Print an answer as JSON, or as lines; return the exit code."""
    if as_json:
        print_json(answer, ensure_ascii)
    else:
        for line in lines:
            print(line)
    return code


def command_line() -> str:
    """Return the command as it was typed, for the record."""
    return shlex.join(["verify", *sys.argv[1:]])
