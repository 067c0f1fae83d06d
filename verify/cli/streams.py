"""Standard output and error that let no escape sequence of others through to the terminal."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from verify.printable import visible

__all__ = ["printable_streams", "unfiltered"]


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
    """Filter what is printed meanwhile: titles, reasons and names come from others' files."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (stream if stream is None else _Printable(stream) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def unfiltered(stream: Any) -> Any:
    """Return the stream below, for what draws with escapes of its own."""
    return stream.stream if isinstance(stream, _Printable) else stream
